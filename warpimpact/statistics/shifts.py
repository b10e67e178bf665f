"""How far the numerics may shift a number over shots: from the same shots computed at a finer level, too.

Two levels differ shot by shot, so a mean has the shift and its interval from a few shots. A share of the shots beyond a
limit has them from the shifts of the shots near the limit, be it that none of them crosses it.
"""

from __future__ import annotations

import math
from typing import Unpack

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of

SHIFT_MARGIN = 2.0
"""Factor for the error of the finer level itself, two levels on: the errors of means about halve over two levels, where
those of single hits fall to a quarter. With 1.4, which is enough for single hits, 7 of 44 means of random scenes
shift by more (tests/benchmarks/random_shifts.py)."""
WINDOW = 1.84
"""Half the width of the window of a share, in standard deviations, for one shot: that of a normal density (B. W.
Silverman, Density Estimation, 1986, section 3.4.2)."""


def shift_of_mean(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """Most that a mean over the shots that count may be off by.

    Args:
        coarse, fine: numbers of the same shots, shape [shots]; NaN where a shot does not count at that level.
        dealt: arguments of `Dealt`.

    Returns:
        NaN where the shots do not tell it.
    """
    return _most(change_of_mean(coarse, fine, **dealt))


def change_of_mean(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> Estimate:
    """By how much a mean over the shots that count differs at the finer level, with its interval. The arguments are
    those of `shift_of_mean`."""
    counts = ~np.isnan(coarse)
    if not counts.any():
        return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
    mean, share = float(coarse[counts].mean()), float(counts.mean())
    change = (np.nan_to_num(fine - mean) - np.nan_to_num(coarse - mean)) / share
    return estimate_of("mean", change, **dealt)


def shift_of_quantile(coarse: Array, fine: Array, share: float, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of the number that a share of the shots stays below: the shots near it tell how it moves."""
    both = np.flatnonzero(np.isfinite(coarse) & np.isfinite(fine))
    if not len(both):
        return math.nan
    place = np.abs(np.argsort(np.argsort(coarse[both])) + 0.5 - share * len(both))
    near = both[place <= np.median(place)]
    return _most(estimate_of("mean", fine[near] - coarse[near], **dealt))


def shift_of_share(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of the share of the shots whose numbers are positive; they may be infinite.

    The share changes by the density of the numbers at 0 times their mean shift there, E[shift · δ(number)], with a
    window in place of δ. A shot that shifts farther than that counts by the side that it is on. Where more shots cross
    0 than this allows, as where many numbers lie within a part of the window, those that cross count alone.
    """
    known = ~np.isnan(coarse) & ~np.isnan(fine)
    if not known.any():
        return math.nan
    coarse, fine = coarse[known], fine[known]
    finite = np.isfinite(coarse) & np.isfinite(fine)
    wide = WINDOW * float(np.std(coarse[finite])) * int(finite.sum()) ** -0.2 if finite.any() else 0.0
    with np.errstate(invalid="ignore"):
        shift, middle = fine - coarse, 0.5 * (coarse + fine)
        near = finite & (np.abs(shift) < wide)
    change = np.where(fine > 0.0, 1.0, 0.0) - np.where(coarse > 0.0, 1.0, 0.0)
    crossed = estimate_of("difference", change, **dealt)
    change[near] = np.where(np.abs(middle[near]) < wide, shift[near] / (2.0 * wide), 0.0)
    smooth = estimate_of("mean", change, **dealt)
    return _most(smooth if crossed.low <= smooth.value <= crossed.high else crossed)


def shift_of_yes(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of a share of which shots say yes or no, 1 or 0, and no more; 0 where all say the same."""
    both = np.concatenate([coarse, fine])
    if len(np.unique(both[~np.isnan(both)])) < 2:
        return 0.0
    return _most(estimate_of("difference", fine - coarse, **dealt))


def _most(change: Estimate) -> float:
    """The farther end of the interval of a shift, and what the finer level is off by."""
    return SHIFT_MARGIN * (abs(change.value) + change.half_width)
