"""The time of a shot, and its trace: one row of numbers per step, and a last one, without load, where contact ended.

A shot has steps of several lengths, each of which counts from mid-step. A kick acts at the middle of its step, and the
core drifts freely from there to the middle of the next step (leapfrog). The position of a step is therefore the one at
mid-step, and the state after the last kick is drifted to the middle of a step that is not computed. Steps are counted
as if all had the shortest length, and only the excess of longer ones is summed, so a shot of equal steps has times
without rounding errors.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import structs
from .variant import Variant

COLUMNS = {
    "time": slice(0, 1),
    "position": slice(1, 4),
    "attitude": slice(4, 8),
    "velocity": slice(8, 11),
    "angular_momentum": slice(11, 14),
    "force": slice(14, 17),
    "moment": slice(17, 20),
    "step": slice(20, 21),
}
"""Columns of a row, SI. The attitude is (x, y, z, w); force and moment are means over the step, `step` is its length.
The time is that of mid-step."""
WIDTH = COLUMNS["step"].stop
"""Numbers per row."""


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the trace for one variant."""
    struct = structs.build(variant)
    real, vec3, half = variant.real, variant.vec3, variant.real(0.5)
    time_at, position_at, attitude_at, velocity_at, momentum_at, force_at, moment_at, step_at = (
        wp.constant(columns.start) for columns in COLUMNS.values()
    )

    @wp.func
    def started(shortest: real, step: real):
        """The clock at the middle of the first step, which is `step` long [s]."""
        clock = struct.Clock()
        clock.shortest = shortest
        clock.step = step
        clock.beyond = half * (step - shortest)
        return clock

    @wp.func
    def now(clock: struct.Clock):
        """Time since the start of the shot at mid-step [s]."""
        return (real(clock.steps) + half) * clock.shortest + clock.beyond

    @wp.func
    def in_contact(clock: struct.Clock):
        """The clock of a step that touches material."""
        counted = clock
        counted.contact_steps += 1
        counted.contact_beyond += clock.step - clock.shortest
        return counted

    @wp.func
    def contact_duration(clock: struct.Clock):
        """Length of all steps that touched material [s]."""
        return real(clock.contact_steps) * clock.shortest + clock.contact_beyond

    @wp.func
    def drift_time(clock: struct.Clock, following: real):
        """Time from this mid-step to that of the `following` step, without a free flight between them [s]."""
        return half * (clock.step + following)

    @wp.func
    def advanced(clock: struct.Clock, following: real, free: real):
        """The clock at the middle of the `following` step [s], after a `free` flight between the steps [s]."""
        later = clock
        later.beyond += drift_time(clock, following) - clock.shortest + free
        later.step = following
        later.steps += 1
        return later

    @wp.func
    def write_vec3(trace: wp.array2d(dtype=real), row: wp.int32, column: wp.int32, value: vec3):
        for k in range(3):
            trace[row, column + k] = value[k]

    @wp.func
    def record(
        trace: wp.array2d(dtype=real),
        row: wp.int32,
        time: real,
        dt: real,
        state: struct.State,
        force: vec3,
        moment: vec3,
    ):
        """Write the row of one step: the state after its kick, and the load of the kick."""
        trace[row, time_at] = time
        trace[row, step_at] = dt
        write_vec3(trace, row, position_at, state.position)
        for k in range(4):
            trace[row, attitude_at + k] = state.attitude[k]
        write_vec3(trace, row, velocity_at, state.velocity)
        write_vec3(trace, row, momentum_at, state.angular_momentum)
        write_vec3(trace, row, force_at, force)
        write_vec3(trace, row, moment_at, moment)

    return SimpleNamespace(**locals())
