"""Intervals of comparisons: differences and ratios of two numbers."""

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

    Let a, the longer sample, have m shots beyond the n common ones. The difference is the mean of a − b over n, plus
    c·(mean of a over m − mean of a over n). It has no bias for any c, and the least variance for c = β·m/(n + m), where
    β is the slope of a − b against a: additional shots count less, the stronger a and b correlate (double sampling with
    regression: W. G. Cochran, Sampling Techniques, 3rd edition, 1977, section 12.6).

    Both have the shape [shots], NaN where a shot does not count; number k of both belongs to shot k. The numbers have
    the shape of the longer sample.
    """
    if len(first) < len(second):
        return -difference_numbers(second, first)
    both, numbers = len(second), np.full(len(first), np.nan)
    difference = first[:both] - second
    common, more = np.isfinite(difference), np.isfinite(first[both:])
    if not more.any() or not common.any():
        numbers[:both] = difference
        return numbers
    a, a_minus_b, extra = first[:both][common], difference[common], first[both:][more]
    n, m = len(a), len(extra)
    slope = 0.0 if np.ptp(a) == 0.0 else float(np.clip(np.cov(a_minus_b, a, ddof=0)[0, 1] / a.var(), 0.0, 1.0))
    c = slope * m / (n + m)
    within = a_minus_b - c * a
    mean = within.mean() + c * extra.mean()
    # Each part scatters about its own mean, so the variance of the whole is that of the two means.
    numbers[:both][common] = mean + (n + m) / n * (within - within.mean())
    numbers[both:][more] = mean + (n + m) / m * c * (extra - extra.mean())
    return numbers


def confidence_of_each(together: float, count: int) -> float:
    """Confidence of each of `count` intervals that hold together with the confidence `together` (Bonferroni)."""
    return 1.0 - (1.0 - together) / max(1, count)


class Ratio(NamedTuple):
    """A reference number, the ratio of an estimate to it, and the interval of the ratio; NaN if there is none."""

    reference: float = math.nan
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan

    @classmethod
    def of(cls, estimate: Estimate, numbers: Array, reference: Array | None, design: SamplingDesign) -> Ratio:
        """Ratio of the estimate, the mean of numbers of shape [shots], to the mean of a reference: numbers of the first
        shots, or one number for all; None without a reference."""
        known = np.empty(0) if reference is None else reference[~np.isnan(reference)]
        if reference is None or not len(known):
            return cls()
        if (mean := float(known.mean())) <= 0.0:
            return cls(mean)
        ratio, low, high = (number / mean for number in (estimate.value, estimate.low, estimate.high))
        if np.ptp(known) > 0.0 and estimate.spread > 0.0 and not math.isnan(low):
            low, high = _fieller(numbers, reference, ratio, design)
        return cls(mean, ratio, low, high)


def _fieller(numbers: Array, reference: Array, ratio: float, design: SamplingDesign) -> tuple[float, float]:
    """Interval of the ratio r of two means of non-negative numbers: all r for which the interval of the mean of
    numbers − r·reference contains 0. It has no upper end (NaN) if the interval of the reference contains 0.

    Source: E. C. Fieller, Journal of the Royal Statistical Society B 16 (1954) 175.
    """
    numerator, denominator = ratio_numbers(numbers, reference, 0.0), ratio_numbers(0.0 * numbers, reference, -1.0)
    samples = numerator, denominator, numerator - denominator
    a, b, ab = (estimate_of("mean", sample, **design).half_width ** 2 for sample in samples)
    # (ratio - r)² ≤ a - (a + b - ab) r + b r²
    square, half, constant = 1.0 - b, ratio - 0.5 * (a + b - ab), ratio**2 - a
    root = math.sqrt(max(0.0, half**2 - square * constant))
    if square <= 0.0:
        return max(0.0, (half - root) / square) if constant > 0.0 and square < 0.0 else 0.0, math.nan
    return max(0.0, (half - root) / square), (half + root) / square


def ratio_numbers(numbers: Array, reference: Array, ratio: float) -> Array:
    """Numbers of the shots whose mean is the ratio of two means, with its error to first order (delta method).

    Number k of the reference belongs to shot k. If the reference has fewer numbers, each has a larger weight.
    """
    mean, weight = np.nanmean(reference), np.isfinite(numbers).sum() / np.isfinite(reference).sum()
    linear = numbers / mean
    linear[: len(reference)] -= np.nan_to_num(ratio * weight * (reference / mean - 1.0))
    return linear
