"""What changes between two levels of resolution, and what most shots stay within."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes

Array = NDArray[np.float64]

RISK = 1.0 / 6.0
"""Probability at most that the estimate from the pilot's shots lies below the percentile of all shots that is promised;
where there are enough shots for that."""
SLOW = 0.25
"""Share of the impact velocity below which the error of a speed is weighed as that of the energy, E = m v²/2: in
proportion to the speed. The energy is computed to some accuracy, so the error of a speed near 0 has no bound."""


def upper_errors(coarse: Outcomes, fine: Outcomes, at_a_plate: int, share: float, impact: Array | None) -> Array:
    """Changes of residual velocity [m/s], last tilt [rad] and depth [m] that a share of all shots stay within, but for
    RISK. NaN if there is no depth."""
    velocity, tilt, depth = changes(coarse, fine, impact)
    depth = depth[np.isfinite(depth)]
    each = (velocity, tilt, depth)
    return np.array([upper_error(errors, at_a_plate, share) if len(errors) else math.nan for errors in each])


def upper_error(errors: Array, at_a_plate: int, share: float) -> float:
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


def limit_changes(coarse: Array, fine: Array, share: float) -> tuple[float, float, float]:
    """The change that a share of the limits stay within, but for RISK; the median change of those that are finite on
    one level at least; and the median limit."""
    same = (coarse == fine) | (np.isnan(coarse) & np.isnan(fine))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(coarse - fine))
    change[np.isnan(change)] = math.inf
    finite = np.isfinite(fine)
    return upper_error(change, 1, share), _median(change[finite | np.isfinite(coarse)]), _median(fine[finite])


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
