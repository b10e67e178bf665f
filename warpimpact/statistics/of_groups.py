"""Worst tenths and quantiles of groups of shots, as numbers of the shots whose mean over a group is that of the group.

Both are sums of the ordered numbers of a group, with weights. A quantile takes those of F. E. Harrell and C. E. Davis,
Biometrika 69 (1982) 635, which are smooth. The numbers are the pseudo-values of the jackknife (J. W. Tukey, Annals of
Mathematical Statistics 29 (1958) 614): n times the sum of a group of n less n − 1 times the sum without the shot. Their
mean has the bias of few shots taken out, and their scatter tells the error of the group.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array
from warpimpact.statistics.worst_tenth import WORST

FEWEST_SHOTS = 16
"""Fewest shots of a group that have a worst tenth or a quantile."""

Weights = Callable[[int], Array]
"""Weights of so many ordered numbers, the smallest first; their sum is 1."""


def of_worst_tenth(count: int) -> Array:
    """Weights of the mean of the largest tenth."""
    ends = np.arange(count + 1) / count
    return np.diff(np.maximum(ends, 1.0 - WORST)) / WORST


def of_quantile(share: float) -> Weights:
    """Weights of the quantile below which this share of the numbers lies."""
    from scipy.special import betainc

    return lambda count: np.diff(
        betainc((count + 1) * share, (count + 1) * (1.0 - share), np.arange(count + 1) / count)
    )


def pseudo_values(numbers: Array, groups: NDArray[np.number], weights: Weights, *, images: int = 1) -> Array:
    """Numbers whose mean over a group is a weighted sum of the group's ordered numbers.

    Args:
        numbers: shape [shots]; NaN where a shot does not count, or infinite.
        groups: of the shots, same shape.
        images: how many shots in a row are images of each other; together they count as one.

    Returns:
        Shape [shots]; NaN of groups of fewer than `FEWEST_SHOTS`. Infinite numbers count as the largest of the finite.
    """
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return np.full(len(numbers), np.nan)
    bounded = np.clip(numbers, finite.min(), finite.max())[::images]
    found = np.full(len(bounded), np.nan)
    of = np.where(np.isnan(bounded), np.nan, groups[::images])
    for group in np.unique(of[~np.isnan(of)]):
        mine = np.flatnonzero(of == group)
        if len(mine) >= FEWEST_SHOTS:
            found[mine] = _of_one(bounded[mine], weights)
    return np.where(np.isnan(numbers), np.nan, np.repeat(found, images)[: len(numbers)])


def _of_one(values: Array, weights: Weights) -> Array:
    """Pseudo-values of one group."""
    count, order = len(values), np.argsort(values, kind="stable")
    ordered, fewer = values[order], weights(len(values) - 1)
    below = np.concatenate([[0.0], np.cumsum(fewer * ordered[:-1])])  # without the shot, smaller ones keep their ranks
    above = np.concatenate([np.cumsum((fewer * ordered[1:])[::-1])[::-1], [0.0]])
    found = np.empty(count)
    found[order] = count * float(weights(count) @ ordered) - (count - 1) * (below + above)
    return found
