"""Means that differ from group to group, known by a few noisy numbers of each: how many of them are positive?

The groups are sets of parameters that are equally probable; the numbers of a group are those of the shots that had its
parameters. The variance between groups is that of their means less what the scatter within them explains (analysis of
variance with random effects: S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, 1992, chapter 3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array

FEWEST = 8
"""Groups with two numbers or more that are needed."""


_FEWEST_FREE = 3.0
"""Degrees of freedom of a variance that the scatter within groups nearly hides."""


class Positive(NamedTuple):
    """Share of the groups whose true mean is positive, and the lower end of its one-sided interval."""

    share: float
    at_least: float


class _Groups(NamedTuple):
    """Mean over all numbers, means of the groups and variances of these by the scatter within groups, shape [groups],
    and variance of the mean over all for a unit variance between groups and without one."""

    centre: float
    means: Array
    noises: Array
    of_between: float
    of_noise: float


def positive_share(
    numbers: Array, groups: NDArray[np.number], *, images: int = 1, confidence: float = 0.95
) -> Positive | None:
    """Share of the groups whose true mean is positive.

    Every true mean has a normal distribution about the mean of its group, shrunk towards the mean over all (empirical
    Bayes). The lower end takes the true means as normally distributed, with a mean and a variance at the
    unfavourable ends of their intervals, which hold together (Bonferroni). Few groups do not show that a rare one is
    far off on the other side.

    Args:
        numbers: shape [shots]; NaN where a shot does not count.
        groups: of the shots, same shape.
        images: how many shots in a row are images of each other; together they count as one.

    Returns:
        None if fewer than `FEWEST` groups have two numbers.
    """
    from scipy.special import chdtri, ndtr, stdtrit

    found = _grouped(numbers, groups, images)
    count, tail = len(found.means), 0.5 * (1.0 - confidence)
    if count < FEWEST:
        return None
    whole, noise = float(found.means.var(ddof=1)), float(found.noises.mean())
    free = count - 1.0
    largest = max(0.0, whole * free / float(chdtri(free, 1.0 - tail)) - noise)
    error = math.sqrt(largest * found.of_between + found.of_noise)
    lowest = found.centre + float(stdtrit(free, tail)) * error
    share = float(np.mean(_above(*_true_means(found, max(0.0, whole - noise)))))
    at_least = float(ndtr(lowest / math.sqrt(largest))) if largest > 0.0 else float(lowest > 0.0)
    return Positive(share, min(share, at_least))


def interval_of_means(
    numbers: Array, groups: NDArray[np.number], *, images: int = 1, confidence: float = 0.95, beside: float = 0.0
) -> tuple[float, float]:
    """Interval that contains the true means of so many of the groups; NaN if fewer than `FEWEST` groups have two
    numbers.

    The means of the groups scatter more than the true means. They are drawn together until they have the variance of
    these (T. A. Louis, Journal of the American Statistical Association 79 (1984) 393). Student's quantile in the place
    of the normal one allows for the error of that variance, with the degrees of freedom of F. E. Satterthwaite,
    Biometrics Bulletin 2 (1946) 110.

    Args:
        numbers, groups, images: as in `positive_share`.
        beside: standard deviation of something independent that adds to every true mean.
    """
    from scipy.special import ndtri, stdtrit

    found = _grouped(numbers, groups, images)
    if len(found.means) < FEWEST:
        return math.nan, math.nan
    whole, noise = float(found.means.var(ddof=1)), float(found.noises.mean())
    count, tail = len(found.means), 0.5 * (1.0 - confidence)
    share = max(0.0, whole - noise) / whole if whole > 0.0 else 0.0
    free = max(_FEWEST_FREE, (count - 1) * share**2)
    stretch = float(stdtrit(free, tail) / ndtri(tail)) * math.sqrt(1.0 + 1.0 / count)
    means = found.centre + stretch * math.sqrt(share) * (found.means - found.means.mean())
    spread = beside * ndtri((np.arange(64) + 0.5) / 64) if beside > 0.0 else np.zeros(1)
    low, high = np.quantile(np.add.outer(means, spread), [tail, 1.0 - tail], method="hazen")
    return float(low), float(high)


def _grouped(numbers: Array, groups: NDArray[np.number], images: int) -> _Groups:
    """The numbers by groups; groups of one number count for the mean over all alone."""
    known = ~np.isnan(numbers)
    shots, of_shot = np.unique(np.flatnonzero(known) // images, return_inverse=True)
    values = np.bincount(of_shot, numbers[known]) / np.bincount(of_shot)
    _, of = np.unique(groups[shots * images], return_inverse=True)
    counts = np.bincount(of)
    means = np.bincount(of, values) / counts
    several = counts >= 2
    if not several.any():
        return _Groups(math.nan, np.empty(0), np.empty(0), math.nan, math.nan)
    scatter = float(np.square(values - means[of]).sum()) / float((counts[several] - 1).sum())
    total = float(counts.sum())
    return _Groups(
        float(values.mean()),
        means[several],
        scatter / counts[several],
        float(np.square(counts / total).sum()),
        scatter / total,
    )


def _true_means(groups: _Groups, between: float) -> tuple[Array, Array]:
    """Mean and standard deviation of every group's true mean."""
    sums = between + groups.noises
    shrunk = np.divide(between, sums, out=np.zeros_like(sums), where=sums > 0.0)
    return groups.centre + shrunk * (groups.means - groups.centre), np.sqrt(shrunk * groups.noises)


def _above(means: Array, deviations: Array) -> Array:
    """Probabilities that normally distributed numbers are positive."""
    from scipy.special import ndtr

    certain = deviations == 0.0
    return np.where(certain, means > 0.0, ndtr(means / np.where(certain, 1.0, deviations)))
