"""The coarsest level of resolution that keeps a promised accuracy of limits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import PRESETS, Accuracy, Numerics
from warpimpact.solver.changes import fewest, limit_changes
from warpimpact.solver.climb import Verdict, coarsest
from warpimpact.solver.findings import LimitErrors
from warpimpact.solver.resolution import at_level, coarsest_level

Array = NDArray[np.float64]

LIMITS = 16
"""Limits of a pilot."""
FINEST_LIMIT = 6
"""The last level that is taken for limits. A finer one is only compared with."""
BEYOND = 2
"""Levels behind the first one that nearly keeps the promise, on which one is looked for that does; each costs about
twice the one before. Nearly do limits half of which are within the promise: as errors about halve from level to level,
the others are off by more than four times as much two levels on. Some limits, such as those at which the outcome jumps,
or that come and go, have no bounded error, and finer levels are of little use."""


def limits_pilot_size(accuracy: Accuracy) -> int:
    """Limits of a pilot."""
    return max(LIMITS, fewest(accuracy.share))


def pilot_limits(limits_at: Callable[[int], Array], numerics: Numerics, quantity: str) -> LimitErrors:
    """Find the coarsest level whose limits have the accuracy that is asked for.

    Args:
        limits_at: the limits of a pilot's shots on a level of LADDER.
        numerics: as in `pilot_hits`.
        quantity: "velocity", or "thickness", which goes with the square of the velocity.

    Returns:
        The level that keeps the promise. If none does: the coarsest one on which half of the limits are within it; if
        there is none, FINEST_LIMIT.

    Raises:
        ValueError: the accuracy says nothing of limits.
    """
    asked, usual = numerics.asked, PRESETS["draft"].limit
    if asked.limit is None or usual is None:
        raise ValueError("accuracy: needs limit, the error of a limit as a share of the median limit")
    share, allowed_share = asked.share, (1.0 if quantity == "velocity" else 2.0) * asked.limit
    first = min(coarsest_level(usual / asked.limit), FINEST_LIMIT)

    def found_at(index: int, error: float, allowed: float, finer: int | None = None) -> LimitErrors:
        return LimitErrors(at_level(index, numerics), error <= allowed, share, error, quantity, finer)

    known: dict[int, Array] = {}

    def limits(index: int) -> Array:
        if index not in known:
            known[index] = limits_at(index)
        return known[index]

    def judge(index: int, finer: int, margin: float) -> Verdict[LimitErrors]:
        change, half, typical = limit_changes(limits(index), limits(finer), share)
        allowed = allowed_share * typical
        excess = margin * half / max(allowed, 1e-30)
        return Verdict(found_at(index, margin * change, allowed, finer), excess, excess, margin * half <= allowed)

    levels = range(first, FINEST_LIMIT + 1)
    found = coarsest(judge, levels, FINEST_LIMIT + 1, BEYOND)
    return found or found_at(first, math.inf, 0.0)
