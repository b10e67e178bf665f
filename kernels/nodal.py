"""The paper's literal scheme (its eqs. 4 to 6): points, nearest nodes, β once per node and step.

The published rows came from this scheme. It has no limit in the time step or the grid (docs/model.md §4), and no
condition
on the direction of motion. Its forces can push energy into the core. The kick is therefore reduced where it would raise
the kinetic energy (rigid_body.restraint), as in every scheme here.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, exposure, plate_grid, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a literal step's load for one variant."""
    struct = structs.build(variant)
    real, vec3 = variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(core_surface, exposure, plate_grid)

    @wp.func
    def outward_of(surface: struct.Surface, pose: struct.Pose, index: wp.int32):
        """Unit vector outwards at an azimuth."""
        return surface.cosine[index] * pose.right + surface.sine[index] * pose.up

    @wp.func
    def open_window(plate: struct.Plate, thickness: real, fields: struct.Fields, layer: wp.int32, hit: wp.vec2d):
        """The window of a layer about a hit, untouched. Its nodes are the centres of the tile's cells, each with its
        share of the resistance."""
        cells_y, cells_z = fields.cells_y[layer], fields.cells_z[layer]
        window = use.plate_grid.window_at(plate, thickness, fields.first[layer], cells_y, cells_z, hit)
        dy, dz = plate.period_y / wp.float64(plate.tile_y), plate.period_z / wp.float64(plate.tile_z)
        home_y, home_z = wp.int32(wp.floor(hit[0] / dy)), wp.int32(wp.floor(hit[1] / dz))
        window.y0 = real((wp.float64(home_y) + wp.float64(0.5)) * dy - hit[0])
        window.z0 = real((wp.float64(home_z) + wp.float64(0.5)) * dz - hit[1])
        index = window.first
        for i in range(cells_y):
            row = use.plate_grid.within(real(home_y % plate.tile_y + i - cells_y // 2), plate.tile_y) * plate.tile_z
            column = use.plate_grid.within(real(home_z % plate.tile_z - cells_z // 2), plate.tile_z)
            y = window.y0 + real(i - cells_y // 2) * real(dy)
            for j in range(cells_z):
                share = plate.tile[row + column]
                if wp.static(variant.rimmed):
                    share *= use.plate_grid.on_plate(plate, window, y, window.z0 + real(j - cells_z // 2) * real(dz))
                fields.share[index] = share
                fields.touched[index] = zero
                index += 1
                column += 1
                if column == plate.tile_z:
                    column = 0
        return window

    @wp.func
    def node_under(window: struct.Window, point: vec3):
        """Index of the node nearest to a point."""
        row = wp.int32(wp.floor((point[1] - window.y0) * window.per_row + half))
        column = wp.int32(wp.floor((point[2] - window.z0) * window.per_column + half))
        return window.home + row * window.cells_z + column

    @wp.func
    def total_load(context: struct.Context, slab: struct.Slab):
        """Σ Y (−n + η t) dS over the points in the slab, t the meridian tangent towards the base."""
        surface, fields, window, pose = context.surface, context.fields, slab.window, slab.pose
        load = struct.Load()
        for index in range(slab.footprint.first_ring, slab.footprint.last_ring + 1):
            ring = use.core_surface.ring_at(surface, pose, index)
            for j in range(surface.around):
                outward = outward_of(surface, pose, j)
                arm = ring.station * pose.axis + ring.radius * outward
                point = pose.position + arm
                if point[0] >= zero and point[0] <= window.thickness:
                    node = node_under(window, point)
                    normal = ring.normal_axial * pose.axis + ring.normal_radial * outward
                    tangent = ring.normal_axial * outward - ring.normal_radial * pose.axis
                    resistance = slab.law.a0 * fields.share[node]
                    force = (resistance * ring.area) * (slab.law.friction * tangent - normal)
                    load.touching = load.touching or fields.share[node] > zero
                    load.force += force
                    load.moment += wp.cross(arm, force)
                    if wp.static(variant.degrades):
                        fields.touched[node] = one
        to_body = wp.transpose(wp.matrix_from_cols(pose.axis, pose.right, pose.up))
        load.force = to_body * load.force
        load.moment = to_body * load.moment
        return load

    @wp.func
    def degrade(context: struct.Context, slab: struct.Slab):
        """Multiply every node that was touched in this step by β once, even if several points touched it (eq. 6)."""
        surface, fields, window, pose = context.surface, context.fields, slab.window, slab.pose
        for index in range(slab.footprint.first_ring, slab.footprint.last_ring + 1):
            ring = use.core_surface.ring_at(surface, pose, index)
            for j in range(surface.around):
                arm = ring.station * pose.axis + ring.radius * outward_of(surface, pose, j)
                point = pose.position + arm
                if point[0] >= zero and point[0] <= window.thickness:
                    node = node_under(window, point)
                    if fields.touched[node] > zero:
                        fields.share[node] = fields.share[node] * slab.law.degradation
                        fields.touched[node] = zero

    @wp.func
    def load_on(context: struct.Context, slab: struct.Slab):
        """The load of one step in the literal scheme; touched nodes weaken."""
        load = total_load(context, slab)
        if wp.static(variant.degrades):
            degrade(context, slab)
        return load

    fields_of_slot = use.exposure.fields_of_slot
    return SimpleNamespace(**locals())
