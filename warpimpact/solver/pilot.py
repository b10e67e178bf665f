"""The resolution that keeps a promised accuracy. Every level that the user does not fix is chosen here.

A pilot computes 64 of a run's shots on levels of LADDER, coarse to fine, and takes the coarsest level whose error is
within the promise. The error of a level is its change to the level two finer (neighbours err alike), times
ERROR_PER_CHANGE for the error of the finer one. The order statistic of the shots that counts rarely lies below the
promised percentile (changes.py). Where 64 shots leave the choice open, 128 and 256 are computed. Where the error is far
beyond the promise, the next level is left out.

The search ends where errors stall, where a level costs more than it is worth, and one level behind the first that
nearly
keeps the promise: there the errors of slow cores are weighed by their energy, because near the limit velocity the error
of a speed has no bound. If no level keeps the promise, the run takes the first that nearly does, else the coarsest
whose
errors are about the smallest, and states its change to the finest level computed. A long run then takes coarser levels
of single settings that keep the promise, too. Limits (16 in a pilot) and the measure of a stop rule choose their level
in the same way, by errors of their own.

Long because the ways to choose a level share the same comparison of outcomes at three levels.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Accuracy, Numerics, Shots
from warpimpact.solver.changes import LevelVerdict, compared, fewest, limit_changes
from warpimpact.solver.findings import HitErrors, LimitErrors, Tried
from warpimpact.solver.resolution import LADDER, at_level, coarsest_level

Array = NDArray[np.float64]
Excess: TypeAlias = Callable[[Outcomes, Outcomes, Shots], float]
"""Error of a measure over what is allowed, from outcomes of the same shots at a level and at a finer one."""

_logger = logging.getLogger(__name__)

SHOTS, SHOTS_OF_FINE, FINE = 64, 32, 4
"""First shots of a pilot; the same for a pilot that begins at level FINE or finer, where shots are expensive; FINE."""
MOST, PART = 256, 16
"""Most shots that choose a level; and the shots of a run per shot of its pilot, also where single settings are
tried."""
COMPARED = 4.0
"""Foreseen time of the further shots that are compared at the chosen level for measures of layers, over that of the
run. The real time is about half."""
LIMITS, FINEST_LIMIT = 16, 6
"""Limits of a pilot; and the finest level that is taken for limits. Finer levels only serve for comparison."""
OPEN, OPEN_MEASURE = (0.7, 1.5), (0.7, 3.0)
"""Ranges of errors over what is allowed in which more shots may change the choice. The errors of a measure are mostly
noise, and four times as many shots halve it."""
OPEN_STATUS = 2
"""Number of shots that end otherwise up to which their share is too uncertain to break the promise."""
ERROR_PER_CHANGE = {1: 2.0, 2: 1.4}
"""Error of a level over its change, by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates then reach the 90th percentile of other hits (tests/benchmarks/random_scenes.py)."""
SKIPS_A_LEVEL = 4.0
"""Errors over what is allowed above which the next level is left out. Errors about halve from level to level."""
STALLED = 0.7
"""Share of an error that is left two levels on, above which finer levels are of little use: a quarter is left where
errors converge, but not where cores barely pass or tumble. Errors that differ by less count as equal."""
FURTHER, FURTHER_LAYERED = 5, 3
"""Most levels behind the first one that are tried for a promise, at a single plate and at several layers. All but one
of 105 random scenes of single plates needed no finer level for draft and standard. Layers take eight to ten times as
long."""
PATIENCE, WORTH = 10.0, 1600
"""What a pilot may take: PATIENCE seconds of a core, or the time of WORTH shots at the level in question, a tenth of a
run of 16,384 hits. Within PATIENCE it also tries levels beyond FURTHER. Times are foreseen ones (`Prepared.seconds`),
so that a level does not depend on the machine."""
SETTINGS, ROOM = ("step", "grid", "around", "along"), 0.9
"""Settings that may have coarser levels, the one that saves most first; and the largest error over what is allowed for
a coarser setting. The margin makes up for the choice: a trial also passes if its errors on the pilot's shots are small
by chance."""


class Aim(NamedTuple):
    """Measures for which a level is chosen, instead of or beside an accuracy of single hits.

    Attributes:
        excess: error of the measures over what is allowed.
        alone: whether the measures alone choose the level. Otherwise a level that keeps the accuracy will do, too, and
            the accuracy says whether finer levels are of use, because the shift of a mean may be small by chance.
    """

    excess: Excess
    alone: bool = True


def climb(
    judge: Callable[[int, int], LevelVerdict],
    levels: range,
    beyond: int,
    worth: Callable[[int, int], bool] = lambda level, finer: True,
) -> int | None:
    """Try levels, coarse to fine, and choose one; None if not even the first one fits the memory.

    Args:
        judge: returns the verdict on a level from a comparison with a finer one.
        levels: levels that may be taken. The finest level of a comparison is the one behind the last of them.
        beyond: number of levels to try behind one that nearly keeps the promise.
        worth: whether a level and the finer one of its comparison are worth their cost.
    """
    tried: dict[int, LevelVerdict] = {}
    enough: int | None = None
    level, last = levels[0], levels[-1]

    def finer(level: int) -> int:
        return min(level + 2, levels.stop)

    while level <= last and worth(level, finer(level)):
        try:
            verdict = tried[level] = judge(level, finer(level))
        except MemoryError:  # the plate's period does not fit at that grid spacing
            break
        if verdict.kept:
            return level
        if enough is None and verdict.weighed <= 1.0:
            enough, last = level, min(last, level + beyond)
        if any(verdict.typical > STALLED * tried[coarser].typical for coarser in tried if coarser <= level - 2):
            last = level
        far = (
            verdict.excess > SKIPS_A_LEVEL
            and enough is None
            and level + 2 <= last
            and worth(level + 2, finer(level + 2))
        )
        level += 2 if far else 1
    smallest = min((verdict.excess for verdict in tried.values()), default=math.inf)
    alike = (level for level, verdict in tried.items() if STALLED * verdict.excess <= smallest)
    return next(alike, None) if enough is None else enough


def pilot_size(accuracy: Accuracy, hits: int = 0) -> int:
    """Most shots of a pilot for a run of this number of hits."""
    return max(_first_shots(accuracy), min(MOST, hits // PART))


def _first_shots(accuracy: Accuracy) -> int:
    usual = SHOTS if coarsest_level(accuracy.strictness) < FINE else SHOTS_OF_FINE
    return max(usual, fewest(accuracy.share))


def pilot_hits(
    outcomes_at: Callable[[Numerics, Shots], Outcomes],
    shots: Shots,
    numerics: Numerics,
    price: Callable[[int], float],
    free: Sequence[bool] = (True,),
    aim: Aim | None = None,
    hits: int = 0,
) -> HitErrors:
    """Find the resolution whose outcomes have the accuracy that is asked for.

    Args:
        outcomes_at: computes shots with numerics of a level.
        shots: shots of the pilot. Any first part of them is spread like all. The first MOST of them choose a level.
        numerics: accuracy, precision and layout. Other settings would promise nothing.
        price: seconds that a shot takes at a level.
        free: for each layer of the target, whether a core flies free behind it (`Scene.free_behind`). Residual
            velocities behind other layers count in no error.
        aim: measures instead of the accuracy or beside it. Levels from 0 on are tried.
        hits: hits of the run, which may have coarser settings if it is long; 0 if unknown.

    Raises:
        ValueError: the accuracy has no bound on outcomes.
    """
    accuracy = numerics.asked
    if math.isinf(accuracy.residual_velocity) and math.isinf(accuracy.tilt):
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")
    first = coarsest_level(accuracy.strictness) if aim is None else 0
    pilot = _Pilot(outcomes_at, shots, numerics, price, free, aim)
    level = climb(pilot.judge, range(first, len(LADDER) - 1), 1, pilot.worth)
    if level is None:
        return HitErrors(at_level(first, numerics), False, accuracy.share, math.inf, math.inf)
    if aim is not None and not aim.alone:
        pilot.compare_more(level, hits)
    if not pilot.tried[level].errors.kept:
        pilot.tell_to_finest(level)
    if aim is None and hits >= PART * len(pilot.tried[level].coarse):
        pilot.ease(level)
    tried = tuple(pilot.tried[level] for level in sorted(pilot.tried))
    return replace(pilot.tried[level].errors, tried=tried)


@dataclass(frozen=True)
class _Pilot:
    """State of a pilot of hits; the arguments are those of `pilot_hits`.

    Attributes:
        known: outcomes of the first shots, by level.
        tried: judged levels.
        shifts: shift of the measures over what is allowed, by judged level.
    """

    outcomes_at: Callable[[Numerics, Shots], Outcomes]
    shots: Shots
    numerics: Numerics
    price: Callable[[int], float]
    free: Sequence[bool]
    aim: Aim | None
    known: dict[int, Outcomes] = field(default_factory=dict)
    tried: dict[int, Tried] = field(default_factory=dict)
    shifts: dict[int, float] = field(default_factory=dict)

    @property
    def counts(self) -> list[int]:
        """Numbers of shots that may judge a level: each twice the one before."""
        most = min(MOST, len(self.shots))
        counts = [min(most, _first_shots(self.numerics.asked))]
        while counts[-1] < most:
            counts.append(min(most, 2 * counts[-1]))
        return counts

    def missing(self, level: int, count: int) -> int:
        """How many of the first `count` shots are not computed at a level."""
        return max(0, count - len(self.known[level])) if level in self.known else count

    def worth(self, level: int, finer: int, count: int | None = None) -> bool:
        """Whether the first `count` shots at a level and a finer one are worth their cost (PATIENCE, WORTH)."""
        if not self.tried:
            return True
        further = FURTHER if len(self.free) == 1 else FURTHER_LAYERED
        usual = level <= coarsest_level(self.numerics.asked.strictness) + further
        count = count or self.counts[0]
        try:
            spent = sum(len(outcomes) * self.price(at) for at, outcomes in self.known.items())
            spent += sum(self.missing(at, count) * self.price(at) for at in (level, finer))
            return spent <= PATIENCE or (usual and spent <= WORTH * self.price(level))
        except MemoryError:  # the plate's period does not fit at that grid spacing
            return False

    def at(self, level: int, count: int) -> Outcomes:
        """Outcomes of the first `count` shots at a level."""
        if new := self.missing(level, count):
            more = self.outcomes_at(at_level(level, self.numerics), self.shots[count - new : count])
            self.known[level] = Outcomes.joined([self.known[level], more]) if level in self.known else more
        return self.known[level][:count]

    def judge(self, level: int, finer: int) -> LevelVerdict:
        """Judge a level by its change to a finer one, with more shots until they decide whether it keeps the
        promise."""
        first = verdict = self.judged(level, finer, self.counts[0])
        for count in self.counts[1:]:
            if self.decided(level, verdict) or not self.worth(level, finer, count):
                break
            verdict = self.judged(level, finer, count)
        return verdict._replace(typical=first.typical)

    def decided(self, level: int, verdict: LevelVerdict) -> bool:
        """Whether more shots would hardly change the verdict."""
        if self.aim is not None:
            low, high = OPEN_MEASURE
            return not low < self.shifts[level] < high
        (low, high), (errors, coarse, _) = OPEN, self.tried[level]
        few = self.numerics.asked.status_share < errors.status_error <= OPEN_STATUS / len(coarse)
        return not low < verdict.excess < high and not (few and verdict.excess <= low)

    def judged(self, level: int, finer: int, count: int) -> LevelVerdict:
        """Judge a level by its change to a finer one, with the first `count` shots."""
        coarse, fine = self.at(level, count), self.at(finer, count)
        errors, verdict = self.compared(at_level(level, self.numerics), coarse, fine, coarse)
        # A finer level ends no more shots otherwise than a coarser one. If that had more shots, its share is better
        # known.
        coarser = [
            level_tried.errors.status_error
            for at, level_tried in self.tried.items()
            if at < level and len(level_tried.fine) > count
        ]
        if errors.status_error > min(coarser, default=1.0):
            kept = verdict.excess <= 1.0 and min(coarser) <= self.numerics.asked.status_share
            errors = replace(errors, status_error=min(coarser), kept=kept)
        if self.aim is not None:
            excess = self.shifts[level] = self.aim.excess(coarse, fine, self.shots[:count])
            by_aim = LevelVerdict(excess <= 1.0, excess, excess, math.inf)
            verdict = by_aim if self.aim.alone else verdict._replace(kept=errors.kept or by_aim.kept)
            errors = replace(errors, kept=verdict.kept)
        _logger.info("pilot: %d shots at level %d err by %s, kept: %s", count, level, errors.errors, errors.kept)
        self.tried[level] = Tried(errors, coarse, fine)
        return verdict._replace(kept=errors.kept)

    def compared(
        self, numerics: Numerics, coarse: Outcomes, fine: Outcomes, between: Outcomes
    ) -> tuple[HitErrors, LevelVerdict]:
        """`changes.compared` for this pilot's shots, at numerics of a level."""
        assert numerics.level is not None
        margin, shots = ERROR_PER_CHANGE[min(2, len(LADDER) - 1 - numerics.level)], self.shots[: len(fine)]
        return compared(numerics, self.numerics.asked, (coarse, between, fine), margin, shots, self.free)

    def compare_more(self, level: int, hits: int) -> None:
        """Compare further shots at the chosen level, within COMPARED times the cost of the run: a few shots say little
        of the share that ends otherwise."""
        kept, finer = self.tried[level].errors.kept, min(level + 2, len(LADDER) - 1)
        known = min(len(self.known[level]), len(self.known[finer]))
        room = COMPARED * hits * self.price(level) / (self.price(level) + self.price(finer))
        if (count := min(len(self.shots), known + int(room))) > len(self.tried[level].coarse):
            self.judged(level, finer, count)
            tried = self.tried[level]
            self.tried[level] = tried._replace(errors=replace(tried.errors, kept=kept))

    def tell_to_finest(self, level: int) -> None:
        """State the errors of a level that breaks the promise by its change to the finest level with as many shots:
        where errors stall, a change over two levels is too small."""
        coarse = self.tried[level].coarse
        finest = max(at for at, outcomes in self.known.items() if len(outcomes) >= len(coarse))
        fine = self.known[finest][: len(coarse)]
        errors, _ = self.compared(at_level(level, self.numerics), coarse, fine, coarse)
        self.tried[level] = Tried(replace(errors, kept=False), coarse, fine)

    def ease(self, level: int) -> None:
        """Take coarser levels of single settings if the errors stay below ROOM times what is allowed and no more shots
        end otherwise. The errors are plain or weighed ones, as those by which the level itself was taken."""
        errors, coarse, fine = self.tried[level]
        settings = dict[str, int]()
        plain, verdict = self.compared(errors.numerics, coarse, fine, coarse)

        def excess(verdict: LevelVerdict) -> float:
            return verdict.excess if errors.kept else verdict.weighed

        for name in SETTINGS:
            for down in (2, 1) if excess(verdict) < 0.5 else (1,):
                if excess(verdict) >= ROOM or down > level:
                    continue
                at = at_level(level, self.numerics, **settings, **{name: level - down})
                outcomes = self.outcomes_at(at, self.shots[: len(fine)])
                eased, told = self.compared(at, outcomes, fine, coarse)
                _logger.info("pilot: level %d with %s errs by %s", level, at.coarser, eased.errors)
                if excess(told) <= ROOM and not eased.status_error > plain.status_error:
                    settings[name], verdict = level - down, told
                    eased = replace(eased, kept=errors.kept, status_error=errors.status_error)
                    self.tried[level] = Tried(eased, outcomes, fine)
                    break


def limits_pilot_size(accuracy: Accuracy) -> int:
    """Number of limits in a pilot."""
    return max(LIMITS, fewest(accuracy.share))


def pilot_limits(limits_at: Callable[[int], Array], numerics: Numerics, quantity: str) -> LimitErrors:
    """Find the level whose limits have the accuracy that is asked for.

    Errors about halve from level to level, so if half of the limits are within the promise, two more levels are tried.
    Some limits have no bounded error, such as those at which the outcome jumps or passing is not monotone.

    Args:
        limits_at: computes the limits of a pilot's shots on a level of LADDER.
        quantity: "velocity" or "thickness". A thickness goes with the square of the velocity.

    Raises:
        ValueError: the accuracy has no bound on limits.
    """
    asked, usual = numerics.asked, PRESETS["draft"].limit
    if asked.limit is None or usual is None:
        raise ValueError("accuracy: needs limit, the error of a limit as a share of the median limit")
    limit = (1.0 if quantity == "velocity" else 2.0) * asked.limit
    limits, tried = cache(limits_at), dict[int, LimitErrors]()

    def judge(level: int, finer: int) -> LevelVerdict:
        change, half, typical = limit_changes(limits(level), limits(finer), asked.share)
        margin, allowed = ERROR_PER_CHANGE[finer - level], limit * typical
        kept, excess = margin * change <= allowed, margin * half / max(allowed, 1e-30)
        tried[level] = LimitErrors(at_level(level, numerics), kept, asked.share, margin * change, quantity, finer)
        return LevelVerdict(kept, excess, excess, excess)

    first = min(coarsest_level(usual / asked.limit), FINEST_LIMIT)
    level = climb(judge, range(first, FINEST_LIMIT + 1), 2)
    if level is None:
        return LimitErrors(at_level(first, numerics), False, asked.share, math.inf, quantity)
    return tried[level]
