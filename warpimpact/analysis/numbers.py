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
