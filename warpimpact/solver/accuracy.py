"""The level of resolution that keeps an accuracy: one rule for outcomes and limits.

A pilot computes some hits of a run at a level of LADDER and at the level two finer. The error of the level is a
percentile of the changes, or behind a base the change of the answer, times ERROR_PER_CHANGE. The level rises until its
error is within the accuracy, up to the end of the ladder, of the memory or of PILOT_SECONDS. If no level is accurate
enough, the tolerance is not met, and the run takes the coarsest level whose error is about the smallest.
"""

from __future__ import annotations

import logging
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, Context
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.errors import PilotTooLong, TooLong
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import LAYER_RESIDUAL_VELOCITY, failures
from warpimpact.scene import Scene, Shots
from warpimpact.scene.units import list_text
from warpimpact.solver.device import Worker
from warpimpact.solver.marching import FastLawComputation
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import LADDER, coarsest_level
from warpimpact.solver.settings import Accuracy, FastLawSettings

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

PILOT_HITS, PILOT_LIMITS = 128, 16
"""Hits, and limits, of a pilot. A tenth of the hits may err otherwise than all others, and 64 hits can miss that tenth.
A limit takes the time of some 35 hits."""
PILOT_SECONDS = 10.0
"""Seconds of a core that a pilot may take, as foreseen (`Prepared.cost`), so that a level depends on no machine. It
bounds a hit to some 10 ms; single plates get to the end of the ladder."""
LONGEST_PILOT = 60.0
"""Seconds after which a pilot ends. Cores that tumble or stop take longer than foreseen."""
ERROR_PER_CHANGE = 1.5
"""Error of a level over its change to the level two finer: 1.33 where errors halve from level to level, and a margin
(tests/benchmarks/random_scenes.py). Errors that differ by less count as equal."""

FIRST_AT_BASE = 2
"""First level for the accuracy of an answer behind a base. At level 1 P(base perforated) errs by up to 1.4 points."""
NEAR_LIMIT = 0.05
"""Share of the impact energy below which a residual energy counts as near the limit. Of 34 cores that pass at one level
alone, 33 have less than 0.03 (tests/benchmarks/NOTES.md)."""

UNITS = {
    "base_perforated_error": ("% in P(base perforated)", 100.0),
    "mean_velocity_error": ("% of the impact velocity in means", 100.0),
    "residual_velocity_error": ("m/s", 1.0),
    "tilt_error": ("deg", 1.0),
    "depth_error": ("mm of depth", 1e3),
    "limit_velocity_error": ("m/s", 1.0),
    "limit_thickness_error": ("mm", 1e3),
    "status_error": ("% of the hits with another status", 100.0),
}
"""Unit in which each error is shown, with its factor. They are stored in m/s, degree, m, and as a share."""


class LevelErrors(NamedTuple):
    """Errors of a level, by the names of UNITS, and the largest of them over what is allowed."""

    errors: Mapping[str, float]
    excess: float


@dataclass(frozen=True)
class PilotResult:
    """The level that a pilot chose, and its errors.

    Attributes:
        level: of the ladder of resolutions.
        kept: whether the errors are within the tolerance.
        errors: by the names of UNITS; infinite where no finer level could be computed.
        finer: outcomes of the pilot's hits two levels finer; None without a comparison.
    """

    level: int
    kept: bool
    errors: Mapping[str, float] = field(default_factory=dict)
    finer: Outcomes | None = field(default=None, compare=False, repr=False)


def pilot_size(accuracy: Accuracy, least: int = PILOT_HITS) -> int:
    """Hits of a pilot. Some 1.6 or more are expected beyond the share of the tolerance."""
    return max(least, math.ceil(1.6 / (1.0 - accuracy.share) - 1e-9))


class Pilot:
    """Hits that are computed at several levels, at each once, within LONGEST_PILOT seconds."""

    def __init__(self, compute: Callable[[int], Outcomes]) -> None:
        self._compute, self._outcomes, self._seconds = compute, dict[int, Outcomes](), dict[int, float]()

    def outcomes(self, level: int) -> Outcomes:
        """The outcomes at a level."""
        if level not in self._outcomes:
            finest, spent = max(self._seconds, default=level), sum(self._seconds.values())
            taken = self._seconds.get(finest, 0.0)
            if self._seconds and spent + 2.0 ** (level - finest) * taken > LONGEST_PILOT:
                raise PilotTooLong(
                    f"the choice of the resolution ended after {spent:.0f} s, because its hits at level {finest} took "
                    f"{taken:.2g} s; the resolution may be too coarse; give numerics.level to choose it"
                )
            begin = time.perf_counter()
            self._outcomes[level] = self._compute(level)
            self._seconds[level] = time.perf_counter() - begin
        return self._outcomes[level]


def choose_level(
    first: int,
    compute: Callable[[int], Outcomes],
    errors: Callable[[Outcomes, Outcomes], LevelErrors],
    seconds: Callable[[int], float],
) -> PilotResult:
    """Choose the coarsest level that keeps an accuracy.

    Args:
        first: coarsest level to try.
        compute: computes the pilot's hits at a level.
        errors: errors of a level, from its outcomes and those two levels finer.
        seconds: foreseen time of the pilot's hits at a level.
    """
    pilot, tried = Pilot(compute), dict[int, LevelErrors]()
    for level in range(first, len(LADDER) - 2):
        try:
            if tried and sum(seconds(at) for at in range(first, level + 3)) > PILOT_SECONDS:
                break
            tried[level] = errors(pilot.outcomes(level), pilot.outcomes(level + 2))
        except (MemoryError, TooLong):
            break
        except PilotTooLong as late:
            warnings.warn(late, stacklevel=2)
            break
        _logger.info("pilot: level %d errs by %s", level, errors_text(tried[level].errors))
        if tried[level].excess <= 1.0:
            break
    if not tried:
        return PilotResult(first, kept=False)
    least = min(of_level.excess for of_level in tried.values())
    alike = least if least <= 1.0 else ERROR_PER_CHANGE * least
    level = next(level for level, of_level in tried.items() if of_level.excess <= alike)
    chosen = tried[level]
    return PilotResult(level, chosen.excess <= 1.0, chosen.errors, pilot.outcomes(level + 2))


def hit_errors(coarse: Outcomes, fine: Outcomes, accuracy: Accuracy, free: Sequence[bool]) -> LevelErrors:
    """Errors of residual velocity [m/s] and last tilt [degree] of hits, and what they are over what is allowed.

    The velocity is the one behind the target, or behind a layer if it changes more. A core that does not leave has the
    speed 0; one that comes back a negative one. A tilt at one level alone counts as half a turn. A computation that
    fails at one level alone has no bound. Several layers have the depth [m] of the cores that stop, too, and relative
    bounds. Hits that end otherwise there, in another status or layer, count in the status alone.

    Args:
        coarse, fine: outcomes of the same hits at both levels.
        free: for each layer, whether a core flies free behind it. Velocities behind other layers do not count.
    """
    layered = LAYER_RESIDUAL_VELOCITY in fine
    relative = (accuracy.residual_velocity_share, accuracy.tilt_share) if layered else (0.0, 0.0)
    before, after = _speeds(coarse, free), _speeds(fine, free)
    speed, tilt, allowed = np.abs(after - before), np.zeros(len(after)), np.ones(len(after))
    over = (speed / (accuracy.residual_velocity + relative[0] * np.abs(after))).max(axis=1)
    if coarse.tilt.shape[1]:
        last = coarse.tilt[:, -1], fine.tilt[:, -1]
        neither = np.isnan(last[0]) & np.isnan(last[1])
        tilt = np.where(neither, 0.0, np.nan_to_num(np.abs(last[1] - last[0]), nan=math.pi))
        allowed = accuracy.tilt + relative[1] * np.nan_to_num(last[1])
    failed = failures(coarse.status) != failures(fine.status)
    changes = {
        "residual_velocity_error": (accuracy.residual_velocity, failed, speed.max(axis=1), over),
        "tilt_error": (accuracy.tilt, failed, np.degrees(tilt), tilt / allowed),
    }
    errors, excess, otherwise = dict[str, float](), 0.0, np.zeros(len(after), dtype=bool)
    if layered:
        depth = np.abs(fine.depth - coarse.depth)
        changes["depth_error"] = accuracy.depth, np.zeros_like(failed), depth, depth / accuracy.depth
        otherwise = (coarse.status != fine.status) | (coarse.stopped_in != fine.stopped_in)
    for name, (bound, unbounded, *both) in changes.items():
        changed = (np.where(unbounded, math.inf, np.where(otherwise, math.nan, values)) for values in both)
        error, ratio = (error_of_share(values, accuracy.share) for values in changed)
        if not math.isnan(error):
            errors[name] = error
        if math.isfinite(bound) and not (name == "depth_error" and math.isnan(error)):
            excess = max(excess, math.inf if math.isnan(error) else ratio)
    if layered:
        errors["status_error"] = float(otherwise.mean())
        excess = max(excess, errors["status_error"] / accuracy.status_share)
    return LevelErrors(errors, excess)


def answer_errors(
    coarse: Outcomes, fine: Outcomes, accuracy: Accuracy, free: Sequence[bool], velocity: Array
) -> LevelErrors:
    """Errors of P(base perforated) and of mean velocities over the impact velocity, and what they are over the bounds.

    The share that passes is smooth (`passing_share`). Velocities as in `hit_errors`. Hits whose computation fails at
    one level alone add their share to the error of P.

    Args:
        velocity: impact velocities [m/s], shape [hits].
    """
    failed = failures(coarse.status), failures(fine.status)
    known = ~(failed[0] | failed[1])
    if not known.any():
        return LevelErrors({"base_perforated_error": math.inf, "mean_velocity_error": math.inf}, math.inf)
    before, after = (_speeds(outcomes, free)[known] / velocity[known, None] for outcomes in (coarse, fine))
    passing = [passing_share(speeds[:, 0]) for speeds in (before, after)]
    changes = {
        "base_perforated_error": (accuracy.base_perforated, np.mean(passing[1] - passing[0])),
        "mean_velocity_error": (accuracy.mean_velocity, np.abs(np.mean(after - before, axis=0)).max()),
    }
    errors = {name: ERROR_PER_CHANGE * abs(float(change)) for name, (_, change) in changes.items()}
    errors["base_perforated_error"] += float(np.mean(failed[0] != failed[1]))
    excess = max(errors[name] / bound for name, (bound, _) in changes.items() if bound is not None)
    return LevelErrors(errors, excess)


def passing_share(speeds: Array) -> Array:
    """How far cores count as passing, from 0 to 1, by residual over impact velocity; not positive for no passage.

    A few hundred hits count too few cores that pass at one level alone. So a core counts with its residual energy over
    NEAR_LIMIT of the impact energy, at most 1.
    """
    return np.minimum(np.maximum(speeds, 0.0) ** 2 / NEAR_LIMIT, 1.0)


def limit_errors(coarse: Array, fine: Array, accuracy: Accuracy, quantity: str) -> LevelErrors:
    """Error of limits. What is allowed is a share of the median limit.

    Args:
        coarse, fine: limits of the same hits at both levels [m/s] or [m].
        quantity: "velocity" or "thickness". A thickness goes with the square of the velocity.
    """
    assert accuracy.limit is not None
    same = (coarse == fine) | (np.isnan(coarse) & np.isnan(fine))
    with np.errstate(invalid="ignore"):
        change = np.nan_to_num(np.where(same, 0.0, np.abs(coarse - fine)), nan=math.inf, posinf=math.inf)
    error, finite = error_of_share(change, accuracy.share), fine[np.isfinite(fine)]
    allowed = (1.0 if quantity == "velocity" else 2.0) * accuracy.limit * (np.median(finite) if len(finite) else 0.0)
    return LevelErrors({f"limit_{quantity}_error": error}, error / max(float(allowed), 1e-30))


def error_of_share(changes: Array, share: float) -> float:
    """Error of a share of the hits, from their changes to the level two finer; NaN counts as no hit.

    Only half of the hits that the share leaves out may change more, because the pilot's hits are few: of 128 hits, the
    122nd lies below the 90th percentile of all hits in 3 % of the pilots.
    """
    known = np.sort(changes[~np.isnan(changes)])
    place = math.ceil(0.5 * (1.0 + share) * len(known) - 1e-9) - 1
    return ERROR_PER_CHANGE * float(known[place]) if len(known) else math.nan


def _speeds(outcomes: Outcomes, free: Sequence[bool]) -> Array:
    """Residual velocities [m/s] behind the target and behind the layers that count, shape [hits, 1 or more]."""
    back = outcomes.status == Status.RICOCHETED
    speeds = np.where(back, -outcomes.residual_velocity, outcomes.residual_velocity)[:, None]
    if LAYER_RESIDUAL_VELOCITY in outcomes:
        speeds = np.concatenate([speeds, outcomes.layer_residual_velocity[:, np.array(free)]], axis=1)
    return np.nan_to_num(speeds)


def share_text(share: float) -> str:
    """Words for a share of the hits."""
    return f"{100.0 * share:.3g} % of the hits"


def errors_text(errors: Mapping[str, float]) -> str:
    """Words for the errors among some attributes, rounded up to two digits."""
    known = {name: errors[name] for name in UNITS if name in errors and (name != "status_error" or errors[name])}
    parts = [f"{upper_digits(UNITS[name][1] * error)} {UNITS[name][0]}" for name, error in known.items()]
    return list_text(parts) if parts else "unknown"


def upper_digits(error: float) -> str:
    """An error rounded up to two digits, so that one above a bound never reads as if it were at the bound."""
    up = Context(prec=2, rounding=ROUND_CEILING).create_decimal(f"{error:.9g}")  # nine digits: noise does not count
    return f"{float(up):g}"


def pilot_of(
    scene: Scene,
    pilot: Shots,
    numerics: FastLawSettings,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
) -> PilotResult:
    """Find the level of resolution for an accuracy of outcomes.

    Args:
        pilot: some of the shots.
        trying: called with every level that is computed.

    Raises:
        ValueError: the accuracy has no bound on outcomes, or one on a base that the target lacks.
    """
    required = numerics.required_at(len(scene.target.layers))
    if required.bounds_answer and len(scene.target.layers) == 1:
        raise ValueError("accuracy: base_perforated and mean_velocity need layers behind the plate")
    if not required.bounds_answer and not required.bounds_hits:
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")

    def compute(level: int) -> Outcomes:
        trying(level)
        return FastLawComputation(prepare(scene, pilot, numerics.at_level(level)), worker).compute()

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        parts = [hit_errors(coarse, fine, required, free)] if required.bounds_hits else []
        parts += [answer_errors(coarse, fine, required, free, pilot.velocity)] if required.bounds_answer else []
        every = {name: error for part in parts for name, error in part.errors.items()}
        return LevelErrors(every, max(part.excess for part in parts))

    # A core flies free behind the last layer, and behind one with a gap as wide as the core is long.
    free = [*(gap >= 2.0 * scene.core.bounding_radius for gap in scene.target.gaps[1:]), True]
    first = max(coarsest_level(required.strictness), FIRST_AT_BASE if required.bounds_answer else 0)
    FastLawComputation(prepare(scene, pilot, numerics.at_level(first)), worker).build()
    return choose_level(first, compute, errors, cost_by_level(scene, pilot, numerics))


def cost_by_level(scene: Scene, pilot: Shots, numerics: FastLawSettings, passages: int = 1) -> Callable[[int], float]:
    """A function of a level: the time that some passages of a pilot's shots take there [s]."""
    return cache(lambda level: passages * len(pilot) * prepare(scene, pilot[:1], numerics.at_level(level)).cost.seconds)


def spread(shots: Shots, most: int) -> Shots:
    """At least `most` shots at even distances, in the order of `spread_places`."""
    return shots[spread_places(len(shots), min(len(shots), most))]


def spread_places(places: int, count: int) -> NDArray[np.int64]:
    """`count` of the numbers 0 … places − 1 at even distances, in an order in which any first part is spread, too."""
    digits = max(1, (count - 1).bit_length())
    order = np.array([int(f"{k:0{digits}b}"[::-1], 2) for k in range(2**digits)])
    return np.asarray(np.linspace(0, places, count, endpoint=False).astype(np.int64)[order[order < count]])
