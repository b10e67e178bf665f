"""Worst tenths and quantiles as means of numbers of the shots, so that they have the intervals of means.

Over independent shots, the mean of the worst tenth is the smallest mean of q + (x − q)₊ / 0.1 over q, where q is the
quantile of 0.9 (R. T. Rockafellar and S. Uryasev, Journal of Risk 2 (2000) 21). At the minimum an error of q has no
effect to first order, so the interval is that of this mean at the sample's q.

A quantile is a weighted sum of the ordered numbers with the smooth weights of F. E. Harrell and C. E. Davis, Biometrika
69 (1982) 635. The numbers of the shots are the pseudo-values of the jackknife (J. W. Tukey, Annals of Mathematical
Statistics 29 (1958) 614): n times the sum of all n, minus n − 1 times the sum without the shot. Their scatter gives the
error of the quantile.
"""

from __future__ import annotations

import numpy as np
from scipy.special import betainc

from warpimpact.statistics.intervals import Array

WORST = 0.1
"""Share of the shots that is the worst tenth."""
_FEWEST_WORST = 40
"""Fewest independent shots in the worst tenth for an interval that holds with its stated confidence."""
FEWEST_SHOTS = 16
"""Fewest shots that have a quantile by pseudo-values."""


def worst_tenth(values: Array) -> Array:
    """Numbers whose mean is that of the largest tenth of the values; same shape, NaN stays NaN."""
    known = values[~np.isnan(values)]
    if not len(known):
        return values
    start = float(np.quantile(known, 1.0 - WORST, method="inverted_cdf"))
    return start + np.maximum(values - start, 0.0) / WORST


def has_interval(count: int) -> bool:
    """Whether `count` shots suffice for an interval of the worst tenth."""
    return count * WORST >= _FEWEST_WORST


def pseudo_values(numbers: Array, share: float) -> Array:
    """Numbers of shots whose mean is the quantile that exceeds this share of them, same shape; NaN for fewer than
    `FEWEST_SHOTS`.

    NaN marks a shot that does not count and stays NaN. Infinite numbers count as the finite extreme.
    """
    finite, known = numbers[np.isfinite(numbers)], ~np.isnan(numbers)
    pseudo = np.full(len(numbers), np.nan)
    if len(finite) and known.sum() >= FEWEST_SHOTS:
        pseudo[known] = _jackknifed(np.clip(numbers[known], finite.min(), finite.max()), share)
    return pseudo


def _jackknifed(values: Array, share: float) -> Array:
    count, order = len(values), np.argsort(values, kind="stable")
    ordered, fewer = values[order], _weights(count - 1, share)
    below = np.concatenate([[0.0], np.cumsum(fewer * ordered[:-1])])  # smaller numbers keep their ranks
    above = np.concatenate([np.cumsum((fewer * ordered[1:])[::-1])[::-1], [0.0]])
    pseudo = np.empty(count)
    pseudo[order] = count * float(_weights(count, share) @ ordered) - (count - 1) * (below + above)
    return pseudo


def _weights(count: int, share: float) -> Array:
    """Weights of ordered numbers in a quantile, shape [count]; their sum is 1."""
    ends = np.arange(count + 1) / count
    return np.asarray(np.diff(betainc((count + 1) * share, (count + 1) * (1.0 - share), ends)))
