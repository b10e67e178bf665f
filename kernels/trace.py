"""The trace of a shot: one row of numbers per step, and a last one, without load, where contact ended."""

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
    real, vec3 = variant.real, variant.vec3
    time_at, position_at, attitude_at, velocity_at, momentum_at, force_at, moment_at, step_at = (
        wp.constant(columns.start) for columns in COLUMNS.values()
    )

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
