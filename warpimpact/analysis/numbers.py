"""Numbers and intervals as people read them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from warpimpact.statistics.intervals import Estimate


def number_text(number: float) -> str:
    """With four digits; a dash for what does not exist."""
    return "-" if math.isnan(number) else f"{number:#.4g}"


def interval_text(low: float, high: float, text: Callable[[float], str] = number_text) -> str:
    """A confidence interval as text: a dash if there is none, one end if the shots give only one."""
    if math.isnan(low) and math.isnan(high):
        return "-"
    if math.isnan(low):
        return f"at most {text(high)}"
    return f"at least {text(low)}" if math.isnan(high) else f"{text(low)} to {text(high)}"


def intervals_text(
    low: float, high: float, parameters: tuple[float, float] | None, text: Callable[[float], str] = number_text
) -> str:
    """An interval by the hits, and beside it one by the parameters where shots draw these from a posterior."""
    by_hits = interval_text(low, high, text)
    if parameters is None:
        return by_hits
    by_parameters = "not known" if math.isnan(parameters[0]) else interval_text(*parameters, text)
    return f"by hits {by_hits}, by parameters {by_parameters}"


def ends_of(estimate: Estimate) -> tuple[float, float, tuple[float, float] | None]:
    """The ends of its intervals, as `intervals_text` takes them."""
    return estimate.low, estimate.high, estimate.parameters


def plus_minus(estimate: Estimate, number: str, half_width: str) -> str:
    """A mean ± half the width of its confidence interval, the one meaning of the sign; without it where there is none.

    Args:
        number, half_width: the formats of both, such as ".5g".
    """
    value = format(estimate.value, number)
    return value if math.isnan(estimate.half_width) else f"{value} ± {format(estimate.half_width, half_width)}"


def of_each(names: Sequence[str], values: Sequence[str]) -> str:
    """Such as "a 1 m, b 2 m"."""
    return ", ".join(f"{name} {value}" for name, value in zip(names, values, strict=True))
