"""Loops whose passes the processor computes side by side."""

from typing import Any

import warp as wp


def over_runs(struct: Any, real: Any, function: Any) -> Any:
    """A device function that calls f(mesh, sheet, number, dt) for all numbers of some runs of a Mesh (fields.py) in the
    sheets that are awake.

    The passes of such a loop write to places of their own, which no other pass reads. A compiler cannot see this of
    arrays that are known at run time only, and gives up at 128 pairs that it would have to check. The pragma says so.
    """

    @wp.func_native(f"""
    #if !defined(__CUDA_ARCH__)
    _Pragma("clang loop vectorize(assume_safety)")
    #endif
    for (int number = first; number < last; ++number) {function.native_func}(mesh, sheet, number, dt);
    """)
    def call_all(mesh: struct.Mesh, sheet: struct.Sheet, first: wp.int32, last: wp.int32, dt: real): ...

    @wp.func(name=f"{function.key.rpartition('.')[2]}_all")
    def call_in_runs(mesh: struct.Mesh, runs: wp.array(dtype=wp.int32), dt: real):
        for run in range(runs.shape[0] // 3):
            first, last, layer = runs[3 * run], runs[3 * run + 1], runs[3 * run + 2]
            sheet = mesh.sheets[layer]
            if last < first:  # never: it names the function, so that it is compiled before the loop that calls it
                function(mesh, sheet, first, dt)
            if mesh.awake[layer] != 0:
                call_all(mesh, sheet, first, last, dt)

    return call_in_runs
