"""The contents of a result file: origin, numbers with their intervals, and failures."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray

from warpimpact.analysis.effectiveness import effectiveness_view
from warpimpact.analysis.estimates import estimated, means_of, slices, status_shares
from warpimpact.analysis.numbers import intervals_text
from warpimpact.analysis.plate_text import plate_numbers, weights_of
from warpimpact.analysis.summary import (
    numerics_note,
    promise_text,
    range_note,
    sampling_note,
    stop_lines,
    symmetry_text,
)
from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed
from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate
from warpimpact.view.view import Column, Section, Table, labelled, number, text_of

NO_SENSITIVITY = "No sensitivity computed. Run: warpimpact sensitivity CAMPAIGN.toml"
_QUANTILES = (0.05, 0.5, 0.95)
_ARRESTED = "Other cores count in none of these numbers; in the file an arrested core has a residual velocity of 0."


def inspect_text(dataset: xarray.Dataset) -> str:
    """All information on a hit map as text. Of an open file only a part is in memory at a time."""
    return text_of(inspect_view(dataset))


def inspect_view(dataset: xarray.Dataset) -> list[Section]:
    """The view of a hit map: its origin, how shots ended, its numbers, its measures of protection, and
    what failed."""
    return [
        _origin(dataset),
        _statuses(dataset),
        _numbers(dataset),
        effectiveness_view(dataset),
        Section([NO_SENSITIVITY]),
        failures(dataset),
    ]


def _origin(dataset: xarray.Dataset) -> Section:
    attributes = dataset.attrs
    hits = f"{dataset.sizes['hit']} hits"
    if attr.SAMPLING in attributes:
        hits += f", {attributes[attr.SAMPLING]} sampling, seed {attributes[attr.SEED]}"
        hits += f", {attributes[attr.REPLICATES]} replicates" if attributes[attr.REPLICATES] > 1 else ""
    rows = [("hits", hits)]
    if attr.SYMMETRIES in attributes:
        rows.append(("symmetry", symmetry_text(dataset)))
    if attr.AREAL_DENSITY in attributes:
        ligament = attributes.get(attr.LIGAMENT, math.inf)
        numbers = plate_numbers(attributes[attr.OPEN_AREA], ligament, weights_of(dataset))
        rows.append(("plate", ", ".join(f"{label} {number}" for label, number in numbers.items())))
    if (promise := promise_text(dataset)) is not None:
        rows.append(("accuracy", promise))
    rows += [(name, str(attributes[name])) for name in (attr.NUMERICS, attr.DEVICE, attr.HISTORY) if name in attributes]
    if attr.WARPIMPACT_VERSION in attributes:
        rows.append(
            ("made by", f"warpimpact {attributes[attr.WARPIMPACT_VERSION]}, Warp {attributes[attr.WARP_VERSION]}")
        )
    if attr.COMPUTE_TIME in attributes:
        rate = f"{attributes[attr.HITS_PER_SECOND]:.4g} hits per second"
        rows.append(("took", f"{attributes[attr.COMPUTE_TIME]:.4g} s of computing, {rate}"))
    names = attributes.get(attr.CATALOGUE_NAMES, "").splitlines()
    outside = json.loads(attributes.get(attr.OUTSIDE_TESTED_RANGE, "[]"))
    return Section(
        [labelled(rows), *names, *range_note({"": dataset}), *outside], attributes.get(attr.TITLE, "untitled")
    )


def _statuses(dataset: xarray.Dataset) -> Section:
    """Shares of the shots that ended, with intervals."""
    percent = "{:.2%}".format
    columns = Column("status"), Column("share", write=percent, right=True), Column("95 % interval")
    rows = [
        (status, share.value, intervals_text(share.low, share.high, share.numerics, percent, percent))
        for status, share in status_shares(dataset).items()
    ]
    return Section([Table(columns, rows)])


def _numbers(dataset: xarray.Dataset) -> Section:
    """Means and quantiles of the cores that passed the plate, or the target, with intervals."""
    what = "target" if v.LAYER_STATUS in dataset else "plate"
    count = sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]]))
    title = f"{count} of {dataset.sizes['hit']} hits passed the {what}" if count else f"no core passed the {what}"
    shown = [name for name in v.shown_by("inspect") if name in dataset]
    rows = []
    for mean in means_of(shown, dataset[v.STANDOFF].values.tolist()):
        name = mean.text.removeprefix("mean(").removesuffix(")")
        quantiles = [Measure.parse(f"quantile({name}, {share})") for share in _QUANTILES]
        estimates = estimated(dataset, [mean, *quantiles]).items()
        rows += [_row(measure, estimate) for measure, estimate in estimates if estimate.count]
    columns = Column(), Column(), number(digits=".2f"), Column("95 % interval"), number("spread", digits=".2f")
    table = [Table(columns, rows)] if rows else []
    some_passed = 0 < count < dataset.sizes["hit"]
    notes = (
        _ARRESTED if some_passed else None,
        sampling_note(dataset),
        numerics_note(dataset),
    )
    return Section([*table, *filter(None, notes), *stop_lines(dataset)], title)


def _row(measure: Measure, estimate: Estimate) -> tuple[Any, ...]:
    shown = estimate.times(measure.display.factor)
    interval = intervals_text(shown.low, shown.high, shown.numerics, "{:.2f}".format, "{:.2f}".format)
    if measure.kind != "mean":
        return ("", f"{measure.share * 100.0:g} % quantile", shown.value, interval, None)
    name = f"{measure.column.label}, {measure.display.shown}"
    return (name, "mean", shown.value, interval, shown.spread)


def failures(dataset: xarray.Dataset) -> Section:
    """Every shot whose computation failed: its number, status and inputs."""
    inputs = [v.HIT_Y, v.HIT_Z, *v.shot_variables(dataset)]
    layers = {name: range(dataset.sizes["layer"]) if "layer" in dataset[name].dims else [None] for name in inputs}
    places = [(name, layer) for name in inputs for layer in layers[name]]
    rows: list[tuple[Any, ...]] = []
    for part in slices(dataset[[v.STATUS, *inputs]]):
        for place in np.flatnonzero(failed(part)):
            shot = part.isel(hit=place)
            values = (float(shot[name] if layer is None else shot[name][layer]) for name, layer in places)
            rows.append((int(hit_numbers(part)[place]), Status(int(shot[v.STATUS])).name.lower(), *values))
    if not rows:
        return Section([f"0 of {dataset.sizes['hit']} shots failed"])
    columns = [
        *(number("hit", digits="d"), Column("status")),
        *(
            number(name if layer is None else f"{name}_{layer}", str(dataset[name].attrs["units"]), ".6g")
            for name, layer in places
        ),
    ]
    return Section([Table(columns, rows)], f"{len(rows)} of {dataset.sizes['hit']} shots failed")
