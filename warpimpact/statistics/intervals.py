"""Confidence intervals of means, shares, quantiles and differences of shares over shots.

For independent shots, a mean has Student's interval, a share Wilson's, and a quantile that of the order statistics. A
difference of two shares of the same shots has the interval of Agresti and Min (Statistics in Medicine 24 (2005) 729).
Sobol points are not independent. They are dealt to independent scramblings, the replicates, and Student's interval over
the results of the replicates is used (A. B. Owen, Monte Carlo theory, methods and examples, chapter 17).

Worst tenths and quantiles are means of numbers of the shots, so that they have the intervals of means.

Over independent shots, the mean of the worst tenth is the smallest mean of q + (x − q)₊ / 0.1 over q, where q is the
quantile of 0.9 (R. T. Rockafellar and S. Uryasev, Journal of Risk 2 (2000) 21). At the minimum an error of q has no
effect to first order, so the interval is that of this mean at the sample's q.

A quantile is a weighted sum of the ordered numbers with the smooth weights of F. E. Harrell and C. E. Davis, Biometrika
69 (1982) 635. The numbers of the shots are the pseudo-values of the jackknife (J. W. Tukey, Annals of Mathematical
Statistics 29 (1958) 614): n times the sum of all n, minus n − 1 times the sum without the shot. Their scatter gives the
error of the quantile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any, Self, TypedDict

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
        numerics: largest shift of the number by the numerics, to either side; NaN if it is not known.
    """

    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    count: int = 0
    spread: float = math.nan
    numerics: float = math.nan

    @property
    def half_width(self) -> float:
        """Half of the interval's length."""
        return 0.5 * (self.high - self.low)

    def times(self, factor: float) -> Estimate:
        """The estimate in another unit."""
        value, low, high, spread = (factor * number for number in (self.value, self.low, self.high, self.spread))
        return Estimate(value, low, high, self.count, spread, factor * self.numerics)

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


ANY_NUMBER = (-math.inf, math.inf)
"""Bounds of numbers that have none."""


def estimate_of(
    kind: str,
    values: Array,
    *,
    share: float = 0.5,
    bounds: tuple[float, float] = ANY_NUMBER,
    replicates: int = 1,
    confidence: float = 0.95,
) -> Estimate:
    """Estimate from the numbers of all shots.

    Args:
        kind: "mean", "quantile", "share" (of numbers 0 or 1) or "difference" (of two shares, numbers −1, 0 or 1).
        values: in the order of the shots, which belong to the replicates in turn; NaN where a shot does not count.
        share: of the numbers below a quantile.
        bounds: least and largest possible number. A mean of equal numbers is exact only where they are no bound.
        replicates: number of independent scramblings; 1 for independent shots.
        confidence: of the interval.
    """
    known = ~np.isnan(values)
    counted, replicate = values[known], (np.arange(len(values)) % replicates)[known]
    if not len(counted):
        return Estimate()
    value = _quantile(counted, share) if kind == "quantile" else float(counted.mean())
    interval = (math.nan, math.nan)
    if len(counted) >= FEWEST and kind == "mean" and np.ptp(counted) == 0.0:
        interval = ends_at_bound(value, float(wilson(0, len(counted), confidence)[1]), bounds)
    elif len(counted) >= FEWEST:
        groups = [group for k in range(replicates) if len(group := counted[replicate == k])]
        of_replicates = _of_replicates(kind, groups, counted, value, share, confidence)
        interval = of_replicates or _independent(kind, counted, share, confidence)
    return Estimate(value, *interval, len(counted), float(counted.std()))


def ends_at_bound(value: float, share: float, bounds: tuple[float, float]) -> tuple[float, float]:
    """Interval of a mean whose numbers all are the value, where this share of the shots may have any other number.

    Only numbers at a bound leave that open, as where all cores are stopped; others are the same shot again and again.
    An end is NaN where the numbers have no bound on its side.
    """
    least, most = bounds
    low = value - share * (value - least) if value == most else value
    high = value + share * (most - value) if value == least else value
    return (low if math.isfinite(low) else math.nan, high if math.isfinite(high) else math.nan)


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
    half = student_quantile(confidence, len(results) - 1) / math.sqrt(len(results)) * float(np.std(results, ddof=1))
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
        low, high = wilson(round(total), count, confidence)
        return float(low), float(high)
    if kind == "difference":
        # Agresti and Min's interval, which adds half a shot to each cell of the 2 × 2 table.
        padded, discordant = count + 2, float(np.square(values).sum())
        error = math.sqrt(discordant + 1.0 - total**2 / padded) / padded
        half = NormalDist().inv_cdf(0.5 * (1.0 + confidence)) * error
        return max(-1.0, total / padded - half), min(1.0, total / padded + half)
    half = student_quantile(confidence, count - 1) / math.sqrt(count) * float(values.std(ddof=1))
    return total / count - half, total / count + half


def _quantile(values: Array, share: float) -> float:
    """The value that exceeds this share of the numbers."""
    return float(np.quantile(values, share))


def student_quantile(confidence: float, freedom: int) -> float:
    """Half width of an interval in standard errors, by Student's distribution."""
    return float(special.stdtrit(freedom, 0.5 * (1.0 + confidence)))


def wilson(successes: Any, count: int, confidence: float) -> tuple[Any, Any]:
    """Wilson's interval of shares, from numbers of successes among `count` independent shots."""
    quantile = NormalDist().inv_cdf(0.5 * (1.0 + confidence))
    share, padded = successes / count, count + quantile**2
    middle = (successes + 0.5 * quantile**2) / padded
    half = quantile * np.sqrt(count * share * (1.0 - share) + 0.25 * quantile**2) / padded
    return np.where(successes > 0, middle - half, 0.0), np.where(successes < count, middle + half, 1.0)


EVEN = (np.arange(41) + 0.5) / 41
"""Equally probable quantiles of a factor, by which a share is averaged over it."""


def with_common_factor(
    estimate: Estimate, number_at: Callable[[float], float], deviation: float, *, is_share: bool = False
) -> Estimate:
    """An estimate from shots whose values all have one unknown factor, lognormal around 1.

    A share becomes its mean over the factor. The error of the factor and that of the sample are independent.

    Args:
        number_at: the number if the values have this factor.
        deviation: standard deviation of the logarithm of the factor.
    """
    if not (deviation and math.isfinite(estimate.value)):
        return estimate
    ends = NormalDist().inv_cdf(0.975) * deviation
    low, high = sorted(number_at(math.exp(end)) for end in (-ends, ends))
    value = estimate.value
    if is_share:
        value = float(np.mean([number_at(float(factor)) for factor in np.exp(deviation * special.ndtri(EVEN))]))
    below, above = np.nan_to_num([estimate.value - estimate.low, estimate.high - estimate.value])
    low, high = value - math.hypot(value - low, below), value + math.hypot(high - value, above)
    wider = replace(estimate, value=value, low=low, high=high)
    return wider.within(0.0, 1.0) if is_share else wider


WORST = 0.1
"""Share of the shots that is the worst tenth."""
_FEWEST_WORST = 40
"""Fewest independent shots in the worst tenth for an interval that holds with its stated confidence."""
FEWEST_SHOTS = 16
"""Fewest shots that have a quantile by pseudo-values."""


def worst_tenth(values: Array) -> Array:
    """Numbers whose mean is that of the largest tenth of the values; same shape, NaN stays NaN."""
    known = values[~np.isnan(values)]
    if not len(known):
        return values
    start = float(np.quantile(known, 1.0 - WORST, method="inverted_cdf"))
    return start + np.maximum(values - start, 0.0) / WORST


def has_interval(count: int) -> bool:
    """Whether `count` shots suffice for an interval of the worst tenth."""
    return count * WORST >= _FEWEST_WORST


def pseudo_values(numbers: Array, share: float) -> Array:
    """Numbers of shots whose mean is the quantile that exceeds this share of them, same shape; NaN for fewer than
    `FEWEST_SHOTS`.

    NaN marks a shot that does not count and stays NaN. Infinite numbers count as the finite extreme.
    """
    finite, known = numbers[np.isfinite(numbers)], np.flatnonzero(~np.isnan(numbers))
    pseudo, count = np.full(len(numbers), np.nan), len(known)
    if len(finite) and count >= FEWEST_SHOTS:
        values = np.clip(numbers[known], finite.min(), finite.max())
        order, fewer = np.argsort(values, kind="stable"), _weights(count - 1, share)
        ordered = values[order]
        below = np.concatenate([[0.0], np.cumsum(fewer * ordered[:-1])])  # smaller numbers keep their ranks
        above = np.concatenate([np.cumsum((fewer * ordered[1:])[::-1])[::-1], [0.0]])
        pseudo[known[order]] = count * float(_weights(count, share) @ ordered) - (count - 1) * (below + above)
    return pseudo


def _weights(count: int, share: float) -> Array:
    """Weights of ordered numbers in a quantile, shape [count]; their sum is 1."""
    ends = np.arange(count + 1) / count
    return np.asarray(np.diff(special.betainc((count + 1) * share, (count + 1) * (1.0 - share), ends)))
