"""The coarsest level of resolution that keeps a promised accuracy on a scene.

A pilot computes some of the shots on levels of LADDER, coarse to fine. The error of a level is estimated by its change
to a finer one. The coarsest level whose error is within the promise is taken for all shots. The estimate is an upper
one: a high order statistic of the pilot's shots, times a margin for the error of the finer level itself. One search
serves two measures: what becomes of the shots, and their limits.
"""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Accuracy, Numerics, Shots
from warpimpact.solver.changes import limit_changes, upper_errors
from warpimpact.solver.resolution import LADDER, at_level, coarsest_level

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

MARGIN = {1: 2.0, 2: 1.4}
"""Factor of an estimate by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates are then at least the 90th percentile that other hits show (tests/benchmarks/random_scenes.py)."""
SHOTS, SHOTS_OF_FINE, LIMITS = 64, 32, 16
"""Shots of a pilot, of one that begins at FINE or beyond, where they are dear, and limits of a pilot. More shots make a
lower estimate safe."""
FINE = 4
FEWEST = 1.6
"""At least so many shots of a pilot lie beyond the promised percentile, in the mean."""
FURTHER = 5
"""Levels behind the first one on which a promise is looked for: 105 random scenes of single plates needed no finer one
for draft and standard, but one. Who asks for a draft waits for no level that costs fifty times as much."""
FINEST_LIMIT = 6
"""The last level that is taken for limits. A finer one is only compared with."""
BEYOND, BEYOND_LIMITS = 1, 2
"""Levels behind the first one that does nearly, on which one is looked for that keeps the promise; each costs about
twice the one before. Nearly does a level whose weighed errors are within the promise. Of limits, half are: as errors
about halve from level to level, the others are off by more than four times as much two levels on. Some limits, such as
those at which the outcome jumps, or that come and go, have no bounded error, and finer levels are of little use."""


@dataclass(frozen=True)
class Found:
    """What a pilot found.

    Attributes:
        numerics: the level to compute all shots with.
        kept: whether the errors are within what was asked for.
        share: of the shots that are within the errors.
    """

    numerics: Numerics
    kept: bool
    share: float

    @property
    @abstractmethod
    def errors(self) -> str:
        """Upper estimates of the errors, with units."""

    @property
    def phrase(self) -> str:
        """The errors, for a line of progress."""
        return f"accuracy {self.errors} for {hits_text(self.share)}{'' if self.kept else ', not as promised'}"


@dataclass(frozen=True)
class HitErrors(Found):
    """Upper estimates of the errors of what becomes of the shots; infinite where the pilot could not tell.

    Attributes:
        residual_velocity_error: [m/s]; the residual velocities behind all layers count.
        tilt_error: at the last stand-off [rad].
        depth_error: of the shots that stop in a layer [m]; NaN where none does.
    """

    residual_velocity_error: float
    tilt_error: float
    depth_error: float = math.nan

    @property
    def errors(self) -> str:
        return errors_text(self.residual_velocity_error, math.degrees(self.tilt_error), self.depth_error)


@dataclass(frozen=True)
class LimitErrors(Found):
    """Upper estimate of the errors of limits.

    Attributes:
        error: of velocities [m/s] or of thicknesses [m]; infinite where the pilot could not tell.
        quantity: "velocity" or "thickness".
    """

    error: float
    quantity: str

    @property
    def errors(self) -> str:
        return limit_error_text(self.error, self.quantity)


def hits_text(share: float) -> str:
    """So many of the hits."""
    return f"{100.0 * share:.3g} % of the hits"


def errors_text(velocity: float, tilt: float, depth: float = math.nan) -> str:
    """Errors of residual velocity [m/s], tilt [degree] and depth [m], where there is one."""
    errors = f"{upper_digits(velocity)} m/s and {upper_digits(tilt)} deg"
    return errors if math.isnan(depth) else f"{errors} and {upper_digits(1e3 * depth)} mm of depth"


def limit_error_text(error: float, quantity: str) -> str:
    """Error of a limit velocity [m/s] or of a limit thickness [m]."""
    return f"{upper_digits(error)} m/s" if quantity == "velocity" else f"{upper_digits(1e3 * error)} mm"


def upper_digits(error: float) -> str:
    """An error rounded up to two digits, so that one above a bound never reads as if it were at the bound."""
    up = Context(prec=2, rounding=ROUND_CEILING).create_decimal(f"{error:.9g}")  # nine digits: noise does not count
    return f"{float(up):g}"


def accuracy_text(velocity: float, tilt: float, share: float) -> str:
    """Errors in residual velocity [m/s] and tilt [rad] that are asked for; an infinite one is not."""
    parts = [f"{velocity:g} m/s"] if math.isfinite(velocity) else []
    parts += [f"{math.degrees(tilt):g} deg"] if math.isfinite(tilt) else []
    return f"{' and '.join(parts)} for {hits_text(share)}"


def pilot_size(accuracy: Accuracy) -> int:
    """Shots of a pilot."""
    usual = SHOTS if coarsest_level(accuracy.strictness) < FINE else SHOTS_OF_FINE
    return max(usual, _fewest(accuracy.share))


def limits_pilot_size(accuracy: Accuracy) -> int:
    """Limits of a pilot."""
    return max(LIMITS, _fewest(accuracy.share))


def _fewest(share: float) -> int:
    return math.ceil(FEWEST / (1.0 - share) - 1e-9)


def pilot_hits(outcomes_at: Callable[[int], Outcomes], pilot: Shots, numerics: Numerics) -> HitErrors:
    """Find the coarsest level whose outcomes have the accuracy that is asked for.

    Args:
        outcomes_at: computes the pilot's shots on a level of LADDER.
        pilot: shots like those that are to be computed, some `pilot_size` of them.
        numerics: their accuracy, precision and layout count; other settings would promise nothing.

    Returns:
        The level that keeps the promise. If none does: the coarsest one that keeps it with errors weighed by the energy
        of slow cores, where finer ones would be of little use. Else the finest level that has a finer one to compare
        with.

    Raises:
        ValueError: the accuracy says nothing of outcomes.
    """
    accuracy, at_a_plate = numerics.asked, pilot.at_a_plate
    if math.isinf(accuracy.residual_velocity) and math.isinf(accuracy.tilt):
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")
    first = coarsest_level(accuracy.strictness)

    def judge(index: int, coarse: Outcomes, fine: Outcomes, margin: float) -> tuple[HitErrors, bool]:
        plain, weighed = (
            margin * upper_errors(coarse, fine, at_a_plate, accuracy.share, impact) for impact in (None, pilot.velocity)
        )
        kept = _within(accuracy, plain)
        found = HitErrors(at_level(index, numerics), kept, accuracy.share, *(float(error) for error in plain))
        _logger.info(
            "pilot at level %d: errors of %s, the promise is %skept", index, found.errors, "" if kept else "not "
        )
        return found, _within(accuracy, weighed)

    levels = range(first, min(first + FURTHER, len(LADDER) - 2) + 1)
    found = _coarsest(outcomes_at, judge, levels, len(LADDER) - 1, BEYOND)
    return found or HitErrors(at_level(first, numerics), False, accuracy.share, math.inf, math.inf)


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

    def found_at(index: int, error: float, allowed: float) -> LimitErrors:
        return LimitErrors(at_level(index, numerics), error <= allowed, share, error, quantity)

    def judge(index: int, coarse: Array, fine: Array, margin: float) -> tuple[LimitErrors, bool]:
        change, half, typical = limit_changes(coarse, fine, share)
        allowed = allowed_share * typical
        return found_at(index, margin * change, allowed), margin * half <= allowed

    levels = range(first, FINEST_LIMIT + 1)
    found = _coarsest(limits_at, judge, levels, FINEST_LIMIT + 1, BEYOND_LIMITS)
    return found or found_at(first, math.inf, 0.0)


Computed = TypeVar("Computed")
Finding = TypeVar("Finding", bound=Found)


def _coarsest(
    compute: Callable[[int], Computed],
    judge: Callable[[int, Computed, Computed, float], tuple[Finding, bool]],
    levels: range,
    finest: int,
    beyond: int,
) -> Finding | None:
    """What is found at the coarsest of some levels that keeps the promise; if none does, at the coarsest one that
    nearly does, else at the last one tried. None if not even the first level fits the memory.

    Args:
        compute: what is compared, on a level.
        judge: the finding at a level by what is computed on it and on a finer one, and a margin; and whether it nearly
            keeps the promise.
        finest: the last level to compare with.
        beyond: levels that are tried behind one that nearly keeps the promise.
    """
    known: dict[int, Computed] = {}
    found = enough = None
    last = levels[-1]
    for index in levels:
        if index > last:
            break
        finer = min(index + 2, finest)  # neighbours err alike
        try:
            for needed in (index, finer):
                if needed not in known:
                    known[needed] = compute(needed)
        except MemoryError:  # the plate's period does not fit at that spacing: what was found so far has to do
            break
        found, nearly = judge(index, known[index], known[finer], MARGIN[finer - index])
        if found.kept:
            return found
        if enough is None and nearly:
            enough, last = found, min(last, index + beyond)
    return enough or found


def _within(accuracy: Accuracy, errors: Array) -> bool:
    return bool(errors[0] <= accuracy.residual_velocity and errors[1] <= accuracy.tilt)
