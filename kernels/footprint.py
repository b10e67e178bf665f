"""What a step can touch: the rings in the slab, and the nodes of the window around them."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, core_surface, lanes, plate_grid, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the footprint for one variant."""
    struct = structs.build(variant)
    real, vec3 = variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(core_surface, lanes, plate_grid)
    ring_at = use.core_surface.ring_at
    far = wp.constant(constants.FAR_NODES.value)

    @wp.func
    def node_below(window: struct.Window, place: real):
        """Number of nodes from the hit to the last node before a place along one direction."""
        return wp.int32(wp.floor(place * window.per_cell))

    @wp.func
    def holds(plate: struct.Plate, window: struct.Window, box: struct.Box):
        """Whether a window has all nodes that contact in a box acts on."""
        # The filter's first pass covers rows up to twice its reach away and reads slightly beyond them.
        rows = 2 * plate.reach + 1
        return (
            box.y_low >= rows
            and box.z_low >= plate.reach
            and box.y_high < window.cells_y - rows
            and box.z_high < window.cells_z - plate.reach
        )

    @wp.func
    def footprint_of(surface: struct.Surface, plate: struct.Plate, window: struct.Window, pose: struct.Pose, dt: real):
        """The footprint at mid-step. Patches act at their centres, so a ring covers centre ± radius."""
        broadside = use.core_surface.broadside(pose)
        across_y = wp.sqrt(wp.max(zero, one - pose.axis[1] * pose.axis[1]))
        across_z = wp.sqrt(wp.max(zero, one - pose.axis[2] * pose.axis[2]))
        advance = half * dt * wp.abs(wp.dot(pose.velocity, vec3(pose.axis[0], pose.right[0], pose.up[0])))
        turning = half * dt * wp.length(pose.omega)
        # Integers, because a compiler vectorises their minimum, but not that of numbers that may be NaN.
        first_ring, last_ring, not_through, not_back = int(surface.rings), int(-1), int(0), int(0)
        first_closing, last_closing = int(surface.rings), int(-1)
        y_low, y_high, z_low, z_high = int(far), int(-far), int(far), int(-far)
        index = use.lanes.lane()
        while index < surface.rings:
            ring = ring_at(surface, pose, index)
            reach = use.core_surface.reach_along_x(ring, pose, broadside, advance, turning)
            foremost, rearmost = ring.centre[0] + reach, ring.centre[0] - reach
            within = foremost > zero and rearmost < window.thickness
            first_ring = wp.min(first_ring, wp.where(within, index, surface.rings))
            last_ring = wp.max(last_ring, wp.where(within, index, -1))
            closing = within and use.core_surface.closes(pose, ring)
            first_closing = wp.min(first_closing, wp.where(closing, index, surface.rings))
            last_closing = wp.max(last_closing, wp.where(closing, index, -1))
            not_through += wp.where(rearmost > window.thickness, 0, 1)
            not_back += wp.where(foremost < zero, 0, 1)
            wide_y, wide_z = ring.radius * across_y, ring.radius * across_z
            y_low = wp.min(y_low, wp.where(within, node_below(window, ring.centre[1] - wide_y), far))
            z_low = wp.min(z_low, wp.where(within, node_below(window, ring.centre[2] - wide_z), far))
            y_high = wp.max(y_high, wp.where(within, node_below(window, ring.centre[1] + wide_y), -far))
            z_high = wp.max(z_high, wp.where(within, node_below(window, ring.centre[2] + wide_z), -far))
            index += use.lanes.count()
        footprint = struct.Footprint()
        footprint.first_ring = use.lanes.least(first_ring)
        footprint.last_ring = use.lanes.most(last_ring)
        footprint.first_closing = use.lanes.least(first_closing)
        footprint.last_closing = use.lanes.most(last_closing)
        footprint.through = use.lanes.most(not_through) == 0
        footprint.back = use.lanes.most(not_back) == 0
        footprint.inside = True
        y_low, y_high = use.lanes.least(y_low), use.lanes.most(y_high)
        z_low, z_high = use.lanes.least(z_low), use.lanes.most(z_high)
        if footprint.last_ring >= 0:
            # One node of slack, because rounding may move a patch at the ring's outermost point.
            footprint.box.y_low = window.home_y + y_low - 1
            footprint.box.y_high = window.home_y + y_high + 2
            footprint.box.z_low = window.home_z + z_low - 1
            footprint.box.z_high = window.home_z + z_high + 2
            footprint.inside = holds(plate, window, footprint.box)
        return footprint

    @wp.func
    def pushes(surface: struct.Surface):
        """Largest distance at which a core presses on material that it has pushed ahead [m]."""
        far = zero
        if wp.static(variant.free_surface):
            far = surface.max_radius
        return far

    @wp.func
    def clearance_at(plate: struct.Plate, window: struct.Window, y: real, z: real):
        """A lower bound of a point's distance from material: in a hole, or beside a finite plate [m]."""
        distance = wp.max(wp.max(window.low_y - y, y - window.high_y), wp.max(window.low_z - z, z - window.high_z))
        return wp.max(distance, plate.clear[use.plate_grid.tile_at(plate, window, y, z)])

    @wp.func
    def is_clear(plate: struct.Plate, window: struct.Window, footprint: struct.Footprint, pushed: real):
        """Whether there is no material within `pushed` [m] and one spare node of the nodes around the rings in the
        slab."""
        y = half * real(footprint.box.y_low + footprint.box.y_high - 2 * window.home_y) * plate.spacing
        z = half * real(footprint.box.z_low + footprint.box.z_high - 2 * window.home_z) * plate.spacing
        wide = half * real(footprint.box.y_high - footprint.box.y_low) + one
        long = half * real(footprint.box.z_high - footprint.box.z_low) + one
        reach = wp.sqrt(wide * wide + long * long) * plate.spacing
        return clearance_at(plate, window, y, z) > reach + pushed

    @wp.func
    def is_elsewhere(window: struct.Window, footprint: struct.Footprint, cells: wp.int32):
        """Whether a window with this number of cells in each direction holds no node around the rings in the slab: the
        core comes back elsewhere."""
        first_y, first_z = window.home_y - cells // 2, window.home_z - cells // 2
        return (
            footprint.box.y_high < first_y
            or footprint.box.z_high < first_z
            or footprint.box.y_low >= first_y + cells
            or footprint.box.z_low >= first_z + cells
        )

    return SimpleNamespace(**locals())
