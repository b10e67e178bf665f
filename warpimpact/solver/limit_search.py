"""The values that a search of limits tries next, from the results of its earlier runs.

A search keeps two ends: a value at which the core passes, and one at which it does not. The residual velocities r of
passing cores determine the limit: with the drive D, which is v² or a thickness, |D − D_limit| = b r + c r². In a solid
plate that does not weaken, b = 0, because the work of a straight passage is constant (docs/model.md §6.1). Where a slow
core meets less resistance, b > 0. Three passages give D_limit, b and c. Two give D_limit and the scale of the curve.
One gives D_limit, with b and c of other hits. Bisection takes over where this does not help.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variable import failures

Array = NDArray[np.float64]

MOST_RUNS = 14
"""Most runs of a shot."""
DOUBT = 0.15, 0.08, 0.05
"""Doubt of a limit that follows from one, two and three passages, as a share of its distance from the nearest
passage."""
BESIDE = 0.4
"""Distance [tolerances] from the expected limit of a run that shall come close to it."""
SETTLING = 0.98
"""Distance [tolerances] from a near end of a run that shall settle a limit."""
SETTLED = 1.2
"""Largest doubt [tolerances] at which such close runs are made."""
OUTWARD = 1.4, 2.0, 4.0
"""Ratio of the next value to the last one while nothing is expected: in the first run, in the second, and in later
ones."""
PATIENT = 5
"""Runs after which the steps grow with each run, if all runs have stopped or all have passed."""


class LimitSearch:
    """The state of all searches; arrays of shape [shots].

    `passed` is the value nearest to the limit at which the core passed, `stopped` the nearest at which it was stopped.
    At first one of them is 0 and the other infinite: a core at rest is stopped, a core that meets no plate passes.

    Args:
        start: first values to try where nothing is known.
        passed: initial `passed`: infinite for a velocity, 0 for a thickness.
        speed: residual velocity of a core that passes there.
        tolerance: largest distance of the ends that are asked for.
        highest: largest value tried.

    Attributes:
        guess: what is known of the limits before any run: expected limits and their doubt, b and c of other hits, shape
            [4, shots]; NaN where nothing is known.
    """

    def __init__(self, start: Array, passed: float, speed: Array, tolerance: float, highest: float) -> None:
        count = len(start)
        self.tolerance, self.highest, self.rising = tolerance, highest, passed > 0.0
        self.guess = np.full((4, count), np.nan)
        self.start = np.minimum(start, highest)
        self.passed, self.stopped = np.full(count, passed), np.full(count, 0.0 if self.rising else np.inf)
        self.drives, self.speeds = np.full((2, MOST_RUNS + 1, count), np.nan)  # of passages, the nearest first
        if not self.rising:
            self.drives[0], self.speeds[0] = 0.0, speed
        self.runs = np.zeros(count, dtype=np.int8)
        self.beyond, self.failed = np.zeros((2, count), dtype=bool)  # failed: at `stopped`

    def expect(self, which: NDArray[np.int64], guess: Array) -> None:
        """Take in what is known of some limits before their first run."""
        self.guess[:, which] = guess
        if not self.rising:  # a guess tells more than that no plate stops no core
            known = which[np.isfinite(guess[0])]
            self.drives[0, known] = self.speeds[0, known] = np.nan

    @property
    def width(self) -> Array:
        """Distance between the two ends; 0 where both are infinite."""
        same = self.passed == self.stopped
        return np.asarray(np.abs(np.where(same, 0.0, self.passed) - np.where(same, 0.0, self.stopped)))

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Whether the ends are within the tolerance, or the limit lies beyond the largest value tried."""
        return ~self.failed & self._ended

    @property
    def pending(self) -> NDArray[np.bool_]:
        """Whether a shot needs another run."""
        return ~self._ended & (self.runs < MOST_RUNS)

    @property
    def _ended(self) -> NDArray[np.bool_]:
        return np.asarray(self.beyond | (self.width <= self.tolerance))

    def trial(self, which: NDArray[np.int64]) -> Array:
        """The values of the next runs of some shots."""
        passed, stopped, runs = self.passed[which], self.stopped[which], self.runs[which]
        low, high = np.minimum(passed, stopped), np.maximum(passed, stopped)
        aimed = self._aimed()[which]
        wild = np.logical_not((aimed > low) & (aimed < high))
        blind = runs - np.where(np.isfinite(self.guess[0, which]), PATIENT, 1)
        further = np.array(OUTWARD)[np.clip(blind, 0, 2)] * low
        farthest = np.where(low > 0.0, OUTWARD[-1] * low, np.inf)
        misled = (low == stopped) & (runs >= PATIENT)
        outward = np.where(wild | misled, further, np.minimum(aimed, farthest))
        with np.errstate(divide="ignore", invalid="ignore"):
            needed = np.ceil(np.log2((high - low) / self.tolerance))
        hurried = (low > 0.0) & (MOST_RUNS - runs <= needed)
        inward = np.where(wild | hurried, 0.5 * (low + high), aimed)
        chosen = np.where(np.isinf(high), outward, inward)
        unknown = (runs == 0) & ~np.isfinite(self.guess[0, which])
        return np.asarray(np.minimum(np.where(unknown, self.start[which], chosen), self.highest))

    def learn(self, which: NDArray[np.int64], tried: Array, outcomes: Outcomes) -> NDArray[np.int64]:
        """Take in one run of some shots; returns the places of the runs that show how a shot ends at its limit."""
        status = outcomes.status
        passes, failed, untouched = status == Status.PERFORATED, failures(status), status == Status.MISSED
        through, back = which[passes], which[~passes]
        self.runs[which] += 1
        for known, new in ((self.drives, self._drive(tried)), (self.speeds, outcomes.residual_velocity)):
            known[1:, through] = known[:-1, through]
            known[0, through] = new[passes]
        self.passed[through], self.stopped[back] = tried[passes], tried[~passes]
        self.failed[back] = failed[~passes]
        self.passed[which[untouched]] = self.stopped[which[untouched]] = 0.0 if self.rising else np.inf
        self.beyond[which] = (tried >= self.highest) & (passes != self.rising)
        never = np.isinf(self.passed[which]) if self.rising else self.passed[which] == 0.0
        return np.flatnonzero(passes | never)

    def value(self) -> Array:
        """The expected limits, or the middles between the ends where none is expected there."""
        lower, upper = self.ends()
        expected = self._value(self._limit_drive())
        inside = (expected > lower) & (expected < upper)
        limit = np.where(inside, expected, 0.5 * (lower + upper))
        return np.where(self.failed, np.nan, np.where(self.beyond, np.inf, limit))

    def ends(self) -> tuple[Array, Array]:
        """The lower and the upper end."""
        return np.minimum(self.passed, self.stopped), np.maximum(self.passed, self.stopped)

    def _limit_drive(self) -> Array:
        """The drive at which no speed is left, from the passages; NaN where there are none."""
        sign = 1.0 if self.rising else -1.0
        drive, (r1, r2, r3) = sign * self.drives, self.speeds[:3]
        linear, square = self.guess[2:]
        linear = np.where(np.isfinite(linear), linear, 0.0)
        square = np.where(np.isfinite(square), square, 1.0 if self.rising else np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            near, far = (drive[0] - drive[1]) / (r1 - r2), (drive[1] - drive[2]) / (r2 - r3)
            times = near / (linear + square * (r1 + r2))
            scaled, alone = np.isfinite(times) & (times > 0.0), np.isfinite(near) & (near > 0.0)
            linear = np.where(scaled, times * linear, np.where(alone, 0.0, linear))
            square = np.where(scaled, times * square, np.where(alone, near / (r1 + r2), square))
            bent = (near - far) / (r1 - r3)
            steep = near - bent * (r1 + r2)
            three = (bent >= 0.0) & (steep >= 0.0)
            linear, square = np.where(three, steep, linear), np.where(three, bent, square)
        return np.asarray(sign * (drive[0] - r1 * (linear + square * r1)))

    def curve_sums(self) -> Array:
        """Sums over the passages of a shot from which b and c follow by least squares of (b r + c r²) / d − 1.

        d is the distance of the drive from its limit. With x = r / d and y = r² / d, these are the sums of xx, xy, yy,
        x and y, shape [5, shots]. A passage within two tolerances of the limit does not count.
        """
        limit = self.value()
        with np.errstate(invalid="ignore", divide="ignore"):
            d = np.abs(self.drives - self._drive(limit))
            least = np.abs(self._drive(limit + 2.0 * self.tolerance) - self._drive(limit))
            x, y = self.speeds / d, self.speeds**2 / d
            terms = np.stack([x * x, x * y, y * y, x, y])
        return np.asarray(np.where(np.isfinite(x) & (d > least), terms, 0.0).sum(axis=1))

    def _drive(self, value: Array) -> Array:
        return value**2 if self.rising else value

    def _value(self, drive: Array) -> Array:
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(drive) if self.rising else drive)

    def _expected(self) -> tuple[Array, Array]:
        """The expected limits and their doubt."""
        value, count = self._value(self._limit_drive()), np.isfinite(self.drives).sum(axis=0)
        doubt = np.array(DOUBT)[np.clip(count - 1, 0, len(DOUBT) - 1)] * np.abs(self.passed - value)
        known = np.isfinite(value)
        return np.where(known, value, self.guess[0]), np.where(known, doubt, self.guess[1])

    def _aimed(self) -> Array:
        """The next values; NaN or beyond the ends where nothing is expected.

        While the limit is uncertain, runs are made where the core is expected to pass, because only passages tell where
        the limit lies. If all of them pass, runs follow where it is expected to stop. Signs are such that `passed` lies
        ahead of the limit and `stopped` behind it.
        """
        sign, tolerance = 1.0 if self.rising else -1.0, self.tolerance
        expected, doubt = self._expected()
        ahead, behind, expected = sign * self.passed, sign * self.stopped, sign * expected
        with np.errstate(invalid="ignore"):
            to_ahead, to_behind = ahead - expected, expected - behind
            close = (doubt <= SETTLED * tolerance) & (to_behind > -SETTLED * tolerance)
            refuted = behind + np.clip(-to_behind, BESIDE * tolerance, 0.5 * (ahead - behind))
            beside = np.where(close, BESIDE * tolerance, doubt)
            creeps = ((behind == 0.0) | np.isinf(behind)) & (self.runs >= PATIENT)
            aimed = expected + np.where(creeps, -(2.0 ** (self.runs - PATIENT)), 1.0) * beside
            aimed = np.where(to_behind <= 0.0, refuted, aimed)
            near = SETTLING * tolerance - np.maximum(1.2 * doubt, 0.1 * tolerance)  # the limit then hardly lies farther
            aimed = np.where(close & (to_behind <= near), behind + SETTLING * tolerance, aimed)
            aimed = np.where(close & (to_ahead <= near), ahead - SETTLING * tolerance, aimed)
        return np.asarray(sign * aimed)
