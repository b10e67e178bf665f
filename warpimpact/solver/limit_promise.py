"""How far off limits are: a pilot searches some of them on levels of resolution, coarse to fine (solver/promise.py)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpimpact.scene import Numerics
from warpimpact.solver.limit import Limits, short_steps
from warpimpact.solver.promise import MARGIN, upper_digits, upper_place
from warpimpact.solver.resolution import Fidelity, level

PILOT = 16
"""Hits of a pilot."""
PROMISED = {"draft": (0.02, 0), "standard": (0.006, 1), "reference": (0.0015, 3)}
"""By fidelity: error of a limit velocity that 90 % of the hits are to stay within, as a share of the median limit (of a
limit thickness twice that, as it goes with v²), and the level of LADDER from which on it is looked for."""
FINEST = 6
"""The last level that is taken. A finer one is only compared with."""


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
        The promise, kept; or if no level keeps it, that of FINEST.
    """
    share, first = PROMISED[numerics.fidelity]
    known: dict[int, Limits] = {}
    for index in range(first, FINEST + 1):
        finer = min(index + 2, FINEST + 1)  # neighbours err alike
        for needed in (index, finer):
            if needed not in known:
                known[needed] = search(short_steps(level(needed, numerics)))
        change, typical = _change(known[index], known[finer])
        error = MARGIN[finer - index] * change
        kept = error <= (2.0 * share if squared else share) * typical
        if kept or index == FINEST:
            break
    shown = f"{upper_digits(1e3 * error)} mm" if squared else f"{upper_digits(error)} m/s"
    return LimitPromise(short_steps(level(index, numerics)), bool(kept), error, shown)


def _change(coarse: Limits, fine: Limits) -> tuple[float, float]:
    """The change that 90 % of the limits stay within, but for `promise.RISK`, and their median."""
    same = (coarse.value == fine.value) | (np.isnan(coarse.value) & np.isnan(fine.value))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(coarse.value - fine.value))
    change[np.isnan(change)] = math.inf
    finite = fine.value[np.isfinite(fine.value)]
    place = upper_place(len(change)) - 1
    return float(np.sort(change)[place]), float(np.median(finite)) if len(finite) else 0.0
