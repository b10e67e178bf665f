"""What changes between two levels of resolution, and what most shots stay within."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes

Array = NDArray[np.float64]

RISK = 1.0 / 6.0
"""Probability at most that the estimate from the pilot's shots lies below the percentile of all shots that is promised;
where there are enough shots for that."""
FEWEST = 1.6
"""At least so many shots of a pilot lie beyond the promised percentile, in the mean."""
SLOW = 0.25
"""Share of the impact velocity below which the error of a speed is weighed as that of the energy, E = m v²/2: in
proportion to the speed. The energy is computed to some accuracy, so the error of a speed near 0 has no bound."""


def upper_errors(
    coarse: Outcomes,
    fine: Outcomes,
    at_a_plate: int,
    share: float,
    impact: Array | None = None,
    relative: tuple[float, float] = (0.0, 0.0),
    free: Sequence[bool] | None = None,
    risk: float = RISK,
) -> Array:
    """Changes of residual velocity [m/s], last tilt [rad] and depth [m] that a share of the shots stay within, but for
    a risk; NaN of what no shot has. The other arguments are those of `changes`."""
    plates = np.arange(len(fine)) // at_a_plate
    known = [(errors, ~np.isnan(errors)) for errors in changes(coarse, fine, impact, relative, free)]
    return np.array([upper_error(x[has], share, plates[has], risk) if has.any() else math.nan for x, has in known])


def upper_error(errors: Array, share: float, plates: NDArray[np.intp] | None = None, risk: float = RISK) -> float:
    """What a share of the errors, shape [shots], stay within, but for a risk.

    Args:
        plates: numbers of the plates that the shots hit, of their shape; None if each has its own. As far as shots at
            one plate err alike, they count as one in what is known of the percentile.
    """
    ordered, count = np.sort(errors), float(len(errors))
    if plates is not None:
        beyond = errors > ordered[math.ceil(share * len(errors)) - 1]
        count /= design_effect(beyond.astype(np.float64), plates)
    counted = max(1, math.floor(count + 1e-9))
    return float(ordered[math.ceil(len(errors) * upper_place(counted, share, risk) / counted) - 1])


def design_effect(values: Array, groups: NDArray[np.intp]) -> float:
    """How many values tell as much of the mean as one that is independent of the others, where those of a group are
    alike: the variance of the mean by the sums of groups over that by the values (Kish, Survey Sampling, 1965). By one
    standard error more than it is found, as there may be few groups, and at least 1; at most the size of a group.

    Args:
        values, groups: values and the numbers of their groups, shape [values].
    """
    sums = np.bincount(groups, values - values.mean())
    sizes = np.bincount(groups)
    sums, sizes = sums[sizes > 0], sizes[sizes > 0]
    size, number = float(sizes.mean()), len(sizes)
    if size == 1.0 or number == 1:
        return size
    squares = float(np.square(values - values.mean()).sum())
    found = float(np.square(sums).sum()) / squares * number / (number - 1) if squares > 0.0 else 1.0
    doubt = math.sqrt(2.0 * (size - 1.0) / (size * (number - 1)))
    return min(max(1.0, found + doubt), size)


def upper_place(count: int, share: float, risk: float = RISK) -> int:
    """Place of the order statistic of so many shots that lies below the percentile of a share with a probability of at
    most the risk; the last one, if none does: so many of the shots lie below it, or more, where each does by the
    share."""
    below = 0.0
    for place in range(count, 0, -1):
        below += math.comb(count, place) * share**place * (1.0 - share) ** (count - place)
        if below > risk:
            return min(place + 1, count)
    return 1


def fewest(share: float) -> int:
    """Shots that a pilot needs at least, to tell what a share of all shots stay within."""
    return math.ceil(FEWEST / (1.0 - share) - 1e-9)


def limit_changes(coarse: Array, fine: Array, share: float) -> tuple[float, float, float]:
    """The change that a share of the limits stay within, but for RISK; the median change of those that are finite on
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
    """What changes between the outcomes of the same shots, each of shape [shots]: the residual velocity [m/s], or that
    behind a layer if it changes by more; the tilt at the last stand-off [rad]; and the depth [m].

    A core that does not leave the target, or a layer, has the speed 0 there; one that comes back has a negative one. A
    tilt that only one of both has counts as half a turn. The first two are infinite where the computation of one alone
    failed. The depth is NaN where the core does not stop in the same layer. At several layers the first two are NaN
    where the core ends otherwise (`ended_otherwise`), which is an error of its own.

    Args:
        impact: velocities [m/s], shape [shots], to weigh the first two by the energy of slow cores (SLOW).
        relative: (s/m, 1/rad): an error of a speed v counts as if it were 1 + |v| × the first times smaller, and one of
            a tilt likewise. So an absolute bound stands for one with a relative part.
        free: of each layer, whether residual velocities behind it count; None if all do.
    """
    before, after = _speeds(coarse, free), _speeds(fine, free)
    weight = _weight(before, after, impact)
    failed = [one.status >= Status.UNFINISHED for one in (coarse, fine)]
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
    one_failed = failed[0] != failed[1]
    return np.where(one_failed, math.inf, speed), np.where(one_failed, math.inf, tilt), depth


def ended_otherwise(coarse: Outcomes, fine: Outcomes) -> NDArray[np.bool_]:
    """Whether each shot at several layers ends in another status or in another layer."""
    return np.asarray((coarse.status != fine.status) | (coarse.stopped_in != fine.stopped_in))


def _speeds(outcomes: Outcomes, free: Sequence[bool] | None) -> Array:
    """Residual velocities [m/s] behind the target, then behind those of its layers that count; shape [shots, 1 or
    more]. One that comes back is negative."""
    back = outcomes.status == Status.RICOCHETED
    speeds = np.where(back, -outcomes.residual_velocity, outcomes.residual_velocity)[:, None]
    if LAYER_RESIDUAL_VELOCITY in outcomes:
        behind = outcomes.layer_residual_velocity
        speeds = np.concatenate([speeds, behind if free is None else behind[:, np.array(free)]], axis=1)
    return np.nan_to_num(speeds)


def _weight(one: Array, other: Array, impact: Array | None) -> Array:
    """What an error between two speeds counts, of their shape."""
    if impact is None:
        return np.ones_like(one)
    return np.asarray(np.minimum(1.0, 0.5 * (np.abs(one) + np.abs(other)) / (SLOW * impact[:, None])))
