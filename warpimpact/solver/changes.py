"""What changes between two levels of resolution, and what that tells of the errors of the coarser one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.group import failures
from warpimpact.records.layer_variables import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Accuracy, Numerics, Shots
from warpimpact.solver.findings import HitErrors

Array = NDArray[np.float64]

RISK = 1.0 / 6.0
"""Largest probability that the estimate from the pilot's shots lies below the promised percentile of all shots, where
the pilot has enough shots for that."""
FEWEST = 1.6
"""Fewest shots of a pilot that are expected beyond the promised percentile."""
SLOW_SHARE = 0.25
"""Share of the impact velocity below which the error of a speed is weighed as the error of the energy, E = m v²/2, is:
in proportion to the speed. The energy is computed to some accuracy, so the error of a speed near 0 has no bound."""
TYPICAL = 0.75
"""Share of the first shots whose errors show how errors fall from level to level. The largest few fall by chance."""


class LevelVerdict(NamedTuple):
    """What the errors of a level say, over what is allowed.

    Attributes:
        kept: whether the level keeps the promise.
        excess: upper estimate of the largest error over what is allowed.
        typical: the same for the TYPICAL share of the first shots, without a margin for chance: it shows how errors
            fall from level to level.
        weighed: excess by which a level nearly keeps the promise: the errors of slow cores are weighed by their energy;
            of limits, the median error counts.
    """

    kept: bool
    excess: float
    typical: float
    weighed: float


def compared(
    numerics: Numerics,
    accuracy: Accuracy,
    outcomes: tuple[Outcomes, Outcomes, Outcomes],
    margin: float,
    shots: Shots,
    free: Sequence[bool],
) -> tuple[HitErrors, LevelVerdict]:
    """The errors of numerics, and their ratio to what is allowed.

    Args:
        numerics: a level, with or without coarser settings.
        outcomes: outcomes of the shots with these numerics, at the level itself (the same if no setting is coarser),
            and at a finer level.
        margin: error of the level over its change to the finer one. The part beyond 1 is the error of the finer level.
    """
    coarse, between, fine = outcomes
    layered = LAYER_RESIDUAL_VELOCITY in fine
    relative = _relative(accuracy) if layered else (0.0, 0.0)

    def upper(**how: Any) -> Array:
        usual: dict[str, Any] = {"share": accuracy.share, "free": free}
        change = upper_errors(coarse, fine, **usual | how)
        of_fine = change if coarse is between else upper_errors(between, fine, **usual | how)
        return change + (margin - 1.0) * of_fine

    excess = _excess(accuracy, upper(relative=relative), layered)
    typical = _excess(accuracy, upper(relative=relative, share=TYPICAL, risk=0.5), layered)
    weighed = _excess(accuracy, upper(relative=relative, impact=shots.velocity), layered)
    status = float(ended_otherwise(coarse, fine).mean()) if layered else math.nan
    if status > 1.0 - accuracy.share:
        typical = math.inf  # shots that end otherwise err most, but have no number for their error
    kept = excess <= 1.0 and not status > accuracy.status_share
    velocity, tilt, depth = (float(error) for error in upper())
    errors = HitErrors(numerics, kept, accuracy.share, velocity, tilt, depth, status, finer=fine)
    return errors, LevelVerdict(kept, excess, typical, weighed)


def _relative(accuracy: Accuracy) -> tuple[float, float]:
    """The relative bounds over the absolute ones, for the velocity and the tilt behind layers."""
    return accuracy.residual_velocity_share / accuracy.residual_velocity, accuracy.tilt_share / accuracy.tilt


def _excess(accuracy: Accuracy, errors: Array, layered: bool) -> float:
    """The largest of the errors over what is allowed; infinite if no shot has a speed. The depth counts behind layers.
    An error without a bound counts as 0."""
    velocity, tilt = np.nan_to_num(errors[:2], nan=math.inf)
    depth = np.nan_to_num(errors[2], nan=0.0) if layered else 0.0
    allowed = accuracy.residual_velocity, accuracy.tilt, accuracy.depth
    return max(
        float(error) / bound if math.isfinite(bound) else 0.0
        for error, bound in zip((velocity, tilt, depth), allowed, strict=True)
    )


def upper_errors(
    coarse: Outcomes,
    fine: Outcomes,
    share: float,
    impact: Array | None = None,
    relative: tuple[float, float] = (0.0, 0.0),
    free: Sequence[bool] | None = None,
    risk: float = RISK,
) -> Array:
    """Upper bounds, at this risk, of the changes of residual velocity [m/s], last tilt [rad] and depth [m] of a share
    of the shots; NaN where no shot has the quantity. The other arguments are those of `changes`."""
    known = [(errors, ~np.isnan(errors)) for errors in changes(coarse, fine, impact, relative, free)]
    return np.array([upper_error(x[has], share, risk) if has.any() else math.nan for x, has in known])


def upper_error(errors: Array, share: float, risk: float = RISK) -> float:
    """Upper bound, at this risk, of the errors of a share of the shots, shape [shots]."""
    return float(np.sort(errors)[upper_place(len(errors), share, risk) - 1])


def upper_place(count: int, share: float, risk: float = RISK) -> int:
    """Index, from 1, of the order statistic of `count` shots that exceeds the share's percentile with probability
    1 − risk (the largest if none does)."""
    below = 0.0
    for place in range(count, 0, -1):
        below += math.comb(count, place) * share**place * (1.0 - share) ** (count - place)
        if below > risk:
            return min(place + 1, count)
    return 1


def fewest(share: float) -> int:
    """Shots that a pilot needs to estimate the percentile of this share."""
    return math.ceil(FEWEST / (1.0 - share) - 1e-9)


def limit_changes(coarse: Array, fine: Array, share: float) -> tuple[float, float, float]:
    """Upper bound, at RISK, of the change of a share of the limits; the median change of the limits that are finite at
    one level at least; and the median limit."""
    same = (coarse == fine) | (np.isnan(coarse) & np.isnan(fine))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(coarse - fine))
    change[np.isnan(change)] = math.inf
    finite = np.isfinite(fine)
    return upper_error(change, share), _median(change[finite | np.isfinite(coarse)]), _median(fine[finite])


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else 0.0


def changes(
    coarse: Outcomes,
    fine: Outcomes,
    impact: Array | None = None,
    relative: tuple[float, float] = (0.0, 0.0),
    free: Sequence[bool] | None = None,
) -> tuple[Array, Array, Array]:
    """What changes between the outcomes of the same shots, each of shape [shots]: the residual velocity [m/s], or the
    velocity behind a layer if it changes more; the tilt at the last stand-off [rad]; and the depth [m].

    A core that does not leave the target, or a layer, has the speed 0 there. A core that comes back has a negative
    speed. A tilt in one outcome alone counts as half a turn. Velocity and tilt are infinite where only one of both
    computations failed. The depth is NaN unless the core stops in the same layer in both. At several layers, velocity
    and tilt are NaN where the core ends otherwise (`ended_otherwise`), which is an error by itself.

    Args:
        impact: impact velocities [m/s], shape [shots], to weigh the errors of slow cores by their energy (SLOW_SHARE).
        relative: (s/m, 1/rad): the error of a speed v is divided by 1 + first × |v|, the error of a tilt by 1 + second
            × tilt. An absolute bound on the quotient is a bound with a relative part on the error.
        free: for each layer, whether the residual velocity behind it counts; None if all count.
    """
    before, after = _speeds(coarse, free), _speeds(fine, free)
    weight = _weight(before, after, impact)
    speed = (weight * np.abs(after - before) / (1.0 + relative[0] * np.abs(after))).max(axis=1)
    tilt = np.zeros(len(speed))
    if coarse.tilt.shape[1]:
        last = coarse.tilt[:, -1], fine.tilt[:, -1]
        neither = np.isnan(last[0]) & np.isnan(last[1])
        change = weight[:, 0] * np.nan_to_num(np.abs(last[1] - last[0]), nan=math.pi)
        tilt = np.where(neither, 0.0, change / (1.0 + relative[1] * np.nan_to_num(last[1])))
    depth = np.full(len(speed), math.nan)
    if LAYER_RESIDUAL_VELOCITY in coarse:
        other = ended_otherwise(coarse, fine)
        speed, tilt, depth = (np.where(other, math.nan, x) for x in (speed, tilt, np.abs(fine.depth - coarse.depth)))
    failed = failures(coarse.status) != failures(fine.status)
    return np.where(failed, math.inf, speed), np.where(failed, math.inf, tilt), depth


def ended_otherwise(coarse: Outcomes, fine: Outcomes) -> NDArray[np.bool_]:
    """Whether each shot at several layers ends in another status or in another layer."""
    return np.asarray((coarse.status != fine.status) | (coarse.stopped_in != fine.stopped_in))


def _speeds(outcomes: Outcomes, free: Sequence[bool] | None) -> Array:
    """Residual velocities [m/s] behind the target, then behind the layers that count, shape [shots, 1 or more];
    negative for a core that comes back."""
    back = outcomes.status == Status.RICOCHETED
    speeds = np.where(back, -outcomes.residual_velocity, outcomes.residual_velocity)[:, None]
    if LAYER_RESIDUAL_VELOCITY in outcomes:
        behind = outcomes.layer_residual_velocity
        speeds = np.concatenate([speeds, behind if free is None else behind[:, np.array(free)]], axis=1)
    return np.nan_to_num(speeds)


def _weight(before: Array, after: Array, impact: Array | None) -> Array:
    """Weights of errors between speeds, of their shape."""
    if impact is None:
        return np.ones_like(before)
    return np.asarray(np.minimum(1.0, 0.5 * (np.abs(before) + np.abs(after)) / (SLOW_SHARE * impact[:, None])))
