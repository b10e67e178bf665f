"""Text of numbers and intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from warpimpact.statistics.intervals import Estimate

ROUNDING = 1e-5
"""Largest number that is shown as 0. In display units, smaller numbers are rounding of the computation."""


def number_text(number: float) -> str:
    """A number with four digits; a dash for NaN."""
    return "-" if math.isnan(number) else f"{0.0 if abs(number) < ROUNDING else number:#.4g}"


def interval_text(low: float, high: float, text: Callable[[float], str] = number_text) -> str:
    """A confidence interval as text: a dash if there is none, one end if the shots give only one."""
    if math.isnan(low) and math.isnan(high):
        return "-"
    if math.isnan(low):
        return f"at most {text(high)}"
    return f"at least {text(low)}" if math.isnan(high) else f"{text(low)} to {text(high)}"


class Ends(NamedTuple):
    """Intervals of a number: by the hits, and the largest shift by the numerics, None or NaN where unknown."""

    low: float
    high: float
    numerics: float | None = None


def ends_of(estimate: Estimate) -> Ends:
    """The intervals of an estimate."""
    return Ends(estimate.low, estimate.high, estimate.numerics)


def intervals_text(
    ends: Ends, text: Callable[[float], str] | None = None, shift: Callable[[float], str] | None = None
) -> str:
    """The intervals of a number as text. Ends have four digits by default. The shift by the numerics has two, or the
    format of the ends if only that is given."""
    shift = shift or text or "{:.2g}".format
    text = text or number_text
    text_of_ends = interval_text(ends.low, ends.high, text)
    if text_of_ends == "-":
        return text_of_ends
    if ends.numerics is not None and not math.isnan(ends.numerics):
        text_of_ends += f", numerics ± {shift(ends.numerics)}"
    return text_of_ends


def plus_minus(estimate: Estimate, number: str, half_width: str) -> str:
    """A mean ± half the width of its confidence interval (± means nothing else here), in formats such as ".5g"; no ± if
    it has none."""
    value = format(estimate.value, number)
    return value if math.isnan(estimate.half_width) else f"{value} ± {format(estimate.half_width, half_width)}"


def of_each(names: Sequence[str], values: Sequence[str]) -> str:
    """Text such as "a 1 m, b 2 m"."""
    return ", ".join(f"{name} {value}" for name, value in zip(names, values, strict=True))
