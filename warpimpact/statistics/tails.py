"""Worst tenths and quantiles as means of numbers of the shots, so that they have the intervals of means.

Over independent shots, the mean of the worst tenth is the smallest mean of q + (x − q)₊ / 0.1 over q, where q is the
quantile of 0.9 (R. T. Rockafellar and S. Uryasev, Journal of Risk 2 (2000) 21). At the minimum an error of q has no
effect to first order, so the interval is that of this mean at the sample's q.

In a group of shots, the worst tenth and the quantile are weighted sums of the ordered numbers. A quantile has the
weights of F. E. Harrell and C. E. Davis, Biometrika 69 (1982) 635, which are smooth. The numbers of the shots are the
pseudo-values of the jackknife (J. W. Tukey, Annals of Mathematical Statistics 29 (1958) 614): n times the sum of a
group of n, minus n − 1 times the sum without the shot. Their mean is free of the bias of small groups to first order,
and their scatter gives the error of the group.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array

WORST = 0.1
"""Share of the shots that is the worst tenth."""
_FEWEST_WORST = 40
"""Fewest independent shots in the worst tenth for an interval that holds with its stated confidence."""
FEWEST_SHOTS = 16
"""Fewest shots of a group that has a worst tenth or a quantile."""

OrderWeights = Callable[[int], Array]
"""Function of the count of ordered numbers: their weights, shape [count], the smallest number first. Their sum is 1."""


def worst_tenth(values: Array) -> Array:
    """Numbers whose mean is that of the largest tenth of the values; same shape, NaN stays NaN."""
    known = values[~np.isnan(values)]
    if not len(known):
        return values
    start = float(np.quantile(known, 1.0 - WORST, method="inverted_cdf"))
    return start + np.maximum(values - start, 0.0) / WORST


def has_interval(count: int, images: int) -> bool:
    """Whether `count` shots suffice for an interval of the worst tenth; `images` in a row count as one shot."""
    return count * WORST >= _FEWEST_WORST * images


def worst_tenth_weights(count: int) -> Array:
    """`OrderWeights` of the mean of the largest tenth."""
    ends = np.arange(count + 1) / count
    return np.diff(np.maximum(ends, 1.0 - WORST)) / WORST


def quantile_weights(share: float) -> OrderWeights:
    """Weights of the quantile that exceeds this share of the numbers."""
    from scipy.special import betainc

    return lambda count: np.diff(
        betainc((count + 1) * share, (count + 1) * (1.0 - share), np.arange(count + 1) / count)
    )


def pseudo_values(numbers: Array, groups: NDArray[np.number], weights: OrderWeights, *, images: int = 1) -> Array:
    """Numbers of the shots whose mean over a group is a weighted sum of the group's ordered numbers; NaN in groups of
    fewer than `FEWEST_SHOTS`.

    Numbers, groups and result have the shape [shots]. NaN marks a shot that does not count. Infinite numbers count as
    the finite extreme, and `images` in a row as one.
    """
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return np.full(len(numbers), np.nan)
    bounded = np.clip(numbers, finite.min(), finite.max())[::images]
    pseudo = np.full(len(bounded), np.nan)
    group_of = np.where(np.isnan(bounded), np.nan, groups[::images])
    for group in np.unique(group_of[~np.isnan(group_of)]):
        members = np.flatnonzero(group_of == group)
        if len(members) >= FEWEST_SHOTS:
            pseudo[members] = _jackknifed(bounded[members], weights)
    return np.where(np.isnan(numbers), np.nan, np.repeat(pseudo, images)[: len(numbers)])


def _jackknifed(values: Array, weights: OrderWeights) -> Array:
    """Pseudo-values of the numbers of one group."""
    count, order = len(values), np.argsort(values, kind="stable")
    ordered, fewer = values[order], weights(count - 1)
    below = np.concatenate([[0.0], np.cumsum(fewer * ordered[:-1])])  # smaller numbers keep their ranks
    above = np.concatenate([np.cumsum((fewer * ordered[1:])[::-1])[::-1], [0.0]])
    pseudo = np.empty(count)
    pseudo[order] = count * float(weights(count) @ ordered) - (count - 1) * (below + above)
    return pseudo
