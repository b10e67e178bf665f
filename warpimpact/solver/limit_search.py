"""The values that a search of limits tries next, from the results of its earlier runs.

A search keeps two ends: a value at which the core passes, and one at which it does not. A stopped core says no more
than that, so root finders that need a value on both sides (scipy.optimize.elementwise) do not serve. The residual
velocities r of passing cores determine the limit: with the drive D, which is v² or a thickness, |D − D_limit| = c r²,
because the work of a straight passage is nearly constant (docs/model.md §6.1). Two passages give D_limit and c; one
gives D_limit with c = 1, as for a core of constant mass. Bisection takes over where this does not help.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variable import failures

Array = NDArray[np.float64]

MOST_RUNS = 20
"""Most runs of a shot."""
DOUBT = 0.15, 0.08
"""Doubt of a limit that follows from one passage, and from two, as a share of its distance from the nearer one."""
NEAR, SETTLING = 0.4, 0.98
"""Distance [tolerances] from the expected limit of a run that shall pass close to it; and from a near end of a run that
shall settle a limit."""
REFUTED = 3.0
"""Next distance from an expected limit at which a core was stopped, over the last one."""
SETTLED = 1.2
"""Largest doubt [tolerances] at which such close runs are made."""
OUTWARD = 1.4, 2.0, 4.0
"""Ratio of the next value to the last one while all runs have stopped: after the first run, the second, later ones."""

_without_warnings = np.errstate(invalid="ignore", divide="ignore")


class LimitSearch:
    """The state of all searches; arrays of shape [shots].

    `passed` is the value nearest to the limit at which the core passed, `stopped` the nearest at which it was stopped.
    At first one of them is 0 and the other infinite: a core at rest is stopped, a core that meets no plate passes.

    Args:
        start: first values to try.
        passed: initial `passed`: infinite for a velocity, 0 for a thickness.
        speed: residual velocity of a core that passes there.
        tolerance: largest distance of the ends.
        highest: largest value tried.
    """

    def __init__(self, start: Array, passed: float, speed: Array, tolerance: float, highest: float) -> None:
        count = len(start)
        self.tolerance, self.highest, self.rising = tolerance, highest, passed > 0.0
        self.start = np.minimum(start, highest)
        self.passed, self.stopped = np.full(count, passed), np.full(count, 0.0 if self.rising else np.inf)
        self.drives, self.speeds = np.full((2, 2, count), np.nan)  # of the last two passages, the nearest first
        if not self.rising:
            self.drives[0], self.speeds[0] = 0.0, speed
        self.runs = np.zeros(count, dtype=np.int8)
        self.beyond, self.failed = np.zeros((2, count), dtype=bool)  # failed: at `stopped`

    @property
    def ends(self) -> tuple[Array, Array]:
        """The lower and the upper end."""
        return np.minimum(self.passed, self.stopped), np.maximum(self.passed, self.stopped)

    @property
    def ended(self) -> NDArray[np.bool_]:
        """Whether the ends are within the tolerance, or the limit lies beyond the largest value tried."""
        low, high = self.ends
        return np.asarray(self.beyond | (low == high) | (low >= high - self.tolerance))

    @property
    def pending(self) -> NDArray[np.bool_]:
        """Whether a shot needs another run."""
        return ~self.ended & (self.runs < MOST_RUNS)

    @_without_warnings
    def trial(self) -> Array:
        """The values of the next runs."""
        low, high = self.ends
        aimed, further = self._aimed(), np.array(OUTWARD)[np.clip(self.runs - 1, 0, 2)] * low
        hurried = (low > 0.0) & (MOST_RUNS - self.runs <= np.ceil(np.log2((high - low) / self.tolerance)))
        wild = ~((aimed > low) & (aimed < high))
        outward = np.where(wild, further, np.minimum(aimed, np.where(low > 0.0, OUTWARD[-1] * low, np.inf)))
        chosen = np.where(np.isinf(high), outward, np.where(wild | hurried, 0.5 * (low + high), aimed))
        return np.asarray(np.minimum(np.where(self.runs == 0, self.start, chosen), self.highest))

    def learn(self, which: NDArray[np.int64], tried: Array, outcomes: Outcomes) -> NDArray[np.bool_]:
        """Take in one run of some shots; returns which of the runs show how a shot ends at its limit."""
        status = outcomes.status
        passes, untouched = status == Status.PERFORATED, which[status == Status.UNTOUCHED]
        through, back = which[passes], which[~passes]
        self.runs[which] += 1
        for known, new in ((self.drives, self._drive(tried)), (self.speeds, outcomes.residual_velocity)):
            known[1:, through] = known[:-1, through]
            known[0, through] = new[passes]
        self.passed[through], self.stopped[back] = tried[passes], tried[~passes]
        self.failed[back] = failures(status)[~passes]
        self.passed[untouched] = self.stopped[untouched] = 0.0 if self.rising else np.inf
        self.beyond[which] = (tried >= self.highest) & (passes != self.rising)
        never = np.isinf(self.passed[which]) if self.rising else self.passed[which] == 0.0
        return np.asarray(passes | never)

    @_without_warnings
    def value(self) -> Array:
        """The expected limits, or the middles between the ends where none is expected there."""
        (low, high), expected = self.ends, self._expected()
        limit = np.where((expected > low) & (expected < high), expected, 0.5 * (low + high))
        return np.where(self.failed, np.nan, np.where(self.beyond, np.inf, limit))

    def _drive(self, value: Array) -> Array:
        return value**2 if self.rising else value

    def _expected(self) -> Array:
        """The values at which no speed is left, from the passages; NaN where there are none."""
        sign = 1.0 if self.rising else -1.0
        (d1, d2), (r1, r2) = sign * self.drives, self.speeds
        slope = (d1 - d2) / (r1**2 - r2**2)
        limit = sign * (d1 - r1**2 * np.where(slope > 0.0, slope, 1.0 if self.rising else np.nan))
        return np.asarray(np.sqrt(limit) if self.rising else limit)

    def _aimed(self) -> Array:
        """The next values; NaN or beyond the ends where nothing is expected.

        While the limit is uncertain, runs are made where the core is expected to pass, because only passages say where
        the limit lies. If all of them pass, runs follow where it is expected to stop. Signs are such that `passed` lies
        ahead of the limit and `stopped` behind it.
        """
        sign, tolerance, value = 1.0 if self.rising else -1.0, self.tolerance, self._expected()
        passages = np.isfinite(self.drives).sum(axis=0)
        doubt = np.array(DOUBT)[np.clip(passages - 1, 0, 1)] * np.abs(self.passed - value)
        ahead, behind, expected = sign * self.passed, sign * self.stopped, sign * value
        close = doubt <= SETTLED * tolerance
        beyond = behind + np.clip(REFUTED * (behind - expected), NEAR * tolerance, 0.5 * (ahead - behind))
        aimed = np.where(expected <= behind, beyond, expected + np.where(close, NEAR * tolerance, doubt))
        near = SETTLING * tolerance - np.maximum(1.2 * doubt, 0.1 * tolerance)  # the limit then hardly lies farther
        settles = close & (expected - behind > -SETTLED * tolerance)
        aimed = np.where(settles & (expected - behind <= near), behind + SETTLING * tolerance, aimed)
        return np.asarray(sign * np.where(settles & (ahead - expected <= near), ahead - SETTLING * tolerance, aimed))
