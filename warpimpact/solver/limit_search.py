"""The values that a search of limits tries next, by what the runs before them told.

A search keeps two ends: a value at which the core passes, and one at which it does not. The energy that a passing core
has left tells where the limit lies. In a solid plate that does not weaken it is linear in v² and in the thickness,
because the work of a straight passage is constant (docs/model.md §6.1). Bisection takes over where this does not help.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes

Array = NDArray[np.float64]

MOST_RUNS = 14
"""Runs of a shot at most."""
BESIDE = 0.4
"""How far beside the expected limit a run is made, in tolerances: two runs on both sides of it then settle it."""
MARGIN = 0.15
"""The least such distance, as a share of that of the nearer end: the farther this is, the less certain is what is
expected."""
OUTWARD = 4.0
"""How many times as large as the last value the next one is, at most, as long as one end is open."""
AIMED = 2
"""Runs that go outward by what is expected. Behind a perforated plate a core may keep more speed the thicker the plate
is, and what is expected creeps: the others go by OUTWARD."""
SLOW = 0.6
"""Of the distance of the ends: where a run leaves more of it, the next one bisects. From then on a search also bisects
where that just finishes it."""


class Search:
    """The state of all searches; arrays of shape [shots].

    `passed` is the value nearest to the limit at which the core passed, `stopped` that at which it was stopped. One of
    them is 0 at first and the other infinite: a core at rest is stopped, one that meets no plate passes. The energy is
    given per half of the mass [m²/s²]. It is nearly linear in the `drive`: the square of a velocity, or a thickness.

    Args:
        start: values to try first.
        passed: infinite for a velocity, 0 for a thickness.
        left: energy of a core that passed there.
        tolerance, highest: as in `limit_velocity`.
    """

    def __init__(self, start: Array, passed: float, left: Array, tolerance: float, highest: float) -> None:
        count = len(start)
        self.tolerance, self.highest, self.rising = tolerance, highest, passed > 0.0
        self.start = np.minimum(start, highest)
        self.passed, self.stopped = np.full(count, passed), np.full(count, 0.0 if self.rising else np.inf)
        self.left, self.slope = left.copy(), np.full(count, 1.0 if self.rising else np.nan)  # over the drive
        self.runs = np.zeros(count, dtype=np.int8)
        self.slow, self.doubtful, self.beyond, self.failed = np.zeros((4, count), dtype=bool)  # failed: at `stopped`

    @property
    def width(self) -> Array:
        """Distance of the two ends; 0 where both are infinite."""
        same = self.passed == self.stopped
        return np.asarray(np.abs(np.where(same, 0.0, self.passed) - np.where(same, 0.0, self.stopped)))

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Whether the ends are within the tolerance, or the limit lies beyond the largest value tried."""
        return ~self.failed & self._ended

    @property
    def pending(self) -> NDArray[np.int64]:
        """The shots that need another run."""
        return np.flatnonzero(~self._ended & (self.runs < MOST_RUNS))

    @property
    def _ended(self) -> NDArray[np.bool_]:
        return np.asarray(self.beyond | (self.width <= self.tolerance))

    def trial(self, which: NDArray[np.int64]) -> Array:
        """The values of the next runs of some shots."""
        passed, stopped, aimed = self.passed[which], self.stopped[which], self._aimed()[which]
        low, high = np.minimum(passed, stopped), np.maximum(passed, stopped)
        open_ended, wild = np.isinf(high), ~((aimed > low) & (aimed < high))
        with np.errstate(divide="ignore"):
            needed = np.ceil(np.log2((high - low) / self.tolerance))
        left = MOST_RUNS - self.runs[which]  # runs, with this one
        hurried = self.slow[which] | (self.doubtful[which] & (left == needed))
        least = np.where(self.runs[which] > AIMED, OUTWARD * low, low)
        outward = np.where(wild, 2.0 * low, np.clip(aimed, least, OUTWARD * low))
        inward = np.where(wild | hurried, 0.5 * (low + high), aimed)
        chosen = np.minimum(np.where(open_ended, outward, inward), self.highest)
        return np.where(self.runs[which] == 0, self.start[which], chosen)

    def learn(self, which: NDArray[np.int64], tried: Array, outcomes: Outcomes) -> NDArray[np.int64]:
        """Take in one run of some shots; returns the places of those that say how a shot ends at its limit."""
        status, before = outcomes.status, self.width[which]
        passes, failed, untouched = status == Status.PERFORATED, status >= Status.UNFINISHED, status == Status.MISSED
        through, back = which[passes], which[~passes]
        self.runs[which] += 1
        self._take_energy(through, tried[passes], outcomes.residual_velocity[passes] ** 2)
        self.passed[through], self.stopped[back] = tried[passes], tried[~passes]
        self.slow[which] = self.width[which] > SLOW * before
        still_open = np.isinf(self.width[which]) & (self.runs[which] > AIMED)
        self.doubtful[which] |= self.slow[which] | still_open
        self.failed[back] = failed[~passes]
        self.passed[which[untouched]] = self.stopped[which[untouched]] = 0.0 if self.rising else np.inf
        self.beyond[which] = (tried >= self.highest) & (passes != self.rising)
        never = np.isinf(self.passed[which]) if self.rising else self.passed[which] == 0.0
        return np.flatnonzero(passes | never)

    def value(self) -> Array:
        """The limits: where a core is expected to have no energy left, or the middle of the ends."""
        lower, upper = self.ends()
        expected = self._expected()
        inside = (expected > lower) & (expected < upper)
        found = np.where(inside, expected, 0.5 * (lower + upper))
        return np.where(self.failed, np.nan, np.where(self.beyond, np.inf, found))

    def ends(self) -> tuple[Array, Array]:
        """The lower and the upper end."""
        return np.minimum(self.passed, self.stopped), np.maximum(self.passed, self.stopped)

    def _drive(self, value: Array) -> Array:
        return value**2 if self.rising else value

    def _expected(self) -> Array:
        """Where a core has no energy left, if it is linear; NaN or beyond the ends where that cannot be told."""
        with np.errstate(invalid="ignore"):
            drive = self._drive(self.passed) - self.left / self.slope
            return np.asarray(np.sqrt(drive) if self.rising else drive)

    def _aimed(self) -> Array:
        """Values beside the limit as it is expected, on the side of the farther end, which then comes close."""
        expected = self._expected()
        with np.errstate(invalid="ignore"):
            passed, stopped = np.abs(self.passed - expected), np.abs(self.stopped - expected)
            beside = np.maximum(BESIDE * self.tolerance, MARGIN * np.minimum(passed, stopped))
            return np.asarray(expected + np.where((passed > stopped) == self.rising, beside, -beside))

    def _take_energy(self, which: NDArray[np.int64], tried: Array, left: Array) -> None:
        """Take in the energy left of shots that passed, and its slope where two runs tell one."""
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (left - self.left[which]) / (self._drive(tried) - self._drive(self.passed[which]))
        usable = np.isfinite(slope) & ((slope > 0.0) == self.rising) & (slope != 0.0)
        self.slope[which] = np.where(usable, slope, self.slope[which])
        self.left[which] = left
