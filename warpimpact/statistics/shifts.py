"""How far the numerics may shift a number over shots, from the same shots at a finer level.

Two levels differ shot by shot, so a few shots give the shift of a mean and its interval. The shift of a share of shots
beyond a limit follows from the shifts of the shots near the limit, even if none of them crosses it.
"""

from __future__ import annotations

import math
from typing import Unpack

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, SamplingDesign, estimate_of

SHIFT_MARGIN = 2.0
"""Factor for the error of the finer level, which is two levels up: there errors of means are about half as large, and
errors of single hits a quarter. With 1.4, which suffices for single hits, 7 of 44 means of random scenes shift by more
(tests/benchmarks/random_shifts.py)."""
_BANDWIDTH = 1.84
"""Half the width of the window of a share, in standard deviations, for one shot: optimal for a normal density (B. W.
Silverman, Density Estimation, 1986, section 3.4.2)."""


def shift_of_mean(coarse: Array, fine: Array, **design: Unpack[SamplingDesign]) -> float:
    """Largest probable error of a mean over the shots that count; NaN if none counts.

    Args:
        coarse, fine: numbers of the same shots at both levels, shape [shots]; NaN marks a shot that does not count.
        design: arguments of `estimate_of`.
    """
    return _largest(change_of_mean(coarse, fine, **design))


def change_of_mean(coarse: Array, fine: Array, **design: Unpack[SamplingDesign]) -> Estimate:
    """Change of a mean from the coarse to the fine level, with its interval. The arguments are those of
    `shift_of_mean`."""
    counts = ~np.isnan(coarse)
    if not counts.any():
        return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
    mean, share = float(coarse[counts].mean()), float(counts.mean())
    change = (np.nan_to_num(fine - mean) - np.nan_to_num(coarse - mean)) / share
    return estimate_of("mean", change, **design)


def shift_of_quantile(coarse: Array, fine: Array, share: float, **design: Unpack[SamplingDesign]) -> float:
    """Largest probable error of a quantile; arguments as in `shift_of_mean`. The half of the shots that is nearest to
    the quantile in rank shows how it moves."""
    both = np.flatnonzero(np.isfinite(coarse) & np.isfinite(fine))
    if not len(both):
        return math.nan
    ranks_away = np.abs(np.argsort(np.argsort(coarse[both])) + 0.5 - share * len(both))
    near = both[ranks_away <= np.median(ranks_away)]
    return _largest(estimate_of("mean", fine[near] - coarse[near], **design))


def shift_of_share(coarse: Array, fine: Array, **design: Unpack[SamplingDesign]) -> float:
    """Largest probable error of the share of shots with a positive number; arguments as in `shift_of_mean`. Numbers
    may be infinite.

    The share changes by E[shift · δ(number)], with a window in place of δ. A shot that shifts by more than the window
    counts by its sign at both levels. If more shots cross 0 than this estimate allows, because many numbers lie in a
    part of the window, only crossings count.
    """
    known = ~np.isnan(coarse) & ~np.isnan(fine)
    if not known.any():
        return math.nan
    coarse, fine = coarse[known], fine[known]
    finite = np.isfinite(coarse) & np.isfinite(fine)
    window = _BANDWIDTH * float(np.std(coarse[finite])) * int(finite.sum()) ** -0.2 if finite.any() else 0.0
    with np.errstate(invalid="ignore"):
        shift, middle = fine - coarse, 0.5 * (coarse + fine)
        near = finite & (np.abs(shift) < window)
    change = np.where(fine > 0.0, 1.0, 0.0) - np.where(coarse > 0.0, 1.0, 0.0)
    crossed = estimate_of("difference", change, **design)
    change[near] = np.where(np.abs(middle[near]) < window, shift[near] / (2.0 * window), 0.0)
    smooth = estimate_of("mean", change, **design)
    return _largest(smooth if crossed.low <= smooth.value <= crossed.high else crossed)


def shift_of_yes(coarse: Array, fine: Array, **design: Unpack[SamplingDesign]) -> float:
    """Largest probable error of the share of answers that are 1, not 0; arguments as in `shift_of_mean`. It is 0 if all
    answers are the same."""
    both = np.concatenate([coarse, fine])
    if len(np.unique(both[~np.isnan(both)])) < 2:
        return 0.0
    return _largest(estimate_of("difference", fine - coarse, **design))


def _largest(change: Estimate) -> float:
    """The end of the interval of a change that is farther from 0, with the margin for the finer level."""
    return SHIFT_MARGIN * (abs(change.value) + change.half_width)
