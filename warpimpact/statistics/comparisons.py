"""Intervals of comparisons: differences and ratios of two numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of

ROUNDED = 1e-6
"""Share of their size by which numbers may differ through rounding alone: shots are computed and stored in single
precision, and a few operations follow."""


def difference_of_independent(one: Estimate, other: Estimate) -> tuple[float, float]:
    """Interval of the difference of two independent estimates, from the intervals of both.

    Source: G. Y. Zou, A. Donner, Statistics in Medicine 27 (2008) 1693.
    """
    difference = one.value - other.value
    below = math.hypot(one.value - one.low, other.high - other.value)
    above = math.hypot(one.high - one.value, other.value - other.low)
    return difference - below, difference + above


def difference_numbers(one: Array, other: Array) -> Array:
    """Numbers whose mean tells the difference of two means, of which the first shots are common to both.

    Let the first have m shots beyond the n common ones. The difference is the mean of a − b over n, plus c times what
    the m say beyond the n, mean(a over m) − mean(a over n). No c gives a bias; c = β·m/(n + m) gives the least
    variance, where β is the slope of a − b against a. So the more the common shots have in common, the less the others
    count (double sampling with regression: W. G. Cochran, Sampling Techniques, 3rd edition, 1977, section 12.6).

    Args:
        one, other: NaN where a shot does not count, shape [shots] each; number k of both belongs to shot k.

    Returns:
        As many numbers as the longer one has, NaN where a shot does not count.
    """
    if len(one) < len(other):
        return -difference_numbers(other, one)
    both, numbers = len(other), np.full(len(one), np.nan)
    apart = one[:both] - other
    common, more = np.isfinite(apart), np.isfinite(one[both:])
    if not more.any() or not common.any():
        numbers[:both] = apart
        return numbers
    a, n, m = one[:both][common], int(common.sum()), int(more.sum())
    slope = 0.0 if np.ptp(a) == 0.0 else float(np.clip(np.cov(apart[common], a, ddof=0)[0, 1] / a.var(), 0.0, 1.0))
    c, extra = slope * m / (n + m), one[both:][more]
    within = apart[common] - c * a
    difference = within.mean() + c * extra.mean()
    # Each part about its own mean: the variance of the whole is then that of the two means.
    numbers[:both][common] = difference + (n + m) / n * (within - within.mean())
    numbers[both:][more] = difference + (n + m) / m * c * (extra - extra.mean())
    return numbers


def confidence_of_each(together: float, count: int) -> float:
    """Confidence of each of `count` intervals, so that all of them hold with the confidence `together` (Bonferroni)."""
    return 1.0 - (1.0 - together) / max(1, count)


class Ratio(NamedTuple):
    """A reference number, the ratio of an estimate to it, and the interval of the ratio; NaN where there is none."""

    reference: float = math.nan
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan

    @classmethod
    def of(cls, estimate: Estimate, numbers: Array, reference: Array | None, dealt: Estimating) -> Ratio:
        """Ratio to the mean of other numbers.

        Args:
            estimate: the numerator.
            numbers: those whose mean is the estimate, shape [shots].
            reference: numbers of the first shots, or one number for all; None where there are none.
            dealt: the arguments of `Dealt` after the kind.
        """
        known = np.empty(0) if reference is None else reference[~np.isnan(reference)]
        if reference is None or not len(known):
            return cls()
        if (mean := float(known.mean())) <= 0.0:
            return cls(mean)
        ratio, low, high = (number / mean for number in (estimate.value, estimate.low, estimate.high))
        if np.ptp(known) > 0.0 and estimate.spread > 0.0 and not math.isnan(low):
            low, high = _of_both(numbers, reference, ratio, dealt)
        return cls(mean, ratio, low, high)


def _of_both(numbers: Array, reference: Array, ratio: float, dealt: Estimating) -> tuple[float, float]:
    """Interval of the ratio r of two means of numbers that are not negative: all r for which the interval of the mean
    of one less r times the other contains 0. It has no upper end (NaN) where the interval of the other contains 0.

    Source: E. C. Fieller, Journal of the Royal Statistical Society B 16 (1954) 175.
    """
    one, other = ratio_numbers(numbers, reference, 0.0), ratio_numbers(0.0 * numbers, reference, -1.0)
    a, b, ab = (estimate_of("mean", some, **dealt).half_width ** 2 for some in (one, other, one - other))
    # (ratio - r)² ≤ a - (a + b - ab) r + b r²
    square, half, constant = 1.0 - b, ratio - 0.5 * (a + b - ab), ratio**2 - a
    root = math.sqrt(max(0.0, half**2 - square * constant))
    if square <= 0.0:
        return max(0.0, (half - root) / square) if constant > 0.0 and square < 0.0 else 0.0, math.nan
    return max(0.0, (half - root) / square), (half + root) / square


def ratio_numbers(numbers: Array, reference: Array, ratio: float) -> Array:
    """Numbers of the shots whose mean is the ratio of two means, with its error to first order (the delta method).

    Number k of the reference belongs to shot k. If the reference has fewer numbers, each of them has a larger weight.
    """
    mean, weight = np.nanmean(reference), np.isfinite(numbers).sum() / np.isfinite(reference).sum()
    linear = numbers / mean
    linear[: len(reference)] -= np.nan_to_num(ratio * weight * (reference / mean - 1.0))
    return linear
