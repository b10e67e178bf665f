"""Intervals of comparisons: differences and ratios of two numbers, and shifts of a number by the numerics.

Shots at two levels differ shot by shot, so a few shots give the shift of a mean and its interval. The shift of a share
of shots beyond a limit follows from the shifts of the shots near the limit, even if none of them crosses it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, SamplingDesign, estimate_of

ROUNDED = 1e-6
"""Largest relative difference of two numbers by rounding alone, after some operations in single precision."""


def difference_of_independent(first: Estimate, second: Estimate) -> tuple[float, float]:
    """Interval of the difference of two independent estimates, from the intervals of both.

    Source: G. Y. Zou, A. Donner, Statistics in Medicine 27 (2008) 1693.
    """
    difference = first.value - second.value
    below = math.hypot(first.value - first.low, second.high - second.value)
    above = math.hypot(first.high - first.value, second.value - second.low)
    return difference - below, difference + above


def difference_numbers(first: Array, second: Array) -> Array:
    """Numbers whose mean is the difference of two means that share their first shots.

    They scatter as that difference does: what the common shots have in common cancels. The shots beyond them belong to
    the longer sample alone.

    Both have the shape [shots], NaN where a shot does not count; number k of both belongs to shot k. The numbers have
    the shape of the longer sample.
    """
    if len(first) < len(second):
        return -difference_numbers(second, first)
    if len(first) == len(second):
        return first - second
    common = np.isfinite(first[: len(second)]) & np.isfinite(second)
    if not common.any():
        return np.full(len(first), np.nan)
    mean, weight = float(second[common].mean()), np.isfinite(first).sum() / common.sum()
    numbers = first - mean
    numbers[: len(second)][common] -= weight * (second[common] - mean)
    return numbers


class Ratio(NamedTuple):
    """A reference number, the ratio of an estimate to it, and the interval of the ratio; NaN if there is none."""

    reference: float = math.nan
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan

    @classmethod
    def of(cls, estimate: Estimate, numbers: Array, reference: Array | None, design: SamplingDesign) -> Ratio:
        """Ratio of the estimate, the mean of numbers of shape [shots], to the mean of a reference: numbers of the first
        shots, or one number for all; None without a reference.

        The interval of the ratio r of two means of non-negative numbers has all r for which the interval of the mean of
        numbers − r·reference contains 0. It has no upper end (NaN) if the interval of the reference contains 0 (E. C.
        Fieller, Journal of the Royal Statistical Society B 16 (1954) 175).
        """
        known = np.empty(0) if reference is None else reference[~np.isnan(reference)]
        if reference is None or not len(known):
            return cls()
        if (mean := float(known.mean())) <= 0.0:
            return cls(mean)
        ratio, low, high = (number / mean for number in (estimate.value, estimate.low, estimate.high))
        if not np.ptp(known) > 0.0 or not estimate.spread > 0.0 or math.isnan(low):
            return cls(mean, ratio, low, high)
        numerator, denominator = ratio_numbers(numbers, reference, 0.0), ratio_numbers(0.0 * numbers, reference, -1.0)
        samples = numerator, denominator, numerator - denominator
        a, b, ab = (estimate_of("mean", sample, **design).half_width ** 2 for sample in samples)
        # (ratio - r)² ≤ a - (a + b - ab) r + b r²
        square, half, constant = 1.0 - b, ratio - 0.5 * (a + b - ab), ratio**2 - a
        root = math.sqrt(max(0.0, half**2 - square * constant))
        if square <= 0.0:
            low = max(0.0, (half - root) / square) if constant > 0.0 and square < 0.0 else 0.0
            return cls(mean, ratio, low, math.nan)
        return cls(mean, ratio, max(0.0, (half - root) / square), (half + root) / square)


def ratio_numbers(numbers: Array, reference: Array, ratio: float) -> Array:
    """Numbers of the shots whose mean is the ratio of two means, with its error to first order (delta method).

    Number k of the reference belongs to shot k. If the reference has fewer numbers, each has a larger weight.
    """
    mean, weight = np.nanmean(reference), np.isfinite(numbers).sum() / np.isfinite(reference).sum()
    linear = numbers / mean
    linear[: len(reference)] -= np.nan_to_num(ratio * weight * (reference / mean - 1.0))
    return linear


SHIFT_MARGIN = 2.0
"""Factor for the error of the finer level, which is two levels up: there errors of means are about half as large, and
errors of single hits a quarter. With 1.4, which suffices for single hits, 7 of 44 means of random scenes shift by more
(tests/benchmarks/NOTES.md)."""
_BANDWIDTH = 1.84
"""Half the width of the window of a share, in standard deviations, for one shot: optimal for a normal density (B. W.
Silverman, Density Estimation, 1986, section 3.4.2)."""


def shifted_numbers(numbers: Array, before: Array, after: Array, bounds: tuple[float, float]) -> Array:
    """Numbers that change as others do; same shape.

    They change by the difference, or in the ratio of what the change leaves to a bound: where all cores of one plate
    are stopped, those of a similar one are expected to be. They stay where the change is not known.

    Args:
        before, after: the others.
        bounds: least and largest possible number.
    """
    before, after = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    bound = np.where(after < before, *bounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = (after - bound) / (before - bound)
        moved = np.where(np.isfinite(ratio), bound + ratio * (numbers - bound), numbers + (after - before))
    return np.asarray(np.where(np.isfinite(moved), moved, numbers))


def shift_of_mean(coarse: Array, fine: Array, confidence: float = 0.95) -> float:
    """Largest probable error of a mean over the shots that count; NaN if none counts.

    Args:
        coarse, fine: numbers of the same shots at both levels, shape [shots]; NaN marks a shot that does not count.
        confidence: of the interval of the change.
    """
    counts = ~np.isnan(coarse)
    if not counts.any():
        return math.nan
    mean, share = float(coarse[counts].mean()), float(counts.mean())
    change = (np.nan_to_num(fine - mean) - np.nan_to_num(coarse - mean)) / share
    return _largest(estimate_of("mean", change, confidence=confidence))


def shift_of_quantile(coarse: Array, fine: Array, share: float, confidence: float = 0.95) -> float:
    """Largest probable error of a quantile; arguments as in `shift_of_mean`. The half of the shots that is nearest to
    the quantile in rank shows how it moves."""
    both = np.flatnonzero(np.isfinite(coarse) & np.isfinite(fine))
    if not len(both):
        return math.nan
    ranks_away = np.abs(np.argsort(np.argsort(coarse[both])) + 0.5 - share * len(both))
    near = both[ranks_away <= np.median(ranks_away)]
    return _largest(estimate_of("mean", fine[near] - coarse[near], confidence=confidence))


def shift_of_share(coarse: Array, fine: Array, confidence: float = 0.95) -> float:
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
    crossed = estimate_of("difference", change, confidence=confidence)
    change[near] = np.where(np.abs(middle[near]) < window, shift[near] / (2.0 * window), 0.0)
    smooth = estimate_of("mean", change, confidence=confidence)
    return _largest(smooth if crossed.low <= smooth.value <= crossed.high else crossed)


def shift_of_event(coarse: Array, fine: Array, confidence: float = 0.95) -> float:
    """Largest probable error of the share of answers that are 1, not 0; arguments as in `shift_of_mean`. It is 0 if all
    answers are the same."""
    both = np.concatenate([coarse, fine])
    if len(np.unique(both[~np.isnan(both)])) < 2:
        return 0.0
    return _largest(estimate_of("difference", fine - coarse, confidence=confidence))


def _largest(change: Estimate) -> float:
    """The end of the interval of a change that is farther from 0, with the margin for the finer level."""
    return SHIFT_MARGIN * (abs(change.value) + change.half_width)
