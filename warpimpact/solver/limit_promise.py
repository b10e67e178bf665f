"""How far off limits are: a pilot searches some of them on levels of resolution, coarse to fine (solver/promise.py)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Numerics
from warpimpact.solver.limit import Limits, short_steps
from warpimpact.solver.promise import MARGIN, upper_digits, upper_place
from warpimpact.solver.resolution import Fidelity, level

Array = NDArray[np.float64]

PILOT = 16
"""Hits of a pilot."""
PROMISED = {"draft": (0.02, 0), "standard": (0.006, 1), "reference": (0.0015, 3)}
"""By fidelity: error of a limit velocity that 90 % of the hits are to stay within, as a share of the median limit (of a
limit thickness twice that, as it goes with v²), and the level of LADDER from which on it is looked for."""
FINEST = 6
"""The last level that is taken. A finer one is only compared with."""
BEYOND = 2
"""Levels behind the first one on which half of the limits are within a promise, on which 90 % of them are looked for.
Errors about halve from level to level. So the others are off by more than four times as much then: some limits, such as
those at which the outcome jumps, or that come and go, have no bounded error, and finer levels are of little use."""


@dataclass(frozen=True)
class LimitPromise:
    """What a pilot found.

    Attributes:
        fidelity: the numerics to search all limits with.
        kept: whether the error is within what the name promises.
        error: upper estimate of the errors of 90 % of the limits [m/s] or [m]; infinite where the pilot could not tell.
        shown: the error with its unit.
    """

    fidelity: Fidelity
    kept: bool
    error: float
    shown: str

    @property
    def phrase(self) -> str:
        """The error, for a line of progress."""
        return f"accuracy {self.shown} for 90 % of the hits{'' if self.kept else ', not as promised'}"


def keep_limits(search: Callable[[Fidelity], Limits], numerics: Numerics, *, squared: bool) -> LimitPromise:
    """Find the coarsest level of resolution whose limits are off by no more than a named fidelity promises.

    Args:
        search: the limits of a pilot's shots at a fidelity.
        numerics: its fidelity and precision count.
        squared: whether the limit goes with the square of the velocity, as a thickness does.

    Returns:
        The promise, kept. If no level keeps it (BEYOND): the coarsest one on which half of the limits are within it; if
        there is none, FINEST.
    """
    share, first = PROMISED[numerics.fidelity]
    known: dict[int, Limits] = {}
    enough: LimitPromise | None = None
    index, last = first, FINEST
    while True:
        finer = min(index + 2, FINEST + 1)  # neighbours err alike
        for needed in (index, finer):
            if needed not in known:
                known[needed] = search(short_steps(level(needed, numerics)))
        change, half, typical = _change(known[index], known[finer])
        error, allowed = MARGIN[finer - index] * change, (2.0 * share if squared else share) * typical
        shown = f"{upper_digits(1e3 * error)} mm" if squared else f"{upper_digits(error)} m/s"
        found = LimitPromise(short_steps(level(index, numerics)), error <= allowed, error, shown)
        if found.kept:
            return found
        if enough is None and MARGIN[finer - index] * half <= allowed:
            enough, last = found, min(index + BEYOND, FINEST)
        if index == last:
            return enough or found
        index += 1


def _change(coarse: Limits, fine: Limits) -> tuple[float, float, float]:
    """The change that 90 % of the limits stay within, but for `promise.RISK`; the median change of those that are
    finite on one level at least; and the median limit."""
    same = (coarse.value == fine.value) | (np.isnan(coarse.value) & np.isnan(fine.value))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(coarse.value - fine.value))
    change[np.isnan(change)] = math.inf
    finite = np.isfinite(fine.value)
    place = upper_place(len(change)) - 1
    return (
        float(np.sort(change)[place]),
        _median(change[finite | np.isfinite(coarse.value)]),
        _median(fine.value[finite]),
    )


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else 0.0
