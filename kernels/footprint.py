"""What a step can touch: the rings in the slab, and the nodes of the window around them."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, lanes, plate_grid
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the footprint for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(core_surface, lanes, plate_grid)
    Surface, Pose, ring_at = use.core_surface.Surface, use.core_surface.Pose, use.core_surface.ring_at
    Plate, Window, Box = use.plate_grid.Plate, use.plate_grid.Window, use.plate_grid.Box
    far = wp.constant(2**20)  # nodes away: beyond any window

    @wp.struct
    class Footprint:
        """What a step can touch. `first_ring` and `last_ring` are the first and the last ring that can be in the slab;
        last < first if there is none. `first_closing` and `last_closing` are those of them that may close in. `through`
        means that all rings are behind the rear face, `back` that all are before the front face. `box` holds the nodes
        around the rings in the slab. `inside` means that the window holds the box."""

        first_ring: wp.int32
        last_ring: wp.int32
        first_closing: wp.int32
        last_closing: wp.int32
        through: wp.bool
        back: wp.bool
        inside: wp.bool
        box: Box

    @wp.func
    def node_below(window: Window, place: real):
        """Nodes from the hit to the last one before a place along one direction."""
        return wp.int32(wp.floor(place * window.per_cell))

    @wp.func
    def holds(plate: Plate, window: Window, box: Box):
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
    def footprint_of(surface: Surface, plate: Plate, window: Window, pose: Pose, dt: real):
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
        plane_low, plane_high = int(far), int(-far)
        index = int(0)
        if wp.static(variant.window > 0):
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
            if wp.static(variant.deep):
                behind, ahead = use.plate_grid.planes_at(window, rearmost), use.plate_grid.planes_at(window, foremost)
                plane_low = wp.min(plane_low, wp.where(within, wp.int32(behind), far))
                plane_high = wp.max(plane_high, wp.where(within, wp.int32(ahead) + 1, -far))
            if wp.static(variant.window > 0):
                index += use.lanes.count()
            else:
                index += 1
        if wp.static(variant.window > 0):
            first_ring, last_ring = use.lanes.least(first_ring), use.lanes.most(last_ring)
            first_closing, last_closing = use.lanes.least(first_closing), use.lanes.most(last_closing)
            not_through, not_back = use.lanes.most(not_through), use.lanes.most(not_back)
            y_low, y_high = use.lanes.least(y_low), use.lanes.most(y_high)
            z_low, z_high = use.lanes.least(z_low), use.lanes.most(z_high)
            if wp.static(variant.deep):
                plane_low, plane_high = use.lanes.least(plane_low), use.lanes.most(plane_high)
        found = Footprint()
        found.first_ring = first_ring
        found.last_ring = last_ring
        found.first_closing = first_closing
        found.last_closing = last_closing
        found.through = not_through == 0
        found.back = not_back == 0
        found.inside = True
        if last_ring >= 0:
            # One node of slack, because rounding may move a patch at the ring's outermost point.
            found.box.y_low = window.home_y + y_low - 1
            found.box.y_high = window.home_y + y_high + 2
            found.box.z_low = window.home_z + z_low - 1
            found.box.z_high = window.home_z + z_high + 2
            found.box.plane_low = plane_low
            found.box.plane_high = plane_high
            found.inside = holds(plate, window, found.box)
        return found

    @wp.func
    def clearance_at(plate: Plate, window: Window, y: real, z: real):
        """A lower bound of a point's distance from material: in a hole, or beside a finite plate [m]."""
        beside = wp.max(wp.max(window.low_y - y, y - window.high_y), wp.max(window.low_z - z, z - window.high_z))
        return wp.max(beside, plate.clear[use.plate_grid.tile_at(plate, window, y, z)])

    @wp.func
    def is_clear(plate: Plate, window: Window, found: Footprint):
        """Whether there is no material at the nodes around the rings in the slab, with a node to spare."""
        y = half * real(found.box.y_low + found.box.y_high - 2 * window.home_y) * plate.spacing
        z = half * real(found.box.z_low + found.box.z_high - 2 * window.home_z) * plate.spacing
        wide = half * real(found.box.y_high - found.box.y_low) + one
        long = half * real(found.box.z_high - found.box.z_low) + one
        reach = wp.sqrt(wide * wide + long * long) * plate.spacing
        return clearance_at(plate, window, y, z) > reach

    @wp.func
    def is_beside(window: Window, found: Footprint, cells: wp.int32):
        """Whether a window would hold none of the nodes around the rings in the slab, if it had so many in each
        direction: a core that comes back elsewhere."""
        first_y, first_z = window.home_y - cells // 2, window.home_z - cells // 2
        return (
            found.box.y_high < first_y
            or found.box.z_high < first_z
            or found.box.y_low >= first_y + cells
            or found.box.z_low >= first_z + cells
        )

    return SimpleNamespace(**locals())
