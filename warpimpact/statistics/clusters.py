"""Means over shots in clusters, such as the shots at one plate: only clusters are independent."""

from __future__ import annotations

from typing import Unpack

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of


def cluster_numbers(values: Array) -> Array:
    """One number per cluster; their mean is the mean of all values, and their scatter gives its error to first order.

    The mean is a ratio of two sums over clusters (W. G. Cochran, Sampling Techniques, 3rd edition, 1977, section 6.3).

    The values have the shape [clusters, members], the numbers [clusters]. NaN marks a member that does not count; the
    numbers are NaN if none counts.
    """
    known = ~np.isnan(values)
    if not known.any():
        return np.full(len(values), np.nan)
    mean = float(values[known].mean())
    deviations = np.where(known, values - mean, 0.0).sum(axis=1)
    return np.asarray(mean + deviations * (len(values) / known.sum()))


def cluster_estimate(values: Array, *, binary: bool = False, **dealt: Unpack[Estimating]) -> Estimate:
    """Mean of all values, shape [clusters, members], with its interval; `count` is the number of values. Clusters are
    dealt to the replicates. If binary values, 0 and 1, are all equal, it is the interval of a share of the clusters."""
    known = ~np.isnan(values)
    mean = estimate_of("mean", cluster_numbers(values), **dealt)
    low, high = mean.low, mean.high
    if binary and known.any():
        low, high = max(0.0, low), min(1.0, high)
        if np.ptp(values[known]) == 0.0:
            share = estimate_of("share", np.where(known.any(axis=1), mean.value, np.nan), **dealt)
            low, high = share.low, share.high
    spread = float(np.std(values[known])) if known.any() else np.nan
    return Estimate(mean.value, low, high, int(known.sum()), spread)
