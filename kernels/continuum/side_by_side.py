"""Loops whose passes the processor computes side by side."""

from typing import Any


def in_lanes(function: Any) -> str:
    """Native code that calls a device function f(mesh, sheet, number, dt) for every number from `first` to `last`.

    The passes of such a loop write to places of their own, which no other pass reads. A compiler cannot see this of
    arrays that are known at run time only, and gives up at 128 pairs that it would have to check. The pragma says so.
    """
    return f"""
    #if !defined(__CUDA_ARCH__)
    _Pragma("clang loop vectorize(assume_safety)")
    #endif
    for (int number = first; number < last; ++number) {function.native_func}(mesh, sheet, number, dt);
    """
