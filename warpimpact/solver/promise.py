"""What a named fidelity promises, and the level of resolution that keeps the promise on a scene.

A pilot computes some of the shots on levels of LADDER, coarse to fine. The error of a level is estimated by its change
to a finer one. The coarsest level whose error is within the promise is taken for all shots. The estimate is an upper
one: a high order statistic of the pilot's shots, times a margin for the error of the finer level itself.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Accuracy, Numerics, Scene, Shots
from warpimpact.solver.marching import Progress
from warpimpact.solver.resolution import LADDER, Fidelity, level
from warpimpact.solver.simulate import simulate

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

RISK = 1.0 / 6.0
"""Probability at most that the estimate from the pilot's shots lies below the 90th percentile of all shots; where there
are enough shots for that."""
MARGIN = {1: 2.0, 2: 1.4}
"""Factor of an estimate by the number of levels to the finer one. In 40 random scenes, 83 to 98 % of the
estimates are then at least the 90th percentile that other hits show (tests/benchmarks/random_scenes.py)."""
SLOW = 0.25
"""Share of the impact velocity below which the error of a speed is weighed as that of the energy, E = m v²/2: in
proportion to the speed. The energy is computed to some accuracy, so the error of a speed near 0 has no bound."""
BEYOND = 1
"""Levels behind the first one whose weighed errors are within a promise, on which the plain ones are looked for: each
costs about twice the one before."""


class Named(NamedTuple):
    """What a name stands for: errors of 90 % of the hits, in residual velocity and in tilt at the largest stand-off,
    the levels of LADDER between which it is looked for, and the shots of its pilot. More shots make a lower estimate
    safe; those of fine levels are dear. Draft and standard end where 105 random scenes of single plates needed no finer
    level, but one: who asks for a draft waits for no level that costs fifty times as much."""

    accuracy: Accuracy
    first: int
    last: int
    pilot: int


PROMISES = {
    "draft": Named(Accuracy(residual_velocity=5.0, tilt="5 deg"), 0, 5, 64),
    "standard": Named(Accuracy(residual_velocity=1.0, tilt="1 deg"), 2, 7, 64),
    "reference": Named(Accuracy(residual_velocity=0.2, tilt="0.2 deg"), 4, 8, 32),
}


@dataclass(frozen=True)
class Promise:
    """What a pilot found.

    Attributes:
        fidelity: the numerics to compute all shots with.
        kept: whether the errors are within what the name promises.
        residual_velocity_error, tilt_error: upper estimates of the errors of 90 % of the shots [m/s] and [rad];
            infinite where the pilot could not tell. The residual velocities behind all layers count.
        depth_error: likewise, of the depth of the shots that stop in a layer [m]; NaN where none does.
    """

    fidelity: Fidelity
    kept: bool
    residual_velocity_error: float
    tilt_error: float
    depth_error: float = math.nan

    @property
    def phrase(self) -> str:
        """The errors, for a line of progress."""
        errors = errors_text(self.residual_velocity_error, math.degrees(self.tilt_error), self.depth_error)
        return f"accuracy {errors} for 90 % of the hits{'' if self.kept else ', not as promised'}"


def errors_text(velocity: float, tilt: float, depth: float = math.nan) -> str:
    """Errors of residual velocity [m/s], tilt [degree] and depth [m], where there is one."""
    errors = f"{upper_digits(velocity)} m/s and {upper_digits(tilt)} deg"
    return errors if math.isnan(depth) else f"{errors} and {upper_digits(1e3 * depth)} mm of depth"


def upper_digits(error: float) -> str:
    """An error rounded up to two digits, so that one above a bound never reads as if it were at the bound."""
    up = Context(prec=2, rounding=ROUND_CEILING).create_decimal(f"{error:.9g}")  # nine digits: noise does not count
    return f"{float(up):g}"


def keep(
    scene: Scene, numerics: Numerics, pilot: Shots, *, device: str = "auto", progress: Progress | None = None
) -> Promise:
    """Find the coarsest level of resolution that keeps the promise of a named fidelity.

    Args:
        numerics: its fidelity and precision count; single settings would promise nothing (`Numerics.explicit`).
        pilot: shots like those that are to be computed, some `Named.pilot` of them.
        device: as in `simulate`.
        progress: called with (0, shots) while a level is computed; an exception that it raises ends the search.

    Returns:
        The promise, kept. If no level keeps it: the coarsest level that keeps it with errors weighed by the energy of
        slow cores, where finer ones would be of little use. Else the finest level that has a finer one to compare with.

    Raises:
        DeviceError: the device is absent.
    """
    accuracy, first, last, _ = PROMISES[numerics.fidelity]
    known: dict[int, Outcomes] = {}
    follow = progress and (lambda _, total: progress(0, total))
    found = Promise(level(first, numerics), False, math.inf, math.inf)
    enough: Promise | None = None
    for index in range(first, len(LADDER) - 1):
        if index > last:
            break
        finer = min(index + 2, len(LADDER) - 1)
        try:
            for needed in (index, finer):
                if needed not in known:
                    known[needed] = simulate(
                        scene, pilot, numerics=level(needed, numerics), device=device, progress=follow
                    )
        except MemoryError:  # the plate's period does not fit at that spacing: what was found so far has to do
            break
        pair, margin = (known[index], known[finer]), MARGIN[finer - index]
        plain, weighed = (margin * _errors(*pair, pilot.at_a_plate, impact) for impact in (None, pilot.velocity))
        kept = _within(accuracy, plain)
        found = Promise(level(index, numerics), kept, *(float(error) for error in plain))
        told = (index, float(plain[0]), math.degrees(plain[1]), "kept" if kept else "not kept")
        _logger.info("pilot at level %d: errors of %.2g m/s and %.2g deg, the promise is %s", *told)
        if kept:
            return found
        if enough is None and _within(accuracy, weighed):
            enough, last = found, min(last, index + BEYOND)
    return enough or found


def _within(accuracy: Accuracy, errors: Array) -> bool:
    return bool(errors[0] <= accuracy.residual_velocity and errors[1] <= accuracy.tilt)


def _errors(coarse: Outcomes, fine: Outcomes, at_a_plate: int, impact: Array | None) -> Array:
    """Changes of residual velocity [m/s], last tilt [rad] and depth [m] that 90 % of all shots stay within, but for
    RISK. NaN if there is no depth."""
    velocity, tilt, depth = changes(coarse, fine, impact)
    depth = depth[np.isfinite(depth)]
    return np.array([_upper(errors, at_a_plate) if len(errors) else math.nan for errors in (velocity, tilt, depth)])


def _upper(errors: Array, at_a_plate: int) -> float:
    """Shots at one plate err alike, so they count as one in what is known of the 90th percentile."""
    plates = max(1, len(errors) // at_a_plate)
    place = math.ceil(len(errors) * upper_place(plates) / plates)
    return float(np.sort(errors)[place - 1])


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


def upper_place(count: int) -> int:
    """Place of the order statistic of so many shots that lies below their 90th percentile with a probability of at
    most RISK; the last one, if none does: so many of the shots lie below it, or more, where each does by 0.9."""
    below = 0.0
    for place in range(count, 0, -1):
        below += math.comb(count, place) * 0.9**place * 0.1 ** (count - place)
        if below > RISK:
            return min(place + 1, count)
    return 1
