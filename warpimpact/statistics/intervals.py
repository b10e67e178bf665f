"""Confidence intervals of means, shares, quantiles and differences of shares over shots.

For independent shots, a mean has Student's interval, a share Wilson's, and a quantile that of the order statistics. A
difference of two shares of the same shots has the interval of Agresti and Min (Statistics in Medicine 24 (2005) 729).
Sobol points are not independent. They are dealt to independent scramblings, the replicates, and Student's interval over
the results of the replicates is used (A. B. Owen, Monte Carlo theory, methods and examples, chapter 17).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Self, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

Array = NDArray[np.float64]


FEWEST = 3
"""Fewest shots whose interval is determined. That of two is as wide as a guess, but looks like a result."""


@dataclass(frozen=True)
class Estimate:
    """A number with its interval; NaN where there is none.

    Attributes:
        count: number of shots that count.
        spread: standard deviation over these shots.
        numerics: largest shift of the number by the numerics, to either side; None or NaN if it is not known.
    """

    value: float
    low: float
    high: float
    count: int
    spread: float
    numerics: float | None = None

    @property
    def half_width(self) -> float:
        """Half of the interval's length."""
        return 0.5 * (self.high - self.low)

    def times(self, factor: float) -> Self:
        """The estimate in another unit."""
        value, low, high, spread = (factor * number for number in (self.value, self.low, self.high, self.spread))
        numerics = None if self.numerics is None else factor * self.numerics
        scaled = replace(self, numerics=numerics)
        return replace(scaled, value=value, low=low, high=high, spread=spread)

    def within(self, least: float, most: float = math.inf) -> Self:
        """The estimate with the ends of its intervals limited to a range."""
        low, high = (end if math.isnan(end) else min(max(end, least), most) for end in (self.low, self.high))
        return replace(self, low=low, high=high)


class SamplingDesign(TypedDict, total=False):
    """Arguments of `estimate_of` by which shots were sampled."""

    replicates: int
    confidence: float


def looks(sampling: str, shards: int) -> Iterator[int]:
    """Numbers of shards after which a stop rule checks its interval.

    Checks are few, because the spread may be small by accident at any of them. Sobol points are balanced at powers of
    two.
    """
    count = 1
    while count < shards:
        yield count
        count = 2 * count if sampling == "sobol" else max(count + 1, math.ceil(1.25 * count))
    yield shards


def estimate_of(
    kind: str, values: Array, *, share: float = 0.5, replicates: int = 1, confidence: float = 0.95
) -> Estimate:
    """Estimate from the numbers of all shots.

    Args:
        kind: "mean", "quantile", "share" (of numbers 0 or 1) or "difference" (of two shares, numbers −1, 0 or 1).
        values: in the order of the shots, which belong to the replicates in turn; NaN where a shot does not count.
        share: of the numbers below a quantile.
        replicates: number of independent scramblings; 1 for independent shots.
        confidence: of the interval.
    """
    known = ~np.isnan(values)
    counted, replicate = values[known], (np.arange(len(values)) % replicates)[known]
    if not len(counted):
        return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
    value = _quantile(counted, share) if kind == "quantile" else float(counted.mean())
    interval = (math.nan, math.nan)
    if len(counted) >= FEWEST:
        groups = [group for k in range(replicates) if len(group := counted[replicate == k])]
        of_replicates = _of_replicates(kind, groups, counted, value, share, confidence)
        interval = of_replicates or _independent(kind, counted, share, confidence)
    return Estimate(value, *interval, len(counted), float(counted.std()))


class RunningSums:
    """Sums over shots that give a mean, or a share, its interval; their memory does not grow with the shots."""

    def __init__(self, replicates: int = 1, confidence: float = 0.95) -> None:
        """No shots yet; arguments as in `estimate_of`."""
        self._confidence, self._shots, self._origin = confidence, 0, math.nan
        self._count, self._total, self._squares = np.zeros((3, replicates))

    def add(self, values: Array) -> None:
        """Add the numbers of the next shots; NaN where a shot does not count."""
        replicates, known = len(self._count), ~np.isnan(values)
        replicate = ((self._shots + np.arange(len(values))) % replicates)[known]
        self._shots += len(values)
        if math.isnan(self._origin) and len(replicate):
            self._origin = float(values[known][0])  # squares of differences lose fewer digits
        moved = values[known] - self._origin
        for sums, weights in ((self._count, None), (self._total, moved), (self._squares, moved**2)):
            sums += np.bincount(replicate, weights, replicates)

    def estimate(self, kind: str) -> Estimate:
        """The estimate of a "mean" or a "share", as `estimate_of` gives it of all numbers."""
        count, filled = round(self._count.sum()), self._count > 0
        if not count:
            return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
        mean = self._total.sum() / count
        value, results = float(self._origin + mean), self._total[filled] / self._count[filled]
        spread = math.sqrt(max(0.0, self._squares.sum() / count - mean**2))
        half = _student(self._confidence, len(results)) * float(np.std(results, ddof=1)) if len(results) > 1 else 0.0
        if count < FEWEST:
            low = high = math.nan
        elif 1 < len(results) < count and (half > 0.0 or kind == "mean"):
            low, high = value - half, value + half
        elif kind == "share":
            return Estimate(value, *_wilson(round(value * count), count, self._confidence), count, spread)
        else:
            half = _student(self._confidence, count) * spread * math.sqrt(count / (count - 1))
            low, high = value - half, value + half
        estimate = Estimate(value, low, high, count, spread)
        return estimate.within(0.0, 1.0) if kind == "share" else estimate


def _of_replicates(
    kind: str, groups: Sequence[Array], values: Array, value: float, share: float, confidence: float
) -> tuple[float, float] | None:
    """Interval from the spread of the replicates; None if it does not give one.

    A quantile has Woodruff's interval: the replicates give the uncertainty of the share below it (R. S. Woodruff,
    Journal of the American Statistical Association 47 (1952) 635). Quantiles of single replicates would be biased.
    """
    if len(groups) < 2 or all(len(group) == 1 for group in groups):  # independent shots
        return None
    results = [float((group <= value).mean() if kind == "quantile" else group.mean()) for group in groups]
    half = _student(confidence, len(results)) * float(np.std(results, ddof=1))
    # Equal shares in all replicates (usually 0) do not show the uncertainty.
    if half == 0.0 and kind != "mean":
        return None
    if kind == "share":
        return max(0.0, value - half), min(1.0, value + half)
    if kind != "quantile":
        return value - half, value + half
    low, high = (_quantile(values, end) if 0.0 < end < 1.0 else math.nan for end in (share - half, share + half))
    return low, high


def _independent(kind: str, values: Array, share: float, confidence: float) -> tuple[float, float]:
    """Interval for independent shots."""
    count, total = len(values), float(values.sum())
    if kind == "quantile":
        tail = 0.5 * (1.0 - confidence)
        ends = stats.binom.ppf([tail, 1.0 - tail], count, share).astype(int)
        ordered, low, high = np.sort(values), ends[0] - 1, ends[1]
        return (float(ordered[low]) if low >= 0 else math.nan, float(ordered[high]) if high < count else math.nan)
    if kind == "share":
        return _wilson(round(total), count, confidence)
    if kind == "difference":
        return _matched(total, float(np.square(values).sum()), count, confidence)
    half = _student(confidence, count) * float(values.std(ddof=1))
    return total / count - half, total / count + half


def _quantile(values: Array, share: float) -> float:
    """The value that exceeds this share of the numbers."""
    return float(np.quantile(values, share, method="hazen"))


def _student(confidence: float, count: int) -> float:
    """Half width of the interval of a mean of `count` numbers, in standard deviations."""
    return float(special.stdtrit(count - 1, 0.5 * (1.0 + confidence))) / math.sqrt(count)


def _wilson(successes: int, count: int, confidence: float) -> tuple[float, float]:
    """Wilson's interval of a share."""
    quantile = NormalDist().inv_cdf(0.5 * (1.0 + confidence))
    share, padded = successes / count, count + quantile**2
    middle = (successes + 0.5 * quantile**2) / padded
    half = quantile * math.sqrt(count * share * (1.0 - share) + 0.25 * quantile**2) / padded
    return (middle - half if successes else 0.0), (middle + half if successes < count else 1.0)


def _matched(difference: float, discordant: float, count: int, confidence: float) -> tuple[float, float]:
    """Agresti and Min's interval, which adds half a shot to each cell of the 2 × 2 table."""
    padded = count + 2
    error = math.sqrt(discordant + 1.0 - difference**2 / padded) / padded
    half = NormalDist().inv_cdf(0.5 * (1.0 + confidence)) * error
    return max(-1.0, difference / padded - half), min(1.0, difference / padded + half)
