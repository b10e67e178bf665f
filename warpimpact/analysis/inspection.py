"""The contents of a result file: origin, numbers with their intervals, and failures. A notebook adds a map and a
verdict."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.analysis.effectiveness import Score, effectiveness, effectiveness_view
from warpimpact.analysis.estimates import estimated, means_of, slices, status_shares
from warpimpact.analysis.hit_map import hit_points
from warpimpact.analysis.numbers import interval_text, number_text
from warpimpact.analysis.plate_text import plate_numbers, reference_name, weights_of
from warpimpact.analysis.summary import (
    numerics_note,
    numerics_sentence,
    promise_text,
    range_note,
    sampling_note,
    stop_lines,
    symmetry_text,
)
from warpimpact.kernels.status import Status
from warpimpact.records.variable import failures
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed
from warpimpact.results.layers import outlines
from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate
from warpimpact.view import svg
from warpimpact.view.view import Column, Section, Table, labelled, number, text_of

NO_SENSITIVITY = "No sensitivity computed. Run: warpimpact sensitivity CAMPAIGN.toml"
_QUANTILES = (0.05, 0.5, 0.95)
_ARRESTED = "Other cores count in none of these numbers; in the file an arrested core has a residual velocity of 0."

_MOST_HITS = 2000
"""Most hits in a drawing."""
_PASSED, _STOPPED, _FAILED, _EDGE = "#D55E00", "#56B4E9", "#000000", "#d8d8d8"


@dataclass(frozen=True)
class Inspection:
    """All information on a result, as text, and in a notebook with a map.

    Attributes:
        text: what `warpimpact inspect` prints.
        verdict: how many cores pass, and the first measure of protection beside that of the solid plate.
        drawing: an SVG map of how the hits ended, over the holes.
    """

    text: str
    verdict: str
    drawing: str

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        return f"<div><p><b>{escape(self.verdict)}</b></p>{self.drawing}<pre>{escape(self.text)}</pre></div>"


def inspect(dataset: xarray.Dataset | str | Path) -> Inspection:
    """A result, or its file, as text, with a verdict and a map. Of a file only a part is in memory at a time.

    Raises:
        ResultError: the file is missing or damaged, or is no map of hits.
    """
    if isinstance(dataset, str | Path):
        with files.opened(Path(dataset)) as result:
            return inspect(result)
    return Inspection(inspect_text(dataset), verdict(dataset, effectiveness(dataset)[0]), _drawing(dataset))


def verdict(dataset: xarray.Dataset, first: Score) -> str:
    """How many cores pass, one measure of protection, and the accuracy of the numerics."""
    count, interval = sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]])), first.interval
    protection = f"{first.measure.title} {number_text(first.value)}"
    protection += "" if interval == "-" else f" ({interval})"
    protection += "" if np.isnan(first.ratio) else f", {number_text(first.ratio)} of the {reference_name(dataset)}'s"
    return f"{count} of {dataset.sizes['hit']} cores pass. {protection}. {numerics_sentence(dataset)}"


def _drawing(dataset: xarray.Dataset) -> str:
    """The hits, orange where a core passed, blue where it stopped and black where the computation failed."""
    if attr.PLATE_PERIOD not in dataset.attrs:
        return ""
    first_hits = dataset[[v.STATUS]].isel(hit=slice(_MOST_HITS)).load()
    hits, status, came = hit_points(first_hits), first_hits[v.STATUS].values, passed(first_hits)
    half = np.maximum(0.5 * np.asarray(dataset.attrs[attr.PLATE_PERIOD]), np.abs(hits).max(axis=0))
    holes = outlines(dataset)
    mark = 0.006 * half.max() * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    broken = failures(status)
    kinds = ((came, _PASSED), (~came & ~broken, _STOPPED), (broken, _FAILED))
    marks = [svg.Shape([hit + mark for hit in hits[which]], colour) for which, colour in kinds]
    shapes = [svg.Shape(svg.rings(holes["y"], holes["z"]), _EDGE), *marks]
    legend = "orange: the core passes; blue: it is stopped; black: not computed; grey: holes"
    return f"{svg.drawing(shapes, -half, half, 'map of the hits')}<br><small>{legend}</small>"


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
        failed_shots(dataset),
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
        (status, share.value, interval_text(share.low, share.high, share.numerics, percent, percent))
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
    interval = interval_text(shown.low, shown.high, shown.numerics, "{:.2f}".format, "{:.2f}".format)
    if measure.kind != "mean":
        return ("", f"{measure.share * 100.0:g} % quantile", shown.value, interval, None)
    name = f"{measure.column.label}, {measure.display.shown}"
    return (name, "mean", shown.value, interval, shown.spread)


def failed_shots(dataset: xarray.Dataset) -> Section:
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
