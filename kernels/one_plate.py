"""A target of one plate: its footprint in a step, and its load. layers.py has the same functions for several layers."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import contact, footprint, plate_grid, rigid_body, structs, target
from .status import RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a single plate for one variant."""
    struct, real, vec3 = structs.build(variant), variant.real, variant.vec3
    zero, one = real(0.0), real(1.0)
    use, scheme = variant.use(contact, footprint, plate_grid, rigid_body, target), target.scheme_of(variant)

    @wp.func
    def farthest_off(surface: struct.Surface, thickness: real, state: struct.State):
        """Largest distance from the hit [m], in the plane of the plate, of any part of a core that touches nothing."""
        axis = use.rigid_body.axis_of(state.attitude)
        slope = vec3(zero, state.velocity[1], state.velocity[2]) / state.velocity[0]
        lean = axis - axis[0] * slope  # lean of the axis against the line of flight
        steep = wp.length(slope)
        return (
            surface.max_radius * (one + steep)
            + surface.bounding_radius * wp.length(vec3(zero, lean[1], lean[2]))
            + thickness * steep
        )

    @wp.func
    def first_step(context: struct.Context, shortest: real):
        """Length of the first step [s]. Every step has the shortest length."""
        return shortest

    @wp.func
    def next_step(
        context: struct.Context,
        reach: struct.Reach,
        pose: struct.Pose,
        last: struct.Change,
        clock: struct.Clock,
        free: real,
    ):
        """Length of the next step [s]. Every step has the shortest length."""
        return clock.shortest

    @wp.func
    def begin(context: struct.Context, state: struct.State):
        """Open the window of the plate; a core that flies clear through a hole ends at once."""
        reach = struct.Reach()
        reach.window = use.target.open_window(context, 0, vec3())
        plate = use.target.plate_of(context.target, 0)
        clear = plate.clear[use.plate_grid.tile_at(plate, reach.window, zero, zero)]  # clearance at the hit
        off = farthest_off(context.surface, reach.window.thickness, state) + use.footprint.pushes(context.surface)
        return reach, wp.where(clear > off, Status.UNTOUCHED, RUNNING)

    @wp.func
    def find_reach(
        context: struct.Context,
        before: struct.Reach,
        state: struct.State,
        pose: struct.Pose,
        last: struct.Change,
        dt: real,
    ):
        """The footprint of the step on the plate."""
        reach = before
        plate = use.target.plate_of(context.target, 0)
        reach.footprint = use.footprint.footprint_of(context.surface, plate, reach.window, pose, dt)
        return reach

    @wp.func
    def law_at(context: struct.Context, law: struct.Law, reach: struct.Reach):
        """The law of the plate."""
        return law

    @wp.func
    def load_on(context: struct.Context, law: struct.Law, reach: struct.Reach, pose: struct.Pose, dt: real):
        """The load of the plate over one step."""
        if wp.static(variant.bends):
            use.contact.clear_sums(context)
        slab = struct.Slab()
        slab.plate = use.target.plate_of(context.target, 0)
        slab.law = law
        slab.window = reach.window
        slab.footprint = reach.footprint
        slab.pose = pose
        slab.dt = dt
        return scheme.load_on(context, slab)

    @wp.func
    def free_time(context: struct.Context, reach: struct.Reach, state: struct.State, pose: struct.Pose, dt: real):
        """No free time: a core beside the plate goes on step by step, and is never lost."""
        return zero, False

    @wp.func
    def conclude(context: struct.Context, reach: struct.Reach, state: struct.State, status: wp.int32, touched: wp.bool):
        """The final status: the computation of a core that has not ended is not complete."""
        return wp.where(status == RUNNING, Status.UNFINISHED, status)

    return SimpleNamespace(**locals())
