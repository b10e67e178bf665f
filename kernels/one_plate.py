"""A target of one plate: what a step can touch of it, and its load. The interface is that of kernels/layers.py."""

from functools import cache
from types import ModuleType, SimpleNamespace

import warp as wp

from . import core_surface, earlier, footprint, interaction, passage, plate_grid, rigid_body, shots, target
from .status import RUNNING, Status
from .variant import Variant


@cache
def build(variant: Variant, scheme: ModuleType) -> SimpleNamespace:
    """Device functions of a single plate for one variant, whose load a scheme computes."""
    real, vec3 = variant.real, variant.vec3
    zero, one = real(0.0), real(1.0)
    use = variant.use(core_surface, earlier, footprint, interaction, passage, plate_grid, rigid_body, shots)
    plates, loads = target.build(variant, scheme), scheme.build(variant)
    Surface, Pose, Window = use.core_surface.Surface, use.core_surface.Pose, use.plate_grid.Window
    Body, State, Change = use.rigid_body.Body, use.rigid_body.State, use.rigid_body.Change
    Law, Footprint, Shots = use.interaction.Law, use.footprint.Footprint, use.shots.Shots
    Target, Fields, Touches = plates.Target, loads.Fields, loads.Touches
    Earlier, Passage = use.earlier.Earlier, use.passage.Passage

    @wp.struct
    class Stack:
        """No scratch: a plate has no layers to remember."""

        found: wp.array(dtype=wp.int32)

    @wp.struct
    class Reached:
        """What a step can touch, and the window of the plate. A core is never `behind` a plate of its target,
        and nothing is a `barrier` to it."""

        found: Footprint
        window: Window
        behind: wp.bool
        barrier: real

    @wp.func
    def reach_of(surface: Surface, thickness: real, state: State):
        """Largest distance from the hit [m], in the plane of the plate, of any part of a core that touches nothing."""
        axis = use.rigid_body.axis_of(state.attitude)
        slope = vec3(zero, state.velocity[1], state.velocity[2]) / state.velocity[0]
        lean = axis - axis[0] * slope  # of the axis against the line of flight
        steep = wp.length(slope)
        return (
            surface.max_radius * (one + steep)
            + surface.bounding_radius * wp.length(vec3(zero, lean[1], lean[2]))
            + thickness * steep
        )

    @wp.func
    def first_step(target: Target, shot: wp.int32, shortest: real):
        """Every step is as long [s]."""
        return shortest

    @wp.func
    def next_step(
        surface: Surface,
        target: Target,
        shot: wp.int32,
        pose: Pose,
        reached: Reached,
        last: Change,
        dt: real,
        free: real,
        shortest: real,
    ):
        """Every step is as long [s]."""
        return shortest

    @wp.func
    def begin(
        surface: Surface,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        shots: Shots,
        slot: wp.int32,
        shot: wp.int32,
        state: State,
    ):
        """Open the window of the plate; a core that flies clear through a hole ends at once."""
        plates.begin(earlier, slot, shot)
        reached = Reached()
        reached.window = plates.open_window(target, fields, earlier, shots, slot, 0, shot, vec3())
        clear = use.plate_grid.clearance(plates.plate_of(target, 0), reached.window)
        status = wp.where(clear > reach_of(surface, reached.window.thickness, state), Status.MISSED, RUNNING)
        return reached, status

    @wp.func
    def reach(
        surface: Surface,
        body: Body,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        shots: Shots,
        slot: wp.int32,
        shot: wp.int32,
        state: State,
        pose: Pose,
        before: Reached,
        last: Change,
        time: real,
        dt: real,
    ):
        """Find what a step can touch of the plate."""
        reached = before
        reached.found = use.footprint.footprint_of(surface, plates.plate_of(target, 0), reached.window, pose, dt)
        return reached

    @wp.func
    def law_at(target: Target, law: Law, stack: Stack, slot: wp.int32, shot: wp.int32, reached: Reached):
        """The law with the onset of what a step can touch: that of the plate."""
        return law

    @wp.func
    def load_on(
        surface: Surface,
        target: Target,
        law: Law,
        fields: Fields,
        stack: Stack,
        touches: Touches,
        passage: Passage,
        slot: wp.int32,
        shot: wp.int32,
        reached: Reached,
        pose: Pose,
        dt: real,
    ):
        """The load of the plate over one step."""
        if wp.static(variant.bends):
            loads.clear_sums(surface, touches, slot)
        plate = plates.plate_of(target, 0)
        return loads.load_on(surface, plate, law, fields, reached.window, touches, slot, reached.found, pose, dt)

    @wp.func
    def follow(
        surface: Surface,
        target: Target,
        stack: Stack,
        earlier: Earlier,
        slot: wp.int32,
        shot: wp.int32,
        reached: Reached,
        pose: Pose,
    ):
        """Take note, for later shots, of where the core is in the plate."""
        plates.follow(surface, earlier, reached.window, slot, 0, shot, pose)

    @wp.func
    def free_time(
        surface: Surface, target: Target, shot: wp.int32, state: State, pose: Pose, reached: Reached, dt: real
    ):
        """A core beside the plate goes on step by step, and it is never lost."""
        return zero, False

    @wp.func
    def given_up(target: Target, shot: wp.int32, reached: Reached, state: State, touched: wp.bool):
        """The status of a core that has not ended."""
        return Status.UNFINISHED

    @wp.func
    def conclude(
        surface: Surface,
        target: Target,
        fields: Fields,
        stack: Stack,
        earlier: Earlier,
        passage: Passage,
        slot: wp.int32,
        shot: wp.int32,
        status: wp.int32,
        reached: Reached,
    ):
        """Keep what later shots at this plate need."""
        plates.keep(fields, earlier, reached.window, slot, shot)
        if status == Status.PERFORATED:
            plates.leave_channel(surface, earlier, reached.window, slot, 0, shot)

    return SimpleNamespace(**locals())
