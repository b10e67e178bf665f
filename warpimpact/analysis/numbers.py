"""Text of numbers and intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from warpimpact.statistics.intervals import Estimate

ROUNDING = 1e-5
"""Largest number that is shown as 0. In display units, smaller numbers are rounding of the computation."""


def number_text(number: float) -> str:
    """A number with four digits; a dash for NaN."""
    return "-" if math.isnan(number) else f"{0.0 if abs(number) < ROUNDING else number:#.4g}"


def interval_text(
    low: float,
    high: float,
    numerics: float | None = None,
    text: Callable[[float], str] = number_text,
    shift: Callable[[float], str] = "{:.2g}".format,
) -> str:
    """A confidence interval by the hits as text: a dash if there is none, one end if the shots give only one. The
    largest shift by the numerics follows, unless it is None or NaN."""
    if math.isnan(low) and math.isnan(high):
        return "-"
    if math.isnan(low):
        interval = f"at most {text(high)}"
    else:
        interval = f"at least {text(low)}" if math.isnan(high) else f"{text(low)} to {text(high)}"
    return interval if numerics is None or math.isnan(numerics) else f"{interval}, numerics ± {shift(numerics)}"


def plus_minus(estimate: Estimate, number: str, half_width: str) -> str:
    """A mean ± half the width of its confidence interval (± means nothing else here), in formats such as ".5g"; no ± if
    it has none."""
    value = format(estimate.value, number)
    return value if math.isnan(estimate.half_width) else f"{value} ± {format(estimate.half_width, half_width)}"


def of_each(names: Sequence[str], values: Sequence[str]) -> str:
    """Text such as "a 1 m, b 2 m"."""
    return ", ".join(f"{name} {value}" for name, value in zip(names, values, strict=True))
