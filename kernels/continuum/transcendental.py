"""Exponential and logarithm without a call and without a branch, so that a loop over elements vectorises."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

_SERIES = {
    4: (5, 8, "int", 23, 127, "12582912.0f", 0x3F3504F3),
    8: (11, 13, "long long", 52, 1023, "6755399441055744.0", 0x3FE6A09E667F3BCD),
}


def _exp(size: int) -> str:
    """2^t = 2^whole · e^rest, |rest| ≤ ln 2 / 2: a series for the rest, the bits of the exponent for the whole."""
    _, terms, whole, bits, bias, shift, _ = _SERIES[size]
    kind, rint, suffix = ("float", "rintf", "f") if size == 4 else ("double", "rint", "")
    high, low = (
        ("0.693359375f", "-2.12194440e-4f")
        if size == 4
        else ("6.93147180369123816490e-01", "1.90821492927058770002e-10")
    )
    series = f"1.0{suffix}"
    for k in range(terms, 0, -1):
        series = f"(1.0{suffix} + rest * (1.0{suffix} / {k}) * {series})"
    return f"""
    const {kind} limit = {bias - 1}.0{suffix};
    {kind} t = x * 1.44269504088896340736{suffix};
    t = t < -limit ? -limit : t > limit ? limit : t;
    #if defined(__CUDA_ARCH__)
    const {kind} whole = {rint}(t);
    #else
    const {kind} whole = __builtin_{rint}(t);
    #endif
    const {kind} rest = (x - whole * {high}) - whole * {low};
    const {whole} raised = (__builtin_bit_cast({whole}, whole + {shift}) + {bias}) << {bits};
    return {series} * __builtin_bit_cast({kind}, raised);
    """


def _log(size: int) -> str:
    """log x = whole ln 2 + 2 artanh f, f = (m − 1) / (m + 1), √½ ≤ m < √2, x = m 2^whole."""
    terms, _, whole, bits, _, _, root = _SERIES[size]
    kind, suffix = ("float", "f") if size == 4 else ("double", "")
    series = "0"
    for k in range(terms, -1, -1):
        series = f"(1.0{suffix} / {2 * k + 1} + square * {series})"
    return f"""
    const {whole} bits = __builtin_bit_cast({whole}, x);
    const {whole} power = (bits - {root:#x}{"" if size == 4 else "LL"}) >> {bits};
    const {kind} m = __builtin_bit_cast({kind}, bits - (power << {bits}));
    const {kind} f = (m - 1) / (m + 1), square = f * f;
    return ({kind})(int)power * 0.69314718055994530942{suffix} + 2 * f * {series};
    """


@cache
def build(real: Any) -> SimpleNamespace:
    """`exp` and `log` (of a positive number) for one floating-point type, to some units of the last digit."""
    size = wp.types.type_size_in_bytes(real)

    @wp.func_native(_exp(size))
    def exp(x: real) -> real: ...

    @wp.func_native(_log(size))
    def log(x: real) -> real: ...

    return SimpleNamespace(exp=exp, log=log)
