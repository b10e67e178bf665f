"""True means of groups of shots, from a few noisy numbers per group: the share that is positive, and an interval.

A group is one of several equally probable sets of parameters; its numbers are those of the shots with these parameters.
The variance between groups is the variance of the sample means minus the part that the scatter within groups explains
(analysis of variance with random effects: S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, 1992, chapter
3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array

FEWEST_GROUPS = 8
"""Fewest groups with two numbers or more."""
_FEWEST_FREE = 3.0
"""Degrees of freedom of the variance between groups where the scatter within groups nearly hides it."""


class Positive(NamedTuple):
    """Share of the groups with a positive true mean, and the lower end of its one-sided interval."""

    share: float
    at_least: float


class _Groups(NamedTuple):
    """Groups with two numbers or more, and the mean over all numbers.

    Attributes:
        centre: mean over all numbers.
        means: sample means of the groups, shape [groups].
        noises: variances of these means by the scatter within groups, shape [groups].
        centre_by_between: variance of `centre` per variance between groups.
        centre_by_noise: variance of `centre` by the scatter within groups.
    """

    centre: float
    means: Array
    noises: Array
    centre_by_between: float
    centre_by_noise: float


def positive_share(
    numbers: Array, groups: NDArray[np.number], *, images: int = 1, confidence: float = 0.95
) -> Positive | None:
    """Share of the groups with a positive true mean; None if fewer than `FEWEST_GROUPS` groups have two numbers.

    The true mean of a group has a normal distribution about its sample mean, which is shrunk towards the mean over all
    (empirical Bayes). The lower end assumes normally distributed true means, with mean and variance at the unfavourable
    ends of their joint intervals (Bonferroni), because few groups cannot exclude a rare group far below 0.

    Args:
        numbers: shape [shots]; NaN marks a shot that does not count.
        groups: group of each shot, same shape.
        images: number of consecutive shots that are images of each other; together they count as one.
    """
    from scipy.special import chdtri, ndtr, stdtrit

    sample = _grouped(numbers, groups, images)
    count, tail = len(sample.means), 0.5 * (1.0 - confidence)
    if count < FEWEST_GROUPS:
        return None
    whole, noise = float(sample.means.var(ddof=1)), float(sample.noises.mean())
    free = count - 1.0
    largest = max(0.0, whole * free / float(chdtri(free, 1.0 - tail)) - noise)
    error = math.sqrt(largest * sample.centre_by_between + sample.centre_by_noise)
    lowest = sample.centre + float(stdtrit(free, tail)) * error
    share = float(np.mean(_positive_probability(*_true_means(sample, max(0.0, whole - noise)))))
    at_least = float(ndtr(lowest / math.sqrt(largest))) if largest > 0.0 else float(lowest > 0.0)
    return Positive(share, min(share, at_least))


def interval_of_means(
    numbers: Array, groups: NDArray[np.number], *, images: int = 1, confidence: float = 0.95, beside: float = 0.0
) -> tuple[float, float]:
    """Interval that contains this share of the true means; NaN if fewer than `FEWEST_GROUPS` groups have two numbers.

    Sample means scatter more than true means. They are shrunk to the variance of the true means (T. A. Louis, Journal
    of the American Statistical Association 79 (1984) 393). Student's quantile replaces the normal one to allow for the
    error of that variance, with the degrees of freedom of F. E. Satterthwaite, Biometrics Bulletin 2 (1946) 110.

    The arguments are those of `positive_share`, and the standard deviation of an independent error that adds to every
    true mean.
    """
    from scipy.special import ndtri, stdtrit

    sample = _grouped(numbers, groups, images)
    if len(sample.means) < FEWEST_GROUPS:
        return math.nan, math.nan
    whole, noise = float(sample.means.var(ddof=1)), float(sample.noises.mean())
    count, tail = len(sample.means), 0.5 * (1.0 - confidence)
    share = max(0.0, whole - noise) / whole if whole > 0.0 else 0.0
    free = max(_FEWEST_FREE, (count - 1) * share**2)
    stretch = float(stdtrit(free, tail) / ndtri(tail)) * math.sqrt(1.0 + 1.0 / count)
    means = sample.centre + stretch * math.sqrt(share) * (sample.means - sample.means.mean())
    spread = beside * ndtri((np.arange(64) + 0.5) / 64) if beside > 0.0 else np.zeros(1)
    low, high = np.quantile(np.add.outer(means, spread), [tail, 1.0 - tail], method="hazen")
    return float(low), float(high)


def _grouped(numbers: Array, groups: NDArray[np.number], images: int) -> _Groups:
    """The groups of the numbers. A group of one number counts in the mean over all only."""
    known = ~np.isnan(numbers)
    shots, shot_of = np.unique(np.flatnonzero(known) // images, return_inverse=True)
    values = np.bincount(shot_of, numbers[known]) / np.bincount(shot_of)
    _, group_of = np.unique(groups[shots * images], return_inverse=True)
    counts = np.bincount(group_of)
    means = np.bincount(group_of, values) / counts
    several = counts >= 2
    if not several.any():
        return _Groups(math.nan, np.empty(0), np.empty(0), math.nan, math.nan)
    scatter = float(np.square(values - means[group_of]).sum()) / float((counts[several] - 1).sum())
    total = float(counts.sum())
    return _Groups(
        float(values.mean()),
        means[several],
        scatter / counts[several],
        float(np.square(counts / total).sum()),
        scatter / total,
    )


def _true_means(groups: _Groups, between: float) -> tuple[Array, Array]:
    """Mean and standard deviation of every group's true mean, shape [groups] each."""
    sums = between + groups.noises
    shrunk = np.divide(between, sums, out=np.zeros_like(sums), where=sums > 0.0)
    return groups.centre + shrunk * (groups.means - groups.centre), np.sqrt(shrunk * groups.noises)


def _positive_probability(means: Array, deviations: Array) -> Array:
    """Probability that a normally distributed number is positive; the shape is that of the arguments."""
    from scipy.special import ndtr

    certain = deviations == 0.0
    return np.where(certain, means > 0.0, ndtr(means / np.where(certain, 1.0, deviations)))
