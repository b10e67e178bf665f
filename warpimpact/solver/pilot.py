"""The coarsest level of resolution that keeps a promised accuracy on a scene.

A pilot computes some of the shots on levels of LADDER, coarse to fine. The error of a level is estimated by its change
to a finer one. The coarsest level whose error is within the promise is taken for all shots. The estimate is an upper
one: a high order statistic of the pilot's shots, times a margin for the error of the finer level itself. One search
serves two measures: what becomes of the shots, and their limits.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Accuracy, Numerics, Shots
from warpimpact.solver.changes import ended_otherwise, limit_changes, upper_errors
from warpimpact.solver.findings import Found, HitErrors, LimitErrors, Tried
from warpimpact.solver.resolution import LADDER, at_level, coarsest_level

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

MARGIN = {1: 2.0, 2: 1.4}
"""Factor of an estimate by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates are then at least the 90th percentile that other hits show (tests/benchmarks/random_scenes.py)."""
SHOTS, SHOTS_OF_FINE, LIMITS = 64, 32, 16
"""Shots of a pilot, of one that begins at FINE or beyond, where they are dear, and limits of a pilot. More shots make a
lower estimate safe."""
MORE, PART = 256, 16
"""Shots of a pilot where SHOTS leave the choice between two levels open, and one of so many shots of a run at most."""
OPEN = (0.7, 1.5)
"""Upper estimates over what is allowed, between which more shots may choose another level."""
OPEN_MEASURE = (0.7, 3.0)
"""Likewise of what a measure shifts by: mostly the noise of few shots, of which four times as many leave half."""
FEW = 2
"""Shots that end otherwise, as few as which say little of their share; likewise."""
FAR = 4.0
"""Estimates over what is allowed, above which the next level is not tried: errors about halve from level to level."""
STALLED = 0.7
"""Share of an error that is left two levels on, above which finer levels are of little use: it falls to a quarter where
it converges, but not where cores barely pass or tumble."""
ALIKE = 1.5
"""Errors of levels up to so many times the smallest are no reason for a finer one, where none keeps the promise."""
FINE = 4
FEWEST = 1.6
"""At least so many shots of a pilot lie beyond the promised percentile, in the mean."""
FURTHER = 5
"""Levels behind the first one on which a promise is looked for: 105 random scenes of single plates needed no finer one
for draft and standard, but one. Who asks for a draft waits for no level that costs fifty times as much."""
FURTHER_LAYERED = 3
"""Likewise behind several layers, where a shot costs more: eight to ten times the first level's cost."""
PATIENCE, WORTH = 10.0, 1600
"""What a pilot may take: so many seconds of a core, or as long as so many hits take at the level that it looks at,
whichever is more: a tenth of a run of 16,384 hits. As long as it takes no more than these seconds, it looks at finer
levels than FURTHER, too. Times are those that are foreseen (`Prepared.seconds`), so that a level does not depend on the
machine."""
FINEST_LIMIT = 6
"""The last level that is taken for limits. A finer one is only compared with."""
BEYOND, BEYOND_LIMITS = 1, 2
"""Levels behind the first one that does nearly, on which one is looked for that keeps the promise; each costs about
twice the one before. Nearly does a level whose weighed errors are within the promise. Of limits, half are: as errors
about halve from level to level, the others are off by more than four times as much two levels on. Some limits, such as
those at which the outcome jumps, or that come and go, have no bounded error, and finer levels are of little use."""


def pilot_size(accuracy: Accuracy, hits: int = 0) -> int:
    """Shots of a pilot, at most; of a run of so many hits."""
    return max(_first(accuracy), min(MORE, hits // PART))


def _first(accuracy: Accuracy) -> int:
    """Shots that a pilot begins with."""
    usual = SHOTS if coarsest_level(accuracy.strictness) < FINE else SHOTS_OF_FINE
    return max(usual, _fewest(accuracy.share))


def limits_pilot_size(accuracy: Accuracy) -> int:
    """Limits of a pilot."""
    return max(LIMITS, _fewest(accuracy.share))


def _fewest(share: float) -> int:
    return math.ceil(FEWEST / (1.0 - share) - 1e-9)


Excess: TypeAlias = Callable[[Outcomes, Outcomes, Shots], float]
"""What outcomes of some shots at a level are off by over what is allowed, from those at a finer level."""


class Purse:
    """What a pilot may still take, by the price of a shot at a level [s]."""

    def __init__(self, price: Callable[[int], float]) -> None:
        self._price, self._spent = price, 0.0

    def pay(self, level: int, shots: int) -> None:
        """Some shots are computed."""
        self._spent += shots * self._price(level)

    def allows(self, level: int, new: Iterable[int], shots: int, patient: bool) -> bool:
        """Whether a level is worth some shots at some new levels. Who is not `patient` goes on only as long as it takes
        no time to speak of."""
        try:
            spent = self._spent + shots * sum(self._price(one) for one in new)
        except MemoryError:  # the plate's period does not fit at that spacing
            return False
        return spent <= PATIENCE or (patient and spent <= WORTH * self._price(level))


def pilot_hits(
    outcomes_at: Callable[[int, Shots], Outcomes],
    pilot: Shots,
    numerics: Numerics,
    free: Sequence[bool] = (True,),
    excess_of: Excess | None = None,
    purse: Purse | None = None,
) -> HitErrors:
    """Find the coarsest level whose outcomes have the accuracy that is asked for.

    Args:
        outcomes_at: computes some of the pilot's shots on a level of LADDER.
        pilot: shots like those that are to be computed, some `pilot_size` of them, the first of which are like all. The
            rest is computed where the first leave the choice between two levels open.
        numerics: their accuracy, precision and layout count; other settings would promise nothing.
        free: of each layer of the target, whether a core flies free behind it (`Scene.free_behind`). Residual
            velocities behind others count in no error.
        excess_of: in place of the accuracy, from the coarsest level on.
        purse: what it may take; None if that does not matter.

    Returns:
        The level that keeps the promise. If none does: the coarsest one that keeps it with errors weighed by the energy
        of slow cores, where finer ones would be of little use. Else the coarsest one whose errors are about the
        smallest of all. Its errors are then those to the finest level that as many shots were computed at.

    Raises:
        ValueError: the accuracy says nothing of outcomes.
    """
    accuracy, at_a_plate = numerics.asked, pilot.at_a_plate
    if math.isinf(accuracy.residual_velocity) and math.isinf(accuracy.tilt):
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")
    usual_first = coarsest_level(accuracy.strictness)
    level, unsure = (usual_first, OPEN) if excess_of is None else (0, OPEN_MEASURE)
    count = min(len(pilot), -(-_first(accuracy) // at_a_plate) * at_a_plate)
    some, rest = pilot[:count], pilot[count:]
    known: dict[tuple[int, bool], Outcomes] = {}
    tried: dict[int, Tried] = {}

    def computed(index: int, whole: bool) -> Outcomes:
        if (index, whole) not in known:
            others = [computed(index, False)] if whole else []
            known[index, whole] = Outcomes.joined([*others, outcomes_at(index, rest if whole else some)])
            if purse is not None:
                purse.pay(index, len(rest if whole else some))
        return known[index, whole]

    def allowed(index: int, finer: int, whole: bool = False) -> bool:
        usual = index <= usual_first + (FURTHER if len(free) == 1 else FURTHER_LAYERED)
        if purse is None or not tried:
            return usual
        new = [one for one in (index, finer) if (one, whole) not in known]
        return purse.allows(index, new, len(rest if whole else some), usual)

    def judge(index: int, finer: int, margin: float) -> tuple[HitErrors, float, bool]:
        for whole in (False, True) if len(rest) else (False,):
            if whole and not allowed(index, finer, whole):
                break
            shots = pilot if whole else some
            pair = computed(index, whole), computed(finer, whole)
            found, excess, weighed = judged(*pair, shots, at_level(index, numerics), accuracy, margin, free)
            nearly = weighed <= 1.0
            if excess_of is not None:
                excess, nearly = excess_of(*pair, shots), False
                found = replace(found, kept=excess <= 1.0)
            _logger.info(
                "pilot of %d hits at level %d: errors of %s, the promise is %skept",
                len(shots), index, found.errors, "" if found.kept else "not ",
            )  # fmt: skip
            few = accuracy.status_share < found.status_error <= FEW / len(shots)
            if not (unsure[0] < excess < unsure[1] or (few and excess <= unsure[0])):
                break
        tried[index] = found, *pair
        return found, excess, nearly

    found = _coarsest(judge, range(level, len(LADDER) - 1), len(LADDER) - 1, BEYOND, allowed)
    if found is None:
        return HitErrors(at_level(level, numerics), False, accuracy.share, math.inf, math.inf)
    if not found.kept:
        index, coarse = next((at, coarse) for at, (one, coarse, _) in tried.items() if one is found)
        finest = max(at for at, one in known.items() if len(one) >= len(coarse))
        tried[index] = _to_finer(found, coarse, known[finest], finest[0] - index, pilot, accuracy, free)
        found = tried[index][0]
    return replace(found, tried=tuple(tried[index] for index in sorted(tried)))


def _to_finer(
    found: HitErrors, coarse: Outcomes, fine: Outcomes, on: int, pilot: Shots, accuracy: Accuracy, free: Sequence[bool]
) -> Tried:
    """A level that breaks the promise, with its errors to one so many levels on: where they stall, two tell too
    little."""
    count, margin = len(coarse), MARGIN[min(2, on)]
    told, *_ = judged(coarse, fine[:count], pilot[:count], found.numerics, accuracy, margin, free)
    return replace(told, kept=False), coarse, fine[:count]


def judged(
    coarse: Outcomes,
    fine: Outcomes,
    shots: Shots,
    numerics: Numerics,
    accuracy: Accuracy,
    margin: float,
    free: Sequence[bool],
    between: Outcomes | None = None,
) -> tuple[HitErrors, float, float]:
    """What is known of a resolution from some shots: the finding, its errors over what is allowed, and the same with
    errors weighed by the energy of slow cores.

    Args:
        margin: how many times the change to the fine outcomes the error is at most.
        between: outcomes at a level between, if the margin is that level's. What it has beyond 1 is then the error of
            the fine outcomes, over the change from there.
    """

    def upper(impact: Array | None, relative: tuple[float, float]) -> Array:
        told = (shots.at_a_plate, accuracy.share, impact, relative, free)
        if between is None:
            return margin * upper_errors(coarse, fine, *told)
        return upper_errors(coarse, fine, *told) + (margin - 1.0) * upper_errors(between, fine, *told)

    layered = LAYER_RESIDUAL_VELOCITY in coarse
    relative = (accuracy.residual_velocity_share / accuracy.residual_velocity, accuracy.tilt_share / accuracy.tilt)
    if not layered:
        relative = (0.0, 0.0)
    told, counted, weighed = upper(None, (0.0, 0.0)), upper(None, relative), upper(shots.velocity, relative)
    status = float(ended_otherwise(coarse, fine).mean()) if layered else math.nan
    excess = _excess(accuracy, counted, layered)
    kept = excess <= 1.0 and not status > accuracy.status_share
    velocity, tilt, depth = (float(error) for error in told)
    found = HitErrors(numerics, kept, accuracy.share, velocity, tilt, depth, status, finer=fine)
    return found, excess, _excess(accuracy, weighed, layered)


def _excess(accuracy: Accuracy, errors: Array, layered: bool) -> float:
    """The largest of the errors over what is allowed; infinite if no shot has a speed. A depth counts behind layers.
    What is not asked for counts as 0, however large its error is."""
    velocity, tilt = np.nan_to_num(errors[:2], nan=math.inf)
    depth = np.nan_to_num(errors[2], nan=0.0) if layered else 0.0
    allowed = accuracy.residual_velocity, accuracy.tilt, accuracy.depth
    return max(
        float(error) / bound if math.isfinite(bound) else 0.0
        for error, bound in zip((velocity, tilt, depth), allowed, strict=True)
    )


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

    def judge(index: int, finer: int, margin: float) -> tuple[LimitErrors, float, bool]:
        change, half, typical = limit_changes(limits(index), limits(finer), share)
        allowed = allowed_share * typical
        return (
            found_at(index, margin * change, allowed, finer),
            margin * half / max(allowed, 1e-30),
            margin * half <= allowed,
        )

    levels = range(first, FINEST_LIMIT + 1)
    found = _coarsest(judge, levels, FINEST_LIMIT + 1, BEYOND_LIMITS)
    return found or found_at(first, math.inf, 0.0)


Finding = TypeVar("Finding", bound=Found)


def _coarsest(
    judge: Callable[[int, int, float], tuple[Finding, float, bool]],
    levels: range,
    finest: int,
    beyond: int,
    allowed: Callable[[int, int], bool] = lambda index, finer: True,
) -> Finding | None:
    """What is found at the coarsest of some levels that keeps the promise; if none does, at the coarsest one that
    nearly does, else at the coarsest one whose errors are about the smallest. None if not even the first level fits the
    memory.

    Args:
        judge: the finding at a level by comparing with a finer one, with a margin; its errors over what is allowed; and
            whether it nearly keeps the promise.
        finest: the last level to compare with.
        beyond: levels that are tried behind one that nearly keeps the promise.
        allowed: whether a level, compared with a finer one, is worth its cost.
    """
    tried: dict[int, tuple[Finding, float]] = {}
    enough = None
    index, last = levels[0], levels[-1]
    while index <= last:
        finer = min(index + 2, finest)  # neighbours err alike
        if not allowed(index, finer):
            break
        try:
            found, excess, nearly = judge(index, finer, MARGIN[finer - index])
        except MemoryError:  # the plate's period does not fit at that spacing: what was found so far has to do
            break
        if found.kept:
            return found
        if enough is None and nearly:
            enough, last = found, min(last, index + beyond)
        if any(excess > STALLED * before for at, (_, before) in tried.items() if at <= index - 2):
            last = index
        tried[index] = found, excess
        far = excess > FAR and enough is None and index + 2 <= last and allowed(index + 2, min(index + 4, finest))
        index += 2 if far else 1
    smallest = min((excess for _, excess in tried.values()), default=math.inf)
    return enough or next((found for found, excess in tried.values() if excess <= ALIKE * smallest), None)
