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
from typing import Self, TypedDict, Unpack

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


class Estimating(TypedDict, total=False):
    """Arguments of `Dealt` after the kind."""

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


def estimate_of(kind: str, values: Array, *, share: float = 0.5, **dealt: Unpack[Estimating]) -> Estimate:
    """Estimate from the numbers of all shots, NaN where a shot does not count. The arguments are those of `Dealt`."""
    sample = Dealt(kind, share=share, **dealt)
    sample.add(values)
    return sample.estimate()


class Dealt:
    """Numbers of shots, in the order of the shots, dealt to the replicates of the sampling in turn.

    Args:
        kind: "mean", "quantile", "share" (of numbers 0 or 1) or "difference" (of two shares, numbers −1, 0 or 1).
        share: of the numbers below a quantile.
        replicates: number of independent scramblings; 1 for independent shots.
        confidence: of the interval.
    """

    def __init__(self, kind: str, *, share: float = 0.5, replicates: int = 1, confidence: float = 0.95) -> None:
        self._kind, self._share, self._confidence = kind, share, confidence
        self._replicates = [_Sample(keeps=kind == "quantile") for _ in range(replicates)]
        self._shots = 0

    def add(self, values: Array) -> None:
        """Add the numbers of the next shots, shape [shots]; NaN marks a shot that does not count."""
        replicates = len(self._replicates)
        dealt_to = (self._shots + np.arange(len(values))) % replicates
        for replicate, sample in enumerate(self._replicates):
            sample.add(values[(dealt_to == replicate) & ~np.isnan(values)])
        self._shots += len(values)

    def estimate(self) -> Estimate:
        """The estimate from the shots so far."""
        pooled = _Sample.pooled(self._replicates)
        if pooled.count == 0:
            return Estimate(math.nan, math.nan, math.nan, 0, math.nan)
        value = pooled.quantile(self._share) if self._kind == "quantile" else pooled.mean
        if pooled.count < FEWEST:
            return Estimate(value, math.nan, math.nan, pooled.count, pooled.deviation)
        interval = self._of_replicates(pooled, value) or self._independent(pooled)
        return Estimate(value, *interval, pooled.count, pooled.deviation)

    def _of_replicates(self, pooled: _Sample, value: float) -> tuple[float, float] | None:
        """Interval from the spread of the replicates; None if it does not give one.

        A quantile has Woodruff's interval: the replicates give the uncertainty of the share below it (R. S. Woodruff,
        Journal of the American Statistical Association 47 (1952) 635). Quantiles of single replicates would be biased.
        """
        replicates = [sample for sample in self._replicates if sample.count]
        if len(replicates) < 2 or all(sample.count == 1 for sample in replicates):  # independent shots
            return None
        quantile = self._kind == "quantile"
        results = [float((sample.values <= value).mean()) if quantile else sample.mean for sample in replicates]
        half = _student(self._confidence, len(results)) * float(np.std(results, ddof=1))
        # Equal shares in all replicates (usually 0) do not show the uncertainty.
        if half == 0.0 and self._kind != "mean":
            return None
        if self._kind == "share":
            return max(0.0, value - half), min(1.0, value + half)
        if not quantile:
            return value - half, value + half
        ends = (self._share - half, self._share + half)
        low, high = (pooled.quantile(end) if 0.0 < end < 1.0 else math.nan for end in ends)
        return low, high

    def _independent(self, sample: _Sample) -> tuple[float, float]:
        """Interval for independent shots."""
        count = sample.count
        if self._kind == "quantile":
            tail = 0.5 * (1.0 - self._confidence)
            ends = stats.binom.ppf([tail, 1.0 - tail], count, self._share).astype(int)
            ordered = np.sort(sample.values)
            low, high = ends[0] - 1, ends[1]
            return (float(ordered[low]) if low >= 0 else math.nan, float(ordered[high]) if high < count else math.nan)
        if self._kind == "share":
            return _wilson(round(sample.mean * count), count, self._confidence)
        if self._kind == "difference":
            return _matched(sample, count, self._confidence)
        unbiased = sample.deviation * math.sqrt(count / (count - 1))
        half = _student(self._confidence, count) * unbiased
        return sample.mean - half, sample.mean + half


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


def _matched(sample: _Sample, count: int, confidence: float) -> tuple[float, float]:
    """Agresti and Min's interval, which adds half a shot to each cell of the 2 × 2 table."""
    difference = sample.mean * count
    discordant = (sample.deviation**2 + sample.mean**2) * count
    padded = count + 2
    error = math.sqrt(discordant + 1.0 - difference**2 / padded) / padded
    half = NormalDist().inv_cdf(0.5 * (1.0 + confidence)) * error
    return max(-1.0, difference / padded - half), min(1.0, difference / padded + half)


class _Sample:
    """Count, mean and sum of squared deviations of numbers. With `keeps` it keeps the numbers, too."""

    def __init__(self, *, keeps: bool) -> None:
        self.count, self.mean, self._squares = 0, 0.0, 0.0
        self._kept: list[Array] | None = [] if keeps else None

    @classmethod
    def pooled(cls, samples: Sequence[_Sample]) -> _Sample:
        """The sample of all numbers."""
        if len(samples) == 1:
            return samples[0]
        whole = cls(keeps=samples[0]._kept is not None)
        for sample in samples:
            whole._merge(sample.count, sample.mean, sample._squares)
            if whole._kept is not None:
                whole._kept.append(sample.values)
        return whole

    def add(self, values: Array) -> None:
        """Add numbers; none may be NaN."""
        if len(values):
            mean = float(values.mean())
            self._merge(len(values), mean, float(np.square(values - mean).sum()))
            if self._kept is not None:
                self._kept.append(values)

    def _merge(self, count: int, mean: float, squares: float) -> None:
        """Add another sample (T. F. Chan, G. H. Golub, R. J. LeVeque, The American Statistician 37 (1983) 242)."""
        if count:
            total, difference = self.count + count, mean - self.mean
            self._squares += squares + difference * difference * self.count * count / total
            self.mean += difference * count / total
            self.count = total

    @property
    def deviation(self) -> float:
        """Standard deviation of the numbers themselves (ddof = 0)."""
        return math.sqrt(self._squares / self.count) if self.count else math.nan

    @property
    def values(self) -> Array:
        """The numbers, empty unless they are kept."""
        return np.concatenate(self._kept) if self._kept else np.empty(0)

    def quantile(self, share: float) -> float:
        """The value that exceeds this share of the numbers."""
        return float(np.quantile(self.values, share, method="hazen"))
