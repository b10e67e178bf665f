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

from warpimpact.kernels.status import Status
from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Accuracy, Numerics, Shots
from warpimpact.solver.resolution import LADDER, at_level, coarsest_level

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

RISK = 1.0 / 6.0
"""Probability at most that the estimate from the pilot's shots lies below the percentile of all shots that is promised;
where there are enough shots for that."""
MARGIN = {1: 2.0, 2: 1.4}
"""Factor of an estimate by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates are then at least the 90th percentile that other hits show (tests/benchmarks/random_scenes.py)."""
SLOW = 0.25
"""Share of the impact velocity below which the error of a speed is weighed as that of the energy, E = m v²/2: in
proportion to the speed. The energy is computed to some accuracy, so the error of a speed near 0 has no bound."""
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
            margin * _upper_errors(coarse, fine, at_a_plate, accuracy.share, impact)
            for impact in (None, pilot.velocity)
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
        change, half, typical = _change(coarse, fine, share)
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


def _upper_errors(coarse: Outcomes, fine: Outcomes, at_a_plate: int, share: float, impact: Array | None) -> Array:
    """Changes of residual velocity [m/s], last tilt [rad] and depth [m] that a share of all shots stay within, but for
    RISK. NaN if there is no depth."""
    velocity, tilt, depth = changes(coarse, fine, impact)
    depth = depth[np.isfinite(depth)]
    each = (velocity, tilt, depth)
    return np.array([_upper(errors, at_a_plate, share) if len(errors) else math.nan for errors in each])


def _upper(errors: Array, at_a_plate: int, share: float) -> float:
    """Shots at one plate err alike, so they count as one in what is known of the percentile."""
    plates = max(1, len(errors) // at_a_plate)
    place = math.ceil(len(errors) * upper_place(plates, share) / plates)
    return float(np.sort(errors)[place - 1])


def upper_place(count: int, share: float) -> int:
    """Place of the order statistic of so many shots that lies below the percentile of a share with a probability of at
    most RISK; the last one, if none does: so many of the shots lie below it, or more, where each does by the share."""
    below = 0.0
    for place in range(count, 0, -1):
        below += math.comb(count, place) * share**place * (1.0 - share) ** (count - place)
        if below > RISK:
            return min(place + 1, count)
    return 1


def _change(coarse: Array, fine: Array, share: float) -> tuple[float, float, float]:
    """The change that a share of the limits stay within, but for RISK; the median change of those that are finite on
    one level at least; and the median limit."""
    same = (coarse == fine) | (np.isnan(coarse) & np.isnan(fine))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(coarse - fine))
    change[np.isnan(change)] = math.inf
    finite = np.isfinite(fine)
    return _upper(change, 1, share), _median(change[finite | np.isfinite(coarse)]), _median(fine[finite])


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else 0.0


def changes(coarse: Outcomes, fine: Outcomes, impact: Array | None = None) -> tuple[Array, Array, Array]:
    """What changes between the outcomes of the same shots, each of shape [shots]: the residual velocity [m/s], or that
    behind a layer if it changes by more; the tilt at the last stand-off [rad]; and the depth [m].

    A core that does not leave the target, or a layer, has the speed 0 there; one that comes back has a negative one. A
    tilt that only one of both has counts as half a turn. The first two are infinite where the computation of one alone
    failed. The depth is NaN where the core does not stop in the same layer.

    Args:
        impact: velocities [m/s], shape [shots], to weigh the first two by the energy of slow cores (SLOW).
    """
    before, after = _speed(coarse), _speed(fine)
    weight = _weight(before, after, impact)
    failed = [one.status >= Status.UNFINISHED for one in (coarse, fine)]
    velocity, tilt = weight * np.abs(after - before), np.zeros(len(before))
    if coarse.tilt.shape[1]:
        last = coarse.tilt[:, -1], fine.tilt[:, -1]
        neither = np.isnan(last[0]) & np.isnan(last[1])
        tilt = np.where(neither, 0.0, weight * np.nan_to_num(np.abs(last[1] - last[0]), nan=math.pi))
    depth = np.full(len(velocity), math.nan)
    if LAYER_RESIDUAL_VELOCITY in coarse:
        before, after = (np.nan_to_num(one.layer_residual_velocity) for one in (coarse, fine))
        apart = _weight(before, after, None if impact is None else impact[:, None]) * np.abs(after - before)
        velocity = np.maximum(velocity, apart.max(axis=1))
        depth = np.where(coarse.stopped_in == fine.stopped_in, np.abs(fine.depth - coarse.depth), math.nan)
    one_failed = failed[0] != failed[1]
    return np.where(one_failed, math.inf, velocity), np.where(one_failed, math.inf, tilt), depth


def _speed(outcomes: Outcomes) -> Array:
    back = outcomes.status == Status.RICOCHETED
    return np.nan_to_num(np.where(back, -outcomes.residual_velocity, outcomes.residual_velocity))


def _weight(one: Array, other: Array, impact: Array | None) -> Array:
    """What an error between two speeds counts."""
    if impact is None:
        return np.ones_like(one)
    return np.asarray(np.minimum(1.0, 0.5 * (np.abs(one) + np.abs(other)) / (SLOW * impact)))
