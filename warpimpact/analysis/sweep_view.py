"""The measures of a sweep: an estimate for every combination of the inputs that were swept."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray

from warpimpact.analysis.estimates import asked_measures, estimated
from warpimpact.analysis.numbers import interval_text, number_text
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed
from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate
from warpimpact.view.view import Column, Section, Table, number

SHOWN_OF_SWEEPS = (f"mean({v.RESIDUAL_VELOCITY})", f"mean({v.DEFLECTION})", f"mean({v.TILT})", "P(perforated)")
"""Default measures of a sweep, as far as it has them."""

_MORE = "means are over the cores that passed; --measure TEXT tells how far the numerics may shift it"


class Point(NamedTuple):
    """One combination of the inputs.

    Attributes:
        labels: values of the inputs as the campaign writes them, by input.
        estimates: estimates of the measures, in the units of the Dataset.
        hits: number of the hits that did not fail.
    """

    labels: dict[str, str]
    estimates: dict[Measure, Estimate]
    hits: int


def measures_of(sweep: xarray.Dataset, texts: Sequence[str] = ()) -> list[Measure]:
    """The measures with these texts for a sweep; by default those of `SHOWN_OF_SWEEPS`, with tilts at the largest
    stand-off.

    Raises:
        ResultError: a text is no measure, or the sweep lacks what it needs.
    """
    return asked_measures(sweep, texts, SHOWN_OF_SWEEPS)


def inputs_of(sweep: xarray.Dataset) -> dict[str, list[str]]:
    """The values of every input as the campaign writes them, without inputs of which one value was chosen."""
    return {name: labels for name, labels in json.loads(sweep.attrs[attr.SWEEP]).items() if name in sweep.dims}


def points(sweep: xarray.Dataset, measures: Sequence[Measure]) -> Iterator[Point]:
    """Every combination, the last input changing fastest."""
    inputs = inputs_of(sweep)
    for combination in itertools.product(*map(enumerate, inputs.values())):
        chosen = dict(zip(inputs, combination, strict=True))
        point = sweep.isel({name: place for name, (place, _) in chosen.items()})
        point = point.isel(hit=np.flatnonzero(point[v.STATUS].notnull().values))
        labels = {name: label for name, (_, label) in chosen.items()}
        yield Point(labels, estimated(point, measures), int((~failed(point)).sum()))


def sweep_view(sweep: xarray.Dataset, texts: Sequence[str] = ()) -> list[Section]:
    """The view of a sweep: one table with a row for every combination and its measures. If measures are asked for, each
    has a table, with its shifts by the numerics, and the hits that count."""
    measures = measures_of(sweep, texts)
    every = list(points(sweep, measures))
    title = str(sweep.attrs.get(attr.TITLE, "untitled"))
    inputs = ", ".join(inputs_of(sweep)).replace("_", " ")
    sentence = f"{len(every)} combinations of {inputs}, with at most {sweep.sizes[v.HIT]} hits each"
    if not texts:
        return [Section([f"{sentence}; 95 % intervals", _short(every, measures), _MORE], title)]
    tables = [Section([_table(every, measure)], measure.title) for measure in measures]
    return [Section([sentence], title), *tables]


def _inputs(point: Point) -> list[Column]:
    return [Column(name.replace("_", " "), right=True) for name in point.labels]


def _short(every: Sequence[Point], measures: Sequence[Measure]) -> Table:
    """A row for every combination, with its measures and their intervals by the hits."""
    columns = [*_inputs(every[0]), *(Column(measure.title, right=True) for measure in measures)]
    rows = []
    for point in every:
        shown = [point.estimates[measure].times(measure.display.factor) for measure in measures]
        texts = (f"{number_text(estimate.value)} ({interval_text(estimate.low, estimate.high)})" for estimate in shown)
        rows.append((*point.labels.values(), *texts))
    return Table(columns, rows)


def _table(every: Sequence[Point], measure: Measure) -> Table:
    columns = [
        *(*_inputs(every[0]), number("value"), Column("95 % interval")),
        Column("hits that count", write="{:.1%}".format, right=True),
    ]
    rows = []
    for point in every:
        estimate = point.estimates[measure].times(measure.display.factor)
        counted = estimate.count / point.hits if point.hits else 0.0
        interval = interval_text(estimate.low, estimate.high, estimate.numerics)
        rows.append((*point.labels.values(), estimate.value, interval, counted))
    return Table(columns, rows)
