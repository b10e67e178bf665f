"""The contents of a result: origin, numbers with their intervals, accuracy, failures; for terminal and notebook."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.effectiveness import (
    effectiveness,
    effectiveness_view,
    plate_numbers,
    reference_name,
    weights_of,
)
from warpimpact.analysis.estimates import estimated, means_of, slices, status_shares
from warpimpact.analysis.hit_map import hit_points
from warpimpact.analysis.numbers import View, interval_text, number_text, text_of
from warpimpact.campaign.tested_range import range_line
from warpimpact.kernels.status import Status
from warpimpact.records.variable import failures
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, finer_pair, hit_numbers, is_choice, passed, status_codes
from warpimpact.results.layers import outlines
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import has_base
from warpimpact.scene.units import STORED
from warpimpact.solver.accuracy import errors_text, listed, share_text
from warpimpact.statistics.intervals import Estimate

NO_SENSITIVITY = "No sensitivity computed. Run: warpimpact sensitivity CAMPAIGN.toml"
_QUANTILES = (0.05, 0.5, 0.95)
_ARRESTED = "Other cores count in none of these numbers; in the file an arrested core has a residual velocity of 0."
_DEPTH, _BROKEN = Measure.parse("mean(base_depth)"), Measure.parse("P(broken)")
_MOST_DRAWN = 2000
"""Most hits in a drawing."""
_PASSED, _STOPPED, _FAILED = "#D55E00", "#56B4E9", "#000000"


@dataclass(frozen=True)
class Inspection:
    """All information on a result, as text, and in a notebook with a map.

    Attributes:
        text: what `warpimpact inspect` prints.
        verdict: how many cores pass, and the first measure of protection with that of the solid plate.
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
    return Inspection(inspect_text(dataset), verdict(dataset, effectiveness(dataset)), _drawing(dataset))


def verdict(dataset: xarray.Dataset, measures: pd.DataFrame) -> str:
    """How many cores pass, the first measure of protection, and the accuracy of the numerics."""
    first = measures.iloc[0]
    protection = f"{first.measure.title} {number_text(first.value)}"
    protection += "" if math.isnan(first.low) else f" ({interval_text(first.low, first.high, first.numerics)})"
    protection += "" if math.isnan(first.ratio) else f", {number_text(first.ratio)} of the {reference_name(dataset)}'s"
    return f"{_passed(dataset)} of {dataset.sizes['hit']} cores pass. {protection}. {numerics_sentence(dataset)}"


def _passed(dataset: xarray.Dataset) -> int:
    """Number of cores that passed."""
    return sum(int(passed(part).sum()) for part in slices(dataset[[v.STATUS]]))


def _drawing(dataset: xarray.Dataset) -> str:
    """The hits, orange where a core passed, blue where it stopped and black where the computation failed [mm]."""
    if attr.PLATE_PERIOD not in dataset.attrs:
        return ""
    shown = dataset[[v.STATUS]].isel(hit=slice(_MOST_DRAWN)).load()
    hits, status, came = 1e3 * hit_points(shown), shown[v.STATUS].values, passed(shown)
    y, z = np.maximum(500.0 * np.asarray(dataset.attrs[attr.PLATE_PERIOD]), np.abs(hits).max(axis=0))
    colours = np.where(came, _PASSED, np.where(failures(status), _FAILED, _STOPPED))
    holes = 1e3 * np.column_stack([outlines(dataset)[axis] for axis in "yz"])
    ends = np.flatnonzero(np.isnan(holes[:, 0]))
    paths = ("L".join(f"{a:.3f},{-b:.3f}" for a, b in ring[~np.isnan(ring[:, 0])]) for ring in np.split(holes, ends))
    marks = "".join(
        f'<circle cx="{a:.3f}" cy="{-b:.3f}" r="{0.006 * max(y, z):.3f}" fill="{colour}"/>'
        for (a, b), colour in zip(hits, colours, strict=True)
    )
    return (
        f'<svg role="img" aria-label="map of the hits" width="260" viewBox="{-y:.4f} {-z:.4f} {2 * y:.4f} {2 * z:.4f}">'
        f'<path d="{"".join(f"M{path}Z" for path in paths if path)}" fill="#d8d8d8"/>{marks}</svg>'
        "<br><small>orange: the core passes; blue: it is stopped; black: not computed; grey: holes</small>"
    )


def inspect_text(dataset: xarray.Dataset) -> str:
    """All information on a hit map as text."""
    return text_of(inspect_view(dataset))


def inspect_view(dataset: xarray.Dataset) -> View:
    """All information on a hit map. Of an open file only a part is in memory at a time."""
    return {
        str(dataset.attrs.get(attr.TITLE, "untitled")): _origin(dataset),
        "how the shots ended": [_statuses(dataset)],
        **_numbers(dataset),
        **effectiveness_view(dataset),
        "": [NO_SENSITIVITY],
        **failed_shots(dataset),
    }


def _origin(dataset: xarray.Dataset) -> list[str | pd.DataFrame]:
    attributes = dataset.attrs
    hits = f"{dataset.sizes['hit']} hits"
    if attr.SAMPLING in attributes:
        hits += f", {attributes[attr.SAMPLING]} sampling, seed {attributes[attr.SEED]}"
        hits += f", {attributes[attr.REPLICATES]} replicates" if attributes[attr.REPLICATES] > 1 else ""
    rows = {"hits": hits}
    if attr.SYMMETRIES in attributes:
        rows["symmetry"] = symmetry_text(dataset)
    if attr.AREAL_DENSITY in attributes:
        ligament = attributes.get(attr.LIGAMENT, math.inf)
        numbers = plate_numbers(attributes[attr.OPEN_AREA], ligament, weights_of(dataset))
        rows["plate"] = ", ".join(f"{label} {number}" for label, number in numbers.items())
    if (promise := promise_text(dataset)) is not None:
        rows["accuracy"] = promise
    rows |= {name: str(attributes[name]) for name in (attr.NUMERICS, attr.DEVICE, attr.HISTORY) if name in attributes}
    if attr.WARPIMPACT_VERSION in attributes:
        versions = (attributes[name] for name in (attr.WARPIMPACT_VERSION, attr.WARP_VERSION))
        rows["made by"] = "warpimpact {}, Warp {}".format(*versions)
    if attr.COMPUTE_TIME in attributes:
        rate = f"{attributes[attr.HITS_PER_SECOND]:.4g} hits per second"
        rows["took"] = f"{attributes[attr.COMPUTE_TIME]:.4g} s of computing, {rate}"
    names = attributes.get(attr.CATALOGUE_NAMES, "").splitlines()
    outside = json.loads(attributes.get(attr.OUTSIDE_TESTED_RANGE, "[]"))
    return [*(f"{name:<10} {text}" for name, text in rows.items()), *names, *range_note({"": dataset}), *outside]


def _statuses(dataset: xarray.Dataset) -> pd.DataFrame:
    """Shares of the shots that ended, with intervals."""
    shares = status_shares(dataset)
    intervals = [interval_text(share.low, share.high, share.numerics, ".2%") for share in shares.values()]
    columns = {"share": [f"{share.value:.2%}" for share in shares.values()], "95 % interval": intervals}
    return pd.DataFrame(columns, index=pd.Index(shares, name="status", dtype=object))


def _numbers(dataset: xarray.Dataset) -> View:
    """Means and quantiles of the cores that passed the plate, or the target, with intervals."""
    what = "target" if v.LAYER_STATUS in dataset else "plate"
    count, hits, rows = _passed(dataset), dataset.sizes["hit"], []
    for mean in means_of(dataset, v.shown_by("inspect")):
        name = mean.text.removeprefix("mean(").removesuffix(")")
        quantiles = [Measure.parse(f"quantile({name}, {share})") for share in _QUANTILES]
        for measure, estimate in estimated(dataset, [mean, *quantiles]).items():
            if estimate.count:
                rows.append(
                    _row(measure, estimate, "" if measure.kind == "mean" else f"{100 * measure.share:g} % quantile")
                )
    notes = (_ARRESTED if 0 < count < hits else "", sampling_note(dataset), numerics_note(dataset))
    title = f"{count} of {hits} hits passed the {what}" if count else f"no core passed the {what}"
    return {title: [*_means_table(rows), *filter(None, notes), *stop_lines(dataset)]}


def _row(measure: Measure, estimate: Estimate, quantile: str = "") -> tuple[str, str, str, str]:
    interval = interval_text(estimate.low, estimate.high, estimate.numerics, ".2f")
    label = quantile or f"{measure.column.label}, {measure.display.shown}"
    return label, number_text(estimate.value, ".2f"), interval, "" if quantile else number_text(estimate.spread, ".2f")


def _means_table(rows: list[tuple[str, str, str, str]]) -> list[pd.DataFrame]:
    """A table of means and quantiles; none without rows."""
    return [pd.DataFrame(rows, columns=["", "mean", "95 % interval", "spread"]).set_index("")] if rows else []


def failed_shots(dataset: xarray.Dataset) -> View:
    """Every shot whose computation failed: its number, status and inputs."""
    inputs, parts = [v.HIT_Y, v.HIT_Z, *v.shot_variables(dataset)], []
    for part in slices(dataset[[v.STATUS, *inputs]]):
        bad = part.isel(hit=np.flatnonzero(failed(part)))
        columns: dict[str, Any] = {"status": [Status(int(code)).name.lower() for code in bad[v.STATUS]]}
        for name in inputs:
            head, values = f"[{dataset[name].attrs['units']}]", bad[name].values
            layers = {f"{name}_{k} {head}": column for k, column in enumerate(values.T)} if values.ndim > 1 else {}
            columns |= layers or {f"{name} {head}": values}
        parts.append(pd.DataFrame(columns, index=pd.Index(hit_numbers(part)[np.flatnonzero(failed(part))], name="hit")))
    table = pd.concat(parts) if parts else pd.DataFrame()
    return {"failures": [f"{len(table)} of {dataset.sizes['hit']} shots failed", *([table] if len(table) else [])]}


def summary_text(dataset: xarray.Dataset) -> str:
    """The first numbers of a hit map as text: how the shots ended, without statuses that did not occur, and means;
    velocity, deflection and tilt count only the cores that passed the plate."""
    hits = dataset.sizes["hit"]
    means = means_of(dataset, (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)) + [_DEPTH] * has_base(dataset)
    rows = [
        _row(measure, estimate)
        for measure, estimate in estimated(dataset, means).items()
        if estimate.count or measure != _DEPTH
    ]
    lines = [f"{name} {count} ({count / hits:.1%})" for name, count in _counts(dataset).items()]
    came = _passed(dataset)
    over = [] if came == hits else [f"Means are over the {came} cores that passed." if came else "No core passed."]
    return text_of({"": [", ".join(lines), *_means_table(rows), *over, *stop_lines(dataset), numerics_note(dataset)]})


def _counts(dataset: xarray.Dataset) -> dict[str, int]:
    """Numbers of shots by status, for the statuses that occur; last the cores whose bending stress passed their
    strength, whatever their status, if cores have one."""
    status = np.concatenate([part[v.STATUS].values for part in slices(dataset[[v.STATUS]])])
    counts = {name.replace("_", " "): int((status == code).sum()) for name, code in status_codes(dataset).items()}
    counts = {name: count for name, count in counts.items() if count}
    if v.BROKEN in dataset:
        broken = estimated(dataset, [_BROKEN])[_BROKEN]
        counts["broken"] = round(broken.value * broken.count) if broken.count else 0
    return counts


def promise_text(dataset: xarray.Dataset) -> str | None:
    """The errors of the numerics in words, and whether the fidelity keeps its promise; None for an older result."""
    attributes = dataset.attrs
    if attr.NUMERICS_GIVEN not in attributes or attr.LIMIT in attributes:
        return None
    given = json.loads(attributes[attr.NUMERICS_GIVEN])
    if attr.RESOLUTION not in attributes:
        return f"promises nothing, as {_fixed_by(given)} is given"
    stated = accuracy_text(json.loads(attributes[attr.ACCURACY]), layered=attr.STATUS_ERROR in attributes)
    name = "the campaign" if given.get("accuracy") else given["fidelity"]
    kept = (f"keeps its promise ({stated})", f"does not keep its promise ({stated}) at the level that it may use")
    return f"{name} {kept[not attributes[attr.PROMISE_KEPT]]}; estimated errors: {errors_text(attributes)}"


def accuracy_text(accuracy: Mapping[str, float], *, layered: bool) -> str:
    """Words for an accuracy, by the names and in the units of `Accuracy`. A bound that it lacks is left out."""

    def bound(name: str, unit: str, factor: float = 1.0) -> str:
        share = accuracy.get(f"{name}_share", 0.0) if layered else 0.0
        return f"{factor * accuracy[name]:g} {unit}" + (f" + {100.0 * share:g} %" if share else "")

    parts = [bound("residual_velocity", "m/s")] if "residual_velocity" in accuracy else []
    parts += [bound("tilt", "deg", math.degrees(1.0))] if "tilt" in accuracy else []
    if layered and "depth" in accuracy:
        parts.append(f"{1e3 * accuracy['depth']:g} mm of depth")
    stated = f"{listed(parts)} for {share_text(accuracy['share'])}"
    if layered and accuracy.get("status_share", 1.0) < 1.0:
        stated += f", another status for at most {100.0 * accuracy['status_share']:g} %"
    return stated


def numerics_sentence(dataset: xarray.Dataset) -> str:
    """A sentence about the errors of the numerics."""
    promise = promise_text(dataset)
    return f"Numerics: {promise}." if promise else "The error of the numerics is not known."


def _fixed_by(given: Mapping[str, Any]) -> str:
    """The key of the campaign that fixes the resolution of a result without a pilot."""
    fixed = ("level", "time_step", "travel", "patches_axial", "patches_around", "grid_spacing")
    return f"numerics.{next((name for name in fixed if given.get(name) is not None), 'scheme')}"


def breaks_promise(dataset: xarray.Dataset) -> bool:
    """Whether the numerics of a result are less exact than promised."""
    return bool(dataset.attrs.get(attr.PROMISE_KEPT) == 0)


def hits_at_two_levels(dataset: xarray.Dataset) -> int:
    """Number of hits of a result that were computed at a finer level, too, for the shift by the numerics."""
    pair = finer_pair(dataset[[v.STATUS, *(name for name in v.FINER if name in dataset)]])
    return 0 if pair is None else pair[0].sizes["hit"]


def numerics_note(dataset: xarray.Dataset) -> str:
    """How the shift of a result's numbers by the numerics is known, or why it is unknown."""
    if hits := hits_at_two_levels(dataset):
        return f"numerics ±: from {hits} of the hits, which were computed at a finer level, too."
    why = "the result has no hits at a finer level"
    if v.FINER_HIT in dataset:
        why = "none of these hits was computed at a finer level, too"
    elif attr.NUMERICS_GIVEN in dataset.attrs and attr.RESOLUTION not in dataset.attrs:
        fixed = _fixed_by(json.loads(dataset.attrs[attr.NUMERICS_GIVEN]))
        why = f"{fixed} is given, so no hits were computed at a finer level (give numerics.fidelity instead)"
    return f"numerics ± is not known: {why}."


_SAMPLINGS = {
    "sobol": "Intervals are those of independent shots, as a rule too wide; hits.replicates = 16 gives valid ones.",
    "grid": "Intervals are those of independent shots, which the hits of a grid are not.",
    "list": "Intervals are those of independent shots, which the hits of a list may not be.",
}


def sampling_note(dataset: xarray.Dataset) -> str:
    """A note on the intervals of a result that its sampling needs, or none."""
    attributes = dataset.attrs
    if is_choice(dataset):
        return (
            f"These are {dataset.sizes['hit']} chosen hits of a larger result. All numbers describe them alone, and "
            "intervals are those of independent shots."
        )
    return _SAMPLINGS.get(attributes.get(attr.SAMPLING, ""), "") if attributes.get(attr.REPLICATES, 1) == 1 else ""


_STOP_REASONS = {
    "half_width": "its half width is met",
    "numerics": "more hits are of no use: by what the numerics may shift it, max_count would not meet that half width",
    "max_count": "max_count ended it",
}


def stop_lines(dataset: xarray.Dataset) -> list[str]:
    """The estimate of the stop rule and why it ended; empty without a stop rule."""
    attributes = dataset.attrs
    if attr.STOP_QUANTITY not in attributes:
        return []
    (low, high), unit = attributes[attr.ESTIMATE_INTERVAL], STORED[attributes[attr.ESTIMATE_UNITS]]
    interval = interval_text(unit.factor * low, unit.factor * high, digits=".6g")
    shift = attributes.get(attr.ESTIMATE_NUMERICS, math.nan)
    numerics = "not known" if math.isnan(shift) else f"{unit.factor * shift:.2g}{unit.suffix}"
    return [
        f"{attributes[attr.STOP_QUANTITY]} = {unit.text(attributes[attr.ESTIMATE], '.6g')}, "
        f"{attributes[attr.CONFIDENCE]:.4g} interval {interval}{unit.suffix}, numerics ± {numerics}; "
        f"{_STOP_REASONS[attributes[attr.STOP_REASON]]}"
    ]


def symmetry_text(dataset: xarray.Dataset) -> str:
    """What part of the cell the hits of a result with `hits.irreducible` stand for."""
    parts = str(dataset.attrs[attr.SYMMETRIES]).count(";") + 1
    if parts == 1:
        return "hits of the whole cell: plate and shot have no symmetry in common"
    return f"hits of 1/{parts} of the cell, which {dataset.attrs[attr.SYMMETRIES]} repeat"


def range_note(datasets: Mapping[str, xarray.Dataset], file: str = "") -> list[str]:
    """A line on whether results, by name, lie in the tested range; empty where that is unknown.

    Args:
        file: the file of a single result, which `inspect` shows with the details.
    """
    lines: dict[str, list[str]] = {}
    for name, dataset in datasets.items():
        if attr.OUTSIDE_TESTED_RANGE in dataset.attrs:
            line = range_line(json.loads(dataset.attrs[attr.OUTSIDE_TESTED_RANGE]))
            lines.setdefault(line, []).append(name)
    if len(lines) == 1:
        (line,) = lines
        return [line + f" Details: warpimpact inspect {file}" * bool(file and line.startswith("Outside"))]
    return [" ".join(f"{', '.join(names)}: {line}" for line, names in lines.items())] if lines else []
