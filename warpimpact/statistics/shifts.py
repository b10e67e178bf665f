"""How far the numerics may shift a number over shots: from the same shots computed at a finer level, too.

Two levels differ shot by shot, so a mean has the shift and its interval from a few shots. A share of the shots beyond a
limit changes by those that the shifts of others would carry across the limit. So a few shots tell the shift of a share
that moves by less than one of them.
"""

from __future__ import annotations

import math
from typing import Unpack

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of

BEYOND = 1.4
"""Factor for the error of the finer level itself."""


def shift_of_mean(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """Most that a mean over the shots that count may be off by.

    Args:
        coarse, fine: numbers of the same shots, shape [shots]; NaN where a shot does not count at that level.
        dealt: arguments of `Dealt`.

    Returns:
        NaN where the shots do not tell it.
    """
    counts = ~np.isnan(coarse)
    if not counts.any():
        return math.nan
    mean, share = float(coarse[counts].mean()), float(counts.mean())
    change = (np.nan_to_num(fine - mean) - np.nan_to_num(coarse - mean)) / share
    return _most(estimate_of("mean", change, **dealt))


def shift_of_quantile(coarse: Array, fine: Array, share: float, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of the number that a share of the shots stays below: the shots near it tell how it moves."""
    both = np.flatnonzero(np.isfinite(coarse) & np.isfinite(fine))
    if not len(both):
        return math.nan
    place = np.abs(np.argsort(np.argsort(coarse[both])) + 0.5 - share * len(both))
    near = both[place <= np.median(place)]
    return _most(estimate_of("mean", fine[near] - coarse[near], **dealt))


def shift_of_share(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of the share of the shots whose numbers are positive. The shift of every shot is tried on all
    shots on its side of 0; it may be infinite."""
    known = ~np.isnan(coarse) & ~np.isnan(fine)
    if not known.any():
        return math.nan
    coarse, fine = coarse[known], fine[known]
    with np.errstate(invalid="ignore"):
        shift = np.where(coarse == fine, 0.0, fine - coarse)
    change = np.zeros(len(coarse))
    for side in (1.0, -1.0):
        mine = side * coarse > 0.0
        if mine.any():
            carried = np.searchsorted(np.sort(side * coarse[mine]), -side * shift[mine], side="right")
            change[mine] = -side * carried / int(mine.sum())
    return _most(estimate_of("mean", change, **dealt))


def shift_of_yes(coarse: Array, fine: Array, **dealt: Unpack[Estimating]) -> float:
    """As `shift_of_mean`, of a share of which shots say yes or no, 1 or 0, and no more; 0 where all say the same."""
    if np.nanmin([coarse, fine]) == np.nanmax([coarse, fine]):
        return 0.0
    return _most(estimate_of("difference", fine - coarse, **dealt))


def _most(change: Estimate) -> float:
    """The farther end of the interval of a shift, and what the finer level is off by."""
    return BEYOND * (abs(change.value) + change.half_width)
