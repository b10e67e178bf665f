"""Measures of a result as estimates: with intervals, shifts by the numerics, and the numbers of the shots."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray

from warpimpact.errors import ResultError
from warpimpact.measures.draws import Draws, statistic
from warpimpact.measures.hits import SLICE, failed, passed
from warpimpact.measures.measure import STATUSES, Measure, estimate_from, sampling_design, shift_of
from warpimpact.measures.references import Result, as_dataset, finer_pair
from warpimpact.measures.vocabulary import Array
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.statistics.intervals import Estimate, estimate_of, with_common_factor

SAME_ANGLE = 0.1
"""Difference of two angles that nobody would see [degree]."""
_LIMITS = tuple(names.value for names in v.LIMITS.values())


class Measured(NamedTuple):
    """A measure of a result, in its display unit.

    Attributes:
        values: of the shots, shape [hits]; NaN where a shot does not count.
        draws: the measure of each draw, of its hits and of a sample of them, shape [draws] each; None without draws.
    """

    measure: Measure
    estimate: Estimate
    values: Array
    draws: tuple[Array, Array] | None = None


def measure_data(result: Result, measures: Sequence[Measure], confidence: float = 0.95) -> Iterator[Measured]:
    """Measures of a result one after the other.

    Estimates are those of the draws of a result that has some. Of an open file, one slice at a time and one number per
    hit are in memory. A quantile of limits is infinite where it is the largest value tried.
    """
    pair, dataset, draws = finer_pair(result), as_dataset(result), Draws.of(result)
    design = sampling_design(dataset, confidence)
    highest = dataset.attrs.get(attr.LIMIT_HIGHEST, math.inf)
    key, by_hit = None, np.empty(0)
    for measure in measures:
        if key != (key := (measure.quantity, measure.standoff)):
            by_hit = by_hit_of(dataset, measure)
        values, factor = measure.counted(by_hit), measure.display.factor
        if draws is not None and measure.kind != "target":
            by_draw = draws.by_hit(measure)
            estimate = draws.estimate(measure, confidence, by_draw)
            estimate = replace(estimate, numerics=factor * shift_of(measure, pair, confidence))
            yield Measured(measure, estimate, factor * values, draws.numbers(measure, by_draw))
            continue
        estimate = replace(estimate_from(measure, values, **design), numerics=shift_of(measure, pair))
        if measure.name == v.LIMITS["velocity"].value and measure.has_interval:
            estimate = _with_material(measure, by_hit, estimate, dataset.attrs.get(attr.LIMIT_DEVIATION, 0.0))
        if measure.kind == "quantile" and measure.name in _LIMITS:
            ends = (estimate.value, estimate.low, estimate.high)
            value, low, high = (math.inf if end >= highest else end for end in ends)
            estimate = replace(estimate, value=value, low=low, high=high)
        yield Measured(measure, estimate.times(factor), factor * values)


def _with_material(measure: Measure, by_hit: Array, estimate: Estimate, deviation: float) -> Estimate:
    """A measure of limit velocities with the error of the material, which all of them share."""

    def number_at(factor: float) -> float:
        return float(statistic(measure, measure.counted(factor * by_hit)[None])[0])

    return with_common_factor(estimate, number_at, deviation, is_share=measure.is_binary)


def estimated(result: Result, measures: Sequence[Measure]) -> dict[Measure, Estimate]:
    """Measures of a result with their intervals, in their display units."""
    return {one.measure: one.estimate for one in measure_data(result, measures)}


def by_hit_of(dataset: xarray.Dataset, measure: Measure) -> Array:
    """The quantity of every hit, shape [hits]. Of an open file, one slice at a time is in memory."""
    return np.concatenate([measure.by_hit(part) for part in slices(dataset)])


def slices(dataset: xarray.Dataset) -> Iterator[xarray.Dataset]:
    """Its hits in slices, of which a variable is read when it is used."""
    for first in range(0, dataset.sizes["hit"], SLICE):
        yield dataset.isel(hit=slice(first, first + SLICE))


def passed_count(dataset: xarray.Dataset) -> int:
    """Number of cores that passed."""
    return sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]]))


def status_shares(result: Result) -> dict[str, Estimate]:
    """Shares of the shots by status, for the statuses that occur."""
    dataset, draws, share = as_dataset(result), Draws.of(result), Measure.parse("P(perforated)")
    if draws is not None:
        status, none = draws.every[v.STATUS].values, failed(draws.every)
        drawn = {name: np.where(none, np.nan, status == code) for name, code in STATUSES.items() if code in status}
        return {name: draws.estimate(share, values=draws.shaped(of)) for name, of in drawn.items()}
    parts = [(part[v.STATUS].values, failed(part)) for part in slices(dataset[[v.STATUS]])]
    status, none = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    values = {name: np.where(none, np.nan, status == code) for name, code in STATUSES.items()}
    shares = {name: estimate_of("share", of_name, **sampling_design(dataset)) for name, of_name in values.items()}
    return {name: share for name, share in shares.items() if share.value > 0.0}


def means_of(dataset: xarray.Dataset, variables: Sequence[v.Variable]) -> list[Measure]:
    """Means of the recorded quantities among some. A quantity with stand-offs has a mean at each of them; a tilt that
    is the deflection, as behind a thick base, has none."""
    standoffs = dataset[v.STANDOFF].values.tolist()
    is_deflection = {v.TILT, v.DEFLECTION} <= dataset.keys() and passed_count(dataset) > 0
    for part in slices(dataset[[v.STATUS, v.TILT, v.DEFLECTION]]) if is_deflection else ():
        difference = abs(part[v.TILT] - part[v.DEFLECTION]).values[passed(part)]
        is_deflection = is_deflection and np.nanmax(difference, initial=0.0) <= SAME_ANGLE
    return [
        Measure.parse(f"mean({variable})" if at is None else f"mean({variable}@{at!r}m)")
        for variable in variables
        if variable in dataset and not (variable is v.TILT and is_deflection)
        for at in (standoffs if v.STANDOFF in variable.dims else [None])
    ]


def measures_named(dataset: xarray.Dataset, texts: Sequence[str], default: Sequence[str]) -> list[Measure]:
    """The measures with these texts in a result; without texts those of `default` that the result has.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    try:
        if texts:
            return [Measure.parse(text).of(dataset) for text in texts]
        known = map(Measure.parse, default)
        return [measure.of(dataset) for measure in known if not measure.quantity.lacking(dataset)]
    except ValueError as error:
        raise ResultError(f"measure: {error}") from None
