"""The levels of LADDER that a pilot tries, coarse to fine, and the one that it takes.

The error of a level is estimated by its change to a finer one, times a margin for the error of that one itself. One
search serves two measures: what becomes of the shots, and their limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from warpimpact.solver.findings import Found

MARGIN = {1: 2.0, 2: 1.4}
"""Factor of an estimate by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates are then at least the 90th percentile that other hits show (tests/benchmarks/random_scenes.py)."""
FAR = 4.0
"""Estimates over what is allowed, above which the next level is not tried: errors about halve from level to level."""
STALLED = 0.7
"""Share of an error that is left two levels on, above which finer levels are of little use: it falls to a quarter where
it converges, but not where cores barely pass or tumble."""
ALIKE = 1.5
"""Errors of levels up to so many times the smallest are no reason for a finer one, where none keeps the promise."""

Finding = TypeVar("Finding", bound=Found)


class Verdict(NamedTuple, Generic[Finding]):
    """What is found at a level.

    Attributes:
        excess: errors over what is allowed: upper estimates.
        typical: likewise, but of most of the first shots, which all levels have in common, and as likely to be too
            small as too large. So they tell how errors fall.
        nearly: whether it nearly keeps the promise.
    """

    found: Finding
    excess: float
    typical: float
    nearly: bool


def coarsest(
    judge: Callable[[int, int, float], Verdict[Finding]],
    levels: range,
    finest: int,
    beyond: int,
    allowed: Callable[[int, int], bool] = lambda index, finer: True,
) -> Finding | None:
    """What is found at the coarsest of some levels that keeps the promise; if none does, at the coarsest one that
    nearly does, else at the coarsest one whose errors are about the smallest. None if not even the first level fits the
    memory.

    Args:
        judge: the finding at a level by comparing with a finer one, with a margin.
        finest: the last level to compare with.
        beyond: levels that are tried behind one that nearly keeps the promise.
        allowed: whether a level, compared with a finer one, is worth its cost.
    """
    tried: dict[int, tuple[Finding, float]] = {}
    first: dict[int, float] = {}
    enough = None
    index, last = levels[0], levels[-1]
    while index <= last:
        finer = min(index + 2, finest)  # neighbours err alike
        if not allowed(index, finer):
            break
        try:
            found, excess, typical, nearly = judge(index, finer, MARGIN[finer - index])
        except MemoryError:  # the plate's period does not fit at that spacing: what was found so far has to do
            break
        if found.kept:
            return found
        if enough is None and nearly:
            enough, last = found, min(last, index + beyond)
        if any(typical > STALLED * before for at, before in first.items() if at <= index - 2):
            last = index
        tried[index], first[index] = (found, excess), typical
        far = excess > FAR and enough is None and index + 2 <= last and allowed(index + 2, min(index + 4, finest))
        index += 2 if far else 1
    smallest = min((excess for _, excess in tried.values()), default=math.inf)
    return enough or next((found for found, excess in tried.values() if excess <= ALIKE * smallest), None)
