"""Draws of a result: in each, every hit that is drawn ends in one way, by all that is known (docs/continuum.md).

A measure of a result is that measure of each draw; its value is the mean, its interval the quantiles. Each draw counts
its hits as often as a sample of the same size has them, so that the interval holds the error of the sample, too.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.special import ndtri

from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import DRAWS, Result, as_dataset, as_tree
from warpimpact.measures.vocabulary import Array
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.statistics.intervals import WORST, Estimate

COUNT = 128
"""Number of draws of a map, and most of its hits that are in all of them."""
SEED = 67
"""Of all draws, which have the same bits each time."""
_SEED = 68
"""Of the samples of hits, which are alike in all results with as many hits."""
_PRIOR = 0.5
"""Shots on either side that a share counts beside its own, as a prior of Jeffreys has them."""
_NORMAL = NormalDist()


@dataclass(frozen=True)
class Draws:
    """Draws of a result, one after the other.

    Attributes:
        every: variables of all draws along "hit", shape [draws · hits], and the inputs of their hits.
        count, hits: numbers of draws, and of hits in each.
        seed: of what belongs to this result alone.
    """

    every: xarray.Dataset
    count: int
    hits: int
    seed: int

    @classmethod
    def of(cls, result: Result) -> Draws | None:
        """The draws of the hits that a result has; None without any."""
        node, dataset = as_tree(result).children.get(DRAWS), as_dataset(result)
        if node is None:
            return None
        stored = node.to_dataset(inherit=False)
        if stored[v.STATUS].dims != (v.DRAW, v.DRAWN_HIT):  # of joined results
            return None
        numbers, known = hit_numbers(dataset), stored[v.DRAWN_HIT].values
        places, order = np.flatnonzero(np.isin(numbers, known)), np.argsort(known)
        if not len(places):
            return None
        own = order[np.searchsorted(known, numbers[places], sorter=order)]
        count, hits = stored.sizes[v.DRAW], len(places)
        rows = dataset.isel(hit=np.tile(places, count)).drop_vars([v.HIT, *stored.data_vars], errors="ignore")
        columns = {}
        for name, column in stored.isel({v.DRAWN_HIT: own}).data_vars.items():
            values = column.values.reshape(count * hits, *column.shape[2:])
            columns[str(name)] = (v.HIT, *column.dims[2:]), values, column.attrs
        seed = zlib.crc32(str(dataset.attrs.get(attr.CAMPAIGN, "")).encode())
        return cls(rows.assign(columns).assign_coords(hit=np.arange(count * hits)), count, hits, seed)

    def by_hit(self, measure: Measure) -> Array:
        """The values of a measure of all hits, shape [draws, hits]; NaN where a hit does not count."""
        return self.shaped(measure.values(self.every))

    def shaped(self, values: Array) -> Array:
        """Values along the hits of all draws in the shape [draws, hits]."""
        return values.reshape(self.count, self.hits)

    def numbers(self, measure: Measure, values: Array | None = None) -> tuple[Array, Array]:
        """The measure of each draw, of its hits and of a sample of them, shape [draws] each; in its display unit.

        Args:
            values: as `by_hit` gives them.
        """
        values = self.by_hit(measure) if values is None else values
        sampled = np.take_along_axis(values, self._samples, axis=1)
        own, of_samples = statistic(measure, values), statistic(measure, sampled)
        if measure.is_binary:
            of_samples = self._with_prior(of_samples)
        return measure.display.factor * own, measure.display.factor * of_samples

    def estimate(self, measure: Measure, confidence: float = 0.95, values: Array | None = None) -> Estimate:
        """A measure with its interval, in its display unit; arguments as in `numbers`."""
        values = self.by_hit(measure) if values is None else values
        counted = np.isfinite(values)
        count = round(float(counted.sum(axis=1).mean()))
        spread = measure.display.factor * float(np.std(values[counted])) if counted.any() else math.nan
        return estimate_of_draws(*self.numbers(measure, values), confidence, count=count, spread=spread)

    @property
    def _samples(self) -> NDArray[np.int64]:
        """Places of the hits that each draw counts, shape [draws, hits]."""
        return np.random.default_rng([_SEED, self.hits]).integers(self.hits, size=(self.count, self.hits))

    def _with_prior(self, shares: Array) -> Array:
        """Shares with what so few hits leave open, also where all of them agree; one hit may stand for all."""
        more, fewer = np.random.default_rng([_SEED, self.seed]).gamma(_PRIOR, size=(2, self.count))
        hits = max(self.hits, self.count)
        return np.asarray((hits * shares + more) / (hits + more + fewer))


def standard_normals(name: str) -> Array:
    """Numbers of all draws that belong to a name, shape [COUNT]; the middles of even shares in a random order."""
    even = ndtri((np.arange(COUNT) + 0.5) / COUNT)
    return np.random.default_rng([SEED, zlib.crc32(name.encode())]).permutation(even)


def statistic(measure: Measure, values: Array) -> Array:
    """A measure of rows of values, shape [rows] of [rows, hits]; NaN where no hit counts."""
    known = np.isfinite(values) if measure.kind != "quantile" else ~np.isnan(values)
    result = np.full(len(values), np.nan)
    for row in np.flatnonzero(known.any(axis=1)):
        of_row = values[row][known[row]]
        if measure.kind == "worst_tenth":
            worst = np.sort(measure.worse * of_row)[::-1]
            result[row] = measure.worse * _mean_of_first(worst, WORST * len(worst))
        elif measure.kind == "worst_point":
            result[row] = measure.worse * np.max(measure.worse * of_row)
        elif measure.kind == "quantile":
            result[row] = np.quantile(of_row, measure.share)
        else:
            result[row] = of_row.mean()
    return result


def _mean_of_first(numbers: Array, count: float) -> float:
    """Mean of the first numbers, of which the last one may count in part."""
    weights = np.clip(count - np.arange(len(numbers)), 0.0, 1.0)
    return float(weights @ numbers / weights.sum())


def ends_of_draws(values: Array, inner: float = 0.95, axis: int | None = None) -> Array:
    """Ends of an interval that holds one more number like the drawn ones with probability `inner`; NaN is left out.

    The k-th of m ordered draws has a share of k / (m + 1) below it (E. J. Gumbel, Statistics of Extremes, 1958), which
    widens the interval of few draws.
    """
    tail = 0.5 - 0.5 * inner
    return np.asarray(np.nanquantile(values, [tail, 1.0 - tail], axis=axis, method="weibull"))


def estimate_of_draws(
    own: Array, sampled: Array, confidence: float = 0.95, *, count: int = 0, spread: float = math.nan
) -> Estimate:
    """A number with its interval, from its values in all draws: their mean, and quantiles of those of the samples.

    Beyond 95 % the ends follow from those at 95 % as those of a normal distribution do.
    """
    known = own[np.isfinite(own)]
    if not len(known):
        return Estimate()
    value = float(known.mean())
    inner = min(confidence, 0.95)
    ends = ends_of_draws(sampled, inner)
    wider = _NORMAL.inv_cdf(0.5 + 0.5 * confidence) / _NORMAL.inv_cdf(0.5 + 0.5 * inner)
    low, high = (
        value + wider * (np.minimum(ends[0], value) - value),
        value + wider * (np.maximum(ends[1], value) - value),
    )
    return Estimate(value, float(low), float(high), count, spread)


def difference_of_draws(
    one: tuple[Array, Array], other: tuple[Array, Array], confidence: float = 0.95, *, paired: bool = True
) -> Estimate:
    """The difference of a measure of two results, from `Draws.numbers` of both.

    Args:
        paired: whether hits and materials of a draw are the same in both; else the samples of hits are others.
    """
    return estimate_of_draws(one[0] - other[0], one[1] - (other[1] if paired else np.roll(other[1], 1)), confidence)
