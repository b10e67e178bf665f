"""Means over shots that come in clusters, such as the shots at one plate: only clusters are independent."""

from __future__ import annotations

from typing import Unpack

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of


def cluster_numbers(values: Array) -> Array:
    """One number per cluster whose mean is the mean of all values, with its error to first order (the mean is a ratio
    of two sums over clusters: W. G. Cochran, Sampling Techniques, 3rd edition, 1977, section 6.3).

    Args:
        values: of the members of every cluster, NaN for a member that does not count, shape [clusters, members].

    Returns:
        Shape [clusters]; NaN if no member counts.
    """
    known = ~np.isnan(values)
    if not known.any():
        return np.full(len(values), np.nan)
    mean = float(values[known].mean())
    apart = np.where(known, values - mean, 0.0).sum(axis=1)
    return np.asarray(mean + apart * (len(values) / known.sum()))


def cluster_estimate(values: Array, *, binary: bool = False, **dealt: Unpack[Estimating]) -> Estimate:
    """Mean of all values with its interval; `count` is the number of values.

    Args:
        values: as of `cluster_numbers`.
        binary: the values are 0 and 1. If all are equal, the interval is that of a share with one value per cluster.
        dealt: `replicates` and `confidence` as in `intervals.Dealt`; clusters are dealt out.
    """
    known = ~np.isnan(values)
    found = estimate_of("mean", cluster_numbers(values), **dealt)
    low, high = found.low, found.high
    if binary and known.any():
        low, high = max(0.0, low), min(1.0, high)
        if np.ptp(values[known]) == 0.0:
            each = np.where(known.any(axis=1), found.value, np.nan)
            share = estimate_of("share", each, **dealt)
            low, high = share.low, share.high
    spread = float(np.std(values[known])) if known.any() else np.nan
    return Estimate(found.value, low, high, int(known.sum()), spread)
