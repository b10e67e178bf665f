"""The first numbers of a result: how the shots ended, and what comes through the plate."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warpimpact.analysis.estimates import estimated, means_of, slices
from warpimpact.analysis.numbers import interval_text
from warpimpact.campaign.tested_range import range_line
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import finer_pair, is_choice, status_codes
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import has_base
from warpimpact.scene.display import STORED
from warpimpact.solver.accuracy import errors_text, listed, share_text
from warpimpact.view.view import Column, Section, Table, number, text_of

if TYPE_CHECKING:
    from warpimpact.results.table import Result


def promise_text(dataset: Result) -> str | None:
    """The errors of the numerics in words, and whether the fidelity keeps its promise; None for an older result."""
    attributes = dataset.attrs
    if attr.NUMERICS_GIVEN not in attributes or attr.LIMIT in attributes:
        return None
    given = json.loads(attributes[attr.NUMERICS_GIVEN])
    if attr.RESOLUTION not in attributes:
        return f"promises nothing, as {_fixed_by(attributes)} is given"
    asked = json.loads(attributes[attr.ACCURACY])
    stated = accuracy_text(asked, layered=attr.STATUS_ERROR in attributes)
    errors = f"estimated errors: {errors_text(attributes)}"
    name = "the campaign" if given.get("accuracy") else given["fidelity"]
    if attributes[attr.PROMISE_KEPT]:
        return f"{name} keeps its promise ({stated}); {errors}"
    return f"{name} does not keep its promise ({stated}) at the level that it may use; {errors}"


def accuracy_text(asked: Mapping[str, float], *, layered: bool) -> str:
    """Words for an accuracy, by the names and in the units of `Accuracy`. A bound that it lacks is not asked for."""

    def bound(name: str, unit: str, factor: float = 1.0) -> str:
        share = asked.get(f"{name}_share", 0.0) if layered else 0.0
        return f"{factor * asked[name]:g} {unit}" + (f" + {100.0 * share:g} %" if share else "")

    parts = [bound("residual_velocity", "m/s")] if "residual_velocity" in asked else []
    parts += [bound("tilt", "deg", math.degrees(1.0))] if "tilt" in asked else []
    if layered and "depth" in asked:
        parts.append(f"{1e3 * asked['depth']:g} mm of depth")
    stated = f"{listed(parts)} for {share_text(asked['share'])}"
    if layered and asked.get("status_share", 1.0) < 1.0:
        stated += f", another status for at most {100.0 * asked['status_share']:g} %"
    return stated


def numerics_sentence(dataset: Result) -> str:
    """A sentence about the errors of the numerics."""
    promise = promise_text(dataset)
    return f"Numerics: {promise}." if promise else "The error of the numerics is not known."


def _fixed_by(told: Mapping[str, Any]) -> str:
    """The key of the campaign that fixes the resolution of a result without a pilot."""
    given = json.loads(told[attr.NUMERICS_GIVEN])
    fixed = ("level", "time_step", "travel", "patches_axial", "patches_around", "grid_spacing")
    return f"numerics.{next((name for name in fixed if given.get(name) is not None), 'scheme')}"


def breaks_promise(dataset: Result) -> bool:
    """Whether the numerics of a result are less exact than promised."""
    return bool(dataset.attrs.get(attr.PROMISE_KEPT) == 0)


_DEPTH, _BROKEN = Measure.parse("mean(base_depth)"), Measure.parse("P(broken)")


_SAMPLINGS = {
    "sobol": "Intervals are those of independent shots, as a rule too wide; hits.replicates = 16 gives valid ones.",
    "grid": "Intervals are those of independent shots, which the hits of a grid are not.",
    "list": "Intervals are those of independent shots, which the hits of a list may not be.",
}


def sampling_note(dataset: Result) -> str:
    """A note on the intervals of a result that its sampling needs, or none."""
    attributes = dataset.attrs
    if is_choice(dataset):
        return (
            f"These are {dataset.sizes['hit']} chosen hits of a larger result. All numbers describe them alone, and "
            "intervals are those of independent shots."
        )
    return _SAMPLINGS.get(attributes.get(attr.SAMPLING, ""), "") if attributes.get(attr.REPLICATES, 1) == 1 else ""


def summary_text(dataset: Result) -> str:
    """The first numbers of a hit map as text: how the shots ended, without statuses that did not occur, and means;
    velocity, deflection and tilt count only the cores that passed the plate."""
    hits, standoffs = dataset.sizes["hit"], dataset[v.STANDOFF].values.tolist()
    shares = Table(
        (Column(), number(digits="d"), number(digits=".1%")),
        [(name, count, count / hits) for name, count in _counts(dataset).items()],
    )
    means = means_of((v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT), standoffs)
    means += [_DEPTH] if has_base(dataset) else []
    columns = (
        *(Column(), number("mean", digits=".2f"), Column()),
        *(Column("95 % interval"), number("spread", digits=".1f"), Column()),
    )
    rows = []
    for measure, estimate in estimated(dataset, means).items():
        if estimate.count or measure != _DEPTH:
            shown, unit = estimate.times(measure.display.factor), measure.display.shown
            interval = interval_text(shown.low, shown.high, shown.numerics, "{:.2f}".format, "{:.2f}".format)
            rows.append((measure.column.label, shown.value, unit, interval, shown.spread, _counted(shown.count, hits)))
    notes = (numerics_note(dataset),)
    return text_of([Section([shares, Table(columns, rows), *stop_lines(dataset), *filter(None, notes)])])


def _counts(dataset: Result) -> dict[str, int]:
    """Numbers of shots by status, for the statuses that occur; last the cores whose bending stress passed their
    strength, whatever their status, if cores have one."""
    counts = dict.fromkeys(status_codes(dataset), 0)
    for part in slices(dataset[[v.STATUS]]):
        for name, code in status_codes(dataset).items():
            counts[name] += int((part[v.STATUS].values == code).sum())
    told = {name.replace("_", " "): count for name, count in counts.items() if count}
    if v.BROKEN in dataset:
        broken = estimated(dataset, [_BROKEN])[_BROKEN]
        told["broken"] = round(broken.value * broken.count) if broken.count else 0
    return told


def _counted(count: int, hits: int) -> str:
    """Words for the hits behind a mean; empty where it is over all hits."""
    return "no core behind the plate" if not count else f"of {count} hits" if count < hits else ""


def numerics_note(dataset: Result) -> str:
    """How the shift of a result's numbers by the numerics is known, or why it is unknown."""
    if hits := hits_at_two_levels(dataset):
        return f"numerics ±: from {hits} of the hits, which were computed at a finer level, too."
    return f"numerics ± is not known: {_why_not_known(dataset)}."


def hits_at_two_levels(dataset: Result) -> int:
    """Number of hits of a result that were computed at a finer level, too, for the shift by the numerics."""
    pair = finer_pair(dataset[[v.STATUS, *(name for name in v.GROUPS["finer"] if name in dataset)]])
    return 0 if pair is None else pair[0].sizes["hit"]


def _why_not_known(dataset: Result) -> str:
    if v.FINER_HIT in dataset:
        return "none of these hits was computed at a finer level, too"
    if attr.NUMERICS_GIVEN in dataset.attrs and attr.RESOLUTION not in dataset.attrs:
        given = _fixed_by(dataset.attrs)
        return f"{given} is given, so no hits were computed at a finer level (numerics.fidelity in its place does that)"
    return "the result has no hits at a finer level"


_STOPPED = {
    "half_width": "its half width is met",
    "numerics": "more hits are of no use: by what the numerics may shift it, max_count would not meet that half width",
    "max_count": "max_count ended it",
}


def stop_lines(dataset: Result) -> list[str]:
    """What the stop rule asked for; empty without a stop rule."""
    attributes = dataset.attrs
    if attr.STOP_QUANTITY not in attributes:
        return []
    (low, high), unit = attributes[attr.ESTIMATE_INTERVAL], STORED[attributes[attr.ESTIMATE_UNITS]]
    interval = interval_text(unit.factor * low, unit.factor * high, text="{:.6g}".format)
    shift = attributes.get(attr.ESTIMATE_NUMERICS, math.nan)
    numerics = "not known" if math.isnan(shift) else f"{unit.factor * shift:.2g}{unit.suffix}"
    return [
        f"{attributes[attr.STOP_QUANTITY]} = {unit.text(attributes[attr.ESTIMATE], '.6g')}, "
        f"{attributes[attr.CONFIDENCE]:.4g} interval {interval}{unit.suffix}, numerics ± {numerics}; "
        f"{_STOPPED[attributes[attr.STOP_REASON]]}"
    ]


def symmetry_text(dataset: Result) -> str:
    """What part of the cell the hits of a result with `hits.irreducible` stand for."""
    parts = str(dataset.attrs[attr.SYMMETRIES]).count(";") + 1
    if parts == 1:
        return "hits of the whole cell: plate and shot have no symmetry in common"
    return f"hits of 1/{parts} of the cell, which {dataset.attrs[attr.SYMMETRIES]} repeat"


def range_note(datasets: Mapping[str, Result], file: str = "") -> list[str]:
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
