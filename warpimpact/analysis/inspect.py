"""What is in a result file: who made it, from what campaign, its numbers with their intervals, and what failed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import xarray

from warpimpact.analysis.bursts import bursts, bursts_text
from warpimpact.analysis.effectiveness import effectiveness_text
from warpimpact.analysis.numbers import ends_of, intervals_text
from warpimpact.analysis.plate import plate_numbers
from warpimpact.analysis.summary import (
    estimated,
    levels_note,
    means_of,
    numerics_note,
    promise_text,
    sampling_note,
    slices,
    status_shares,
    stop_lines,
    symmetry_text,
)
from warpimpact.analysis.survival import draws_note
from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed
from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate

_QUANTILES = (0.05, 0.5, 0.95)


def inspect_text(dataset: xarray.Dataset) -> str:
    """All that a person may ask of a hit map, as text; of an open file only a part is in memory at a time."""
    tables: list[Iterable[str]] = [
        _origin(dataset),
        _statuses(dataset),
        _numbers(dataset),
        [effectiveness_text(dataset)],
        failures(dataset),
    ]
    if v.BURST_ORDER in dataset:
        tables.insert(3, [bursts_text(bursts(dataset))])
    return "\n\n".join("\n".join(table) for table in tables)


def _origin(dataset: xarray.Dataset) -> Iterator[str]:
    told = dataset.attrs
    hits = f"{dataset.sizes['hit']} hits"
    if attr.SAMPLING in told:
        hits += f", {told[attr.SAMPLING]} sampling, seed {told[attr.SEED]}"
        hits += f", {told[attr.REPLICATES]} replicates" if told[attr.REPLICATES] > 1 else ""
    yield told.get(attr.TITLE, "untitled")
    yield f"{'hits':<12}{hits}"
    if attr.SYMMETRIES in told:
        yield f"{'symmetry':<12}{symmetry_text(dataset)}"
    if attr.AREAL_DENSITY in told:
        numbers = plate_numbers(told[attr.OPEN_AREA], told.get(attr.LIGAMENT, math.inf), told[attr.AREAL_DENSITY])
        whole = " of the whole target" if v.LAYER_STATUS in dataset else ""
        yield f"{'plate':<12}{', '.join(f'{label} {number}' for label, number in numbers.items())}{whole}"
    yield from told.get(attr.EVIDENCE, "").splitlines()
    if (promise := promise_text(dataset)) is not None:
        yield f"{'accuracy':<12}{promise}"
    for name in (attr.NUMERICS, attr.DEVICE, attr.HISTORY):
        if name in told:
            yield f"{name:<12}{told[name]}"
    if attr.WARPIMPACT_VERSION in told:
        yield f"{'made by':<12}warpimpact {told[attr.WARPIMPACT_VERSION]}, Warp {told[attr.WARP_VERSION]}"
    if attr.COMPUTE_TIME in told:
        rate = f"{told[attr.HITS_PER_SECOND]:.4g} hits per second"
        yield f"{'took':<12}{told[attr.COMPUTE_TIME]:.4g} s of computing, {rate}"


def _statuses(dataset: xarray.Dataset) -> Iterator[str]:
    """Shares of the shots that ended, with intervals."""
    yield f"{'status':<22}{'share':>10}   95 % interval"
    for status, share in status_shares(dataset).items():
        yield f"{status:<22}{share.value:>10.2%}   {intervals_text(ends_of(share), '{:.2%}'.format)}"


def _numbers(dataset: xarray.Dataset) -> Iterator[str]:
    """Means and quantiles of the cores that passed the plate, or the target, with intervals."""
    what = "target" if v.LAYER_STATUS in dataset else "plate"
    if count := sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]])):
        of_how_many = f"{count} of {dataset.sizes['hit']} hits passed the {what}"
        yield f"{of_how_many:<43}{'':>10}   95 % interval"
    else:
        yield f"no core passed the {what}"
    shown = [name for name in v.shown_by("inspect") if name in dataset]
    for mean in means_of(shown, dataset[v.STANDOFF].values.tolist()):
        name = mean.text.removeprefix("mean(").removesuffix(")")
        quantiles = [Measure.parse(f"quantile({name}, {share})") for share in _QUANTILES]
        for measure, estimate in estimated(dataset, [mean, *quantiles]).items():
            if estimate.count:
                yield _row(measure, estimate)
    yield from filter(None, (sampling_note(dataset), numerics_note(dataset), levels_note(dataset), draws_note(dataset)))
    yield from stop_lines(dataset)


def _row(measure: Measure, estimate: Estimate) -> str:
    name, what = "", f"{measure.share * 100.0:g} % quantile"
    unit, factor = measure.display.shown, measure.display.factor
    if measure.kind == "mean":
        name, what = f"{measure.variable.replace('_', ' ')}{measure.place}, {unit}", "mean"
    interval = intervals_text(ends_of(estimate), lambda end: f"{factor * end:.2f}")
    row = f"{name:<29}{what:<14}{factor * estimate.value:>10.2f}   {interval}"
    return f"{row:<78} spread {factor * estimate.spread:.2f}" if measure.kind == "mean" else row


def failures(dataset: xarray.Dataset) -> Iterator[str]:
    """Every shot whose computation failed: its number, status and inputs."""
    inputs = [v.HIT_Y, v.HIT_Z, *v.shot_variables(dataset)]
    places = [(name, layer) for name in inputs for layer in _layers_of(dataset, name)]
    count = 0
    for part in slices(dataset[[v.STATUS, *inputs]]):
        for place in np.flatnonzero(failed(part)):
            shot = part.isel(hit=place)
            if not count:
                yield "failed shots: " + ", ".join(["hit", "status", *(_labelled(dataset, *place) for place in places)])
            count += 1
            own = (shot[name] if layer is None else shot[name][layer] for name, layer in places)
            values = "".join(f"{float(value):>14.6g}" for value in own)
            yield f"{int(hit_numbers(part)[place]):>10d}  {Status(int(shot[v.STATUS])).name.lower():<14}{values}"
    yield f"{count} of {dataset.sizes['hit']} shots failed"


def _layers_of(dataset: xarray.Dataset, name: str) -> Iterable[int | None]:
    return range(dataset.sizes["layer"]) if "layer" in dataset[name].dims else [None]


def _labelled(dataset: xarray.Dataset, name: str, layer: int | None) -> str:
    number = "" if layer is None else f"_{layer}"
    return f"{name}{number} [{dataset[name].attrs['units']}]"
