"""What a result says: its answer in a few lines, and its contents: origin, numbers, accuracy, failures."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.correction import correction_table, is_corrected, touching_note
from warpimpact.analysis.effectiveness import (
    effectiveness,
    effectiveness_view,
    plate_numbers,
    reference_name,
    weights_of,
)
from warpimpact.analysis.numbers import View, interval_text, number_text
from warpimpact.campaign.evidence import range_line
from warpimpact.kernels.status import Status
from warpimpact.measures.estimates import estimated, means_of, passed_count, slices, status_shares
from warpimpact.measures.hits import failed, hit_numbers, is_choice, shot_variables
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import ELEMENTS, FINER, Result, as_dataset, as_tree, node_places
from warpimpact.measures.vocabulary import has_base
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.units import STORED, count_text, list_text
from warpimpact.solver.accuracy import UNITS, errors_text, share_text

LAW_ERRORS = {"velocity": (3.0, 81.0), "tilt": (7.0, 59.0)}
"""Smallest and largest error (root mean square) of the fast law on the 12 perforated plates of docs/continuum.md,
against finite elements of the same hits: of the residual velocity [m/s], and of the tilt at 130 mm [°]."""
CAVEAT = "The results rank plates and show tendencies. They do not certify protection."
_BROKEN = Measure.parse("P(broken)")
_QUANTILES = (0.05, 0.5, 0.95)
_ARRESTED = "These numbers count the cores that passed. In the file an arrested core has the residual velocity 0."


def answer(result: Result, elements: str = "") -> list[str | pd.DataFrame]:
    """The answer of a map of hits, sentences and a table of what elements corrected, in four to six lines.

    Numbers that finite elements have corrected have one range, of hits and numerics together. Those of the fast law
    alone have the digits that the law knows: its bias is larger than any interval of its hits.

    Args:
        elements: a sentence on what a correction by finite elements takes, or needs.
    """
    dataset = as_dataset(result)
    scene = dataset.attrs.get(attr.SCENE, dataset.attrs.get(attr.TITLE, "untitled"))
    has_elements, sentence = is_corrected(result), _sentence(result)
    lines: list[str | pd.DataFrame] = [f"{scene}.", *([] if has_elements else [sentence])]
    if has_elements:
        lines += [f"By the fast law: {sentence}"] if has_base(dataset) else []
        broken = [_BROKEN] if v.BROKEN in dataset else []
        lines += correction_table(result, [*deciding_measures(dataset), *broken])
    if exceeds_tolerance(dataset):
        errors = errors_text(dataset.attrs)
        level = json.loads(dataset.attrs[attr.RESOLUTION])["level"]
        remedy = f"To see what that moves, run with numerics.level = {level + 2} and compare both results."
        lines.append(f"The numerics err by {errors}, more than their tolerance. {remedy}")
    if not has_elements and attr.CONTINUUM not in dataset.attrs:
        lines.append(f"{law_line()} {elements}".strip())
    return [*lines, *touching_note(dataset), *stop_lines(dataset), *range_note([dataset])]


def law_line() -> str:
    """A sentence on the errors of the fast law."""
    (slow, fast), (little, much) = LAW_ERRORS["velocity"], LAW_ERRORS["tilt"]
    errors = f"{slow:.0f} to {fast:.0f} m/s and {little:.0f} to {much:.0f}°"
    return f"By the fast law: on 12 perforated plates it was {errors} off finite elements."


def deciding_measures(dataset: xarray.Dataset) -> list[Measure]:
    """Whether cores pass the base; without one, the residual velocity, and the tilt farthest behind the plate."""
    if has_base(dataset):
        return [Measure.parse("P(base_perforated)")]
    standoffs = dataset[v.STANDOFF].values.tolist()
    angle = f"tilt@{standoffs[-1]!r}m" if standoffs else v.DEFLECTION
    return [Measure.parse(f"mean({v.RESIDUAL_VELOCITY})"), Measure.parse(f"mean({angle})")]


def _sentence(result: Result) -> str:
    """How many cores pass the base, behind the add-on, behind the solid one, and without one; without a base, how many
    cores pass, and with which velocity and tilt; how many break, and how many shots failed, where some do."""
    dataset = as_dataset(result)
    measures, ends, cores = deciding_measures(dataset), "", count_text(dataset.sizes[v.HIT], "core")
    if v.BROKEN in dataset:
        ends += f"; {_share(estimated(dataset, [_BROKEN])[_BROKEN].value)} of the cores break"
    if bad := int(failed(dataset).sum()):
        ends += f"; {count_text(bad, 'shot')} failed"
    if has_base(dataset):
        row = effectiveness(result, [measures[0].text]).iloc[0]
        solid = f"behind the {reference_name(dataset)} of the same weight"
        others = ((row.solid, solid), (row.alone, "without add-on"))
        shown = ", ".join(f"{_share(value)} {where}" for value, where in others if not math.isnan(value))
        return f"{_share(row.value)} of {cores} pass the base{f'; {shown}' if shown else ''}{ends}."
    if not (passed := passed_count(dataset)):
        return f"No core of {dataset.sizes[v.HIT]} passes{ends}."
    means = ", ".join(
        f"mean {measure.column.label} {mean.value:.0f}{measure.display.suffix}"
        for measure, mean in estimated(dataset, measures).items()
    )
    return f"{_share(passed / dataset.sizes[v.HIT])} of {cores} pass: {means}{ends}."


def _share(share: float) -> str:
    """A share in whole percent that is 0 or 100 % only where no or every core counts."""
    if math.isnan(share):
        return "an unknown share"
    return "under 1%" if 0.0 < share < 0.005 else "over 99%" if 0.995 < share < 1.0 else f"{share:.0%}"


def inspect_view(result: Result) -> View:
    """All information on a hit map. Of an open file only a part is in memory at a time."""
    dataset, corrected = as_dataset(result), list[str | pd.DataFrame]()
    if is_corrected(result):
        numerics = as_tree(result)[ELEMENTS].attrs[attr.NUMERICS]
        corrected = [*correction_table(result), f"By {numerics}. The numbers below are those of the fast law."]
    return {
        str(dataset.attrs.get(attr.TITLE, "untitled")): _origin(dataset),
        "how the shots ended": [_statuses(dataset)],
        "corrected by finite elements": corrected,
        **_numbers(result),
        **effectiveness_view(result),
        "": ["How far do inputs that are not measured move these numbers? Run: warpimpact sensitivity CAMPAIGN.toml"],
        **failed_shots(dataset),
    }


def _origin(dataset: xarray.Dataset) -> list[str | pd.DataFrame]:
    attributes = dataset.attrs
    rows = {"hits": count_text(dataset.sizes["hit"], "hit")}
    if attr.SAMPLING in attributes:
        rows["hits"] += f", {attributes[attr.SAMPLING]} sampling, seed {attributes[attr.SEED]}"
        rows["hits"] += f", {attributes[attr.REPLICATES]} replicates" if attributes[attr.REPLICATES] > 1 else ""
    if attr.SYMMETRIES in attributes:
        parts = str(attributes[attr.SYMMETRIES]).count(";") + 1
        rows["symmetry"] = f"hits of 1/{parts} of the cell, which {attributes[attr.SYMMETRIES]} repeat"
        if parts == 1:
            rows["symmetry"] = "hits of the whole cell: plate and shot have no symmetry in common"
    if attr.AREAL_DENSITY in attributes:
        ligament = attributes.get(attr.LIGAMENT, math.inf)
        numbers = plate_numbers(attributes[attr.OPEN_AREA], ligament, weights_of(dataset))
        rows["plate"] = ", ".join(f"{label} {number}" for label, number in numbers.items())
    if (accuracy := tolerance_text(dataset)) is not None:
        rows["accuracy"] = accuracy
    rows |= {name: str(attributes[name]) for name in (attr.NUMERICS, attr.DEVICE, attr.HISTORY) if name in attributes}
    if attr.WARPIMPACT_VERSION in attributes:
        rows["made by"] = f"warpimpact {attributes[attr.WARPIMPACT_VERSION]}, Warp {attributes[attr.WARP_VERSION]}"
    if attr.COMPUTE_TIME in attributes:
        rate = f"{attributes[attr.HITS_PER_SECOND]:.4g} hits per second"
        rows["took"] = f"{attributes[attr.COMPUTE_TIME]:.4g} s of computing, {rate}"
    names = attributes.get(attr.CATALOGUE_NAMES, "").splitlines()
    outside = json.loads(attributes.get(attr.OUTSIDE_TESTED_RANGE, "[]"))
    notes = [*names, *touching_note(dataset), *range_note([dataset])]
    return [*(f"{name:<10} {text}" for name, text in rows.items()), *notes, *outside]


def _statuses(dataset: xarray.Dataset) -> pd.DataFrame:
    """Shares of the shots that ended, with intervals."""
    rows = {
        name: (f"{share.value:.2%}", interval_text(share.low, share.high, digits=".2%"))
        for name, share in status_shares(dataset).items()
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=["share", "95 % interval"]).rename_axis("status")


def _numbers(result: Result) -> View:
    """Means and quantiles of the cores that passed the plate, or the target, with intervals."""
    dataset = as_dataset(result)
    what = "target" if v.LAYER_STATUS in dataset else "plate"
    count, hits, measures = passed_count(dataset), dataset.sizes["hit"], list[Measure]()
    for mean in means_of(dataset, v.shown_by("inspect")):
        name = mean.text.removeprefix("mean(").removesuffix(")")
        measures += [mean, *(Measure.parse(f"quantile({name}, {share})") for share in _QUANTILES)]
    rows = {
        measure.title: (
            number_text(one.value, ".2f"),
            interval_text(one.low, one.high, one.numerics, ".2f"),
            number_text(one.spread, ".2f") if measure.kind == "mean" else "",
        )
        for measure, one in estimated(result, measures).items()
        if one.count
    }
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "95 % interval", "spread"])
    notes = (_ARRESTED if 0 < count < hits else "", sampling_note(dataset), numerics_note(result))
    title = f"{count} of {count_text(hits, 'hit')} passed the {what}" if count else f"no core passed the {what}"
    return {title: [*([table] if rows else []), *filter(None, notes), *stop_lines(dataset)]}


def failed_shots(dataset: xarray.Dataset) -> View:
    """Every shot whose computation failed: its number, status and inputs."""
    inputs = [v.HIT_Y, v.HIT_Z, *shot_variables(dataset)]
    places = np.flatnonzero(np.concatenate([failed(part) for part in slices(dataset[[v.STATUS]])]))
    bad = dataset[[v.STATUS, *inputs]].isel(hit=places).load()
    columns: dict[str, Any] = {"status": [Status(int(code)).name.lower() for code in bad[v.STATUS]]}
    for name in inputs:
        head, values = f"[{bad[name].attrs['units']}]", bad[name].values
        layers = {f"{name}_{k} {head}": column for k, column in enumerate(values.T)} if values.ndim > 1 else {}
        columns |= layers or {f"{name} {head}": values}
    table = pd.DataFrame(columns, index=pd.Index(hit_numbers(dataset)[places], name="hit"))
    parts: list[str | pd.DataFrame] = [f"{len(table)} of {count_text(dataset.sizes['hit'], 'shot')} failed"]
    return {"failures": parts + [table] * bool(len(table))}


def tolerance_text(dataset: xarray.Dataset) -> str | None:
    """Errors of the numerics, and whether they are within the tolerance; None if unknown."""
    attributes = dataset.attrs
    if attr.RESOLUTION not in attributes or attr.LIMIT in attributes:
        return None
    given, accuracy = (json.loads(attributes[name]) for name in (attr.NUMERICS_GIVEN, attr.ACCURACY))
    is_layered, parts = attr.STATUS_ERROR in attributes, []
    for name, unit, factor in (("residual_velocity", "m/s", 1.0), ("tilt", "deg", math.degrees(1.0))):
        share = accuracy.get(f"{name}_share", 0.0) if is_layered else 0.0
        if name in accuracy:
            parts.append(f"{factor * accuracy[name]:g} {unit}" + (f" + {100.0 * share:g} %" if share else ""))
    if is_layered and "depth" in accuracy:
        parts.append(f"{1e3 * accuracy['depth']:g} mm of depth")
    stated = [f"{list_text(parts)} for {share_text(accuracy['share'])}"] if parts else []
    if is_layered and accuracy.get("status_share", 1.0) < 1.0:
        stated.append(f"another status for at most {100.0 * accuracy['status_share']:g} %")
    of_answer = {name: accuracy[name] for name in ("base_perforated", "mean_velocity") if name in accuracy}
    stated += [f"{100.0 * bound:g} {UNITS[f'{name}_error'][0]}" for name, bound in of_answer.items()]
    name = "the campaign" if given.get("accuracy") else "the answer" if of_answer else given["fidelity"]
    within = "within" if attributes[attr.TOLERANCE_MET] else "beyond"
    return f"{within} the tolerance of {name} ({list_text(stated)}); estimated errors: {errors_text(attributes)}"


def exceeds_tolerance(dataset: xarray.Dataset) -> bool:
    """Whether the numerics of a result err by more than their tolerance."""
    return bool(dataset.attrs.get(attr.TOLERANCE_MET) == 0)


def numerics_note(result: Result) -> str:
    """How the shift of a result's numbers by the numerics is known, or why it is unknown."""
    dataset = as_dataset(result)
    if hits := len(node_places(result, FINER)):
        return f"numerics ±: from {count_text(hits, 'hit')}, also computed at a finer level."
    why = "the result has no hits at a finer level"
    if FINER in as_tree(result).children:
        why = "none of these hits was also computed at a finer level"
    elif attr.NUMERICS_GIVEN in dataset.attrs and attr.RESOLUTION not in dataset.attrs:
        given = json.loads(dataset.attrs[attr.NUMERICS_GIVEN])
        fixed = ("level", "time_step", "travel", "patches_axial", "patches_around", "grid_spacing")
        key = next((name for name in fixed if given.get(name) is not None), "scheme")
        why = f"numerics.{key} fixes the level; give numerics.fidelity instead"
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
            f"A choice of {count_text(dataset.sizes['hit'], 'hit')} of a larger result. The numbers describe it "
            "alone. Intervals are those of independent shots."
        )
    return _SAMPLINGS.get(attributes.get(attr.SAMPLING, ""), "") if attributes.get(attr.REPLICATES, 1) == 1 else ""


_STOP_REASONS = {
    "half_width": "the half width is reached",
    "numerics": "the numerics keep the half width out of reach of max_count hits; give a finer numerics.fidelity",
    "max_count": "max_count hits came before the half width",
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
        f"{100.0 * attributes[attr.CONFIDENCE]:.4g} % interval {interval}{unit.suffix}, numerics ± {numerics}; "
        f"{_STOP_REASONS[attributes[attr.STOP_REASON]]}"
    ]


def range_note(datasets: Iterable[Result], file: str = "") -> list[str]:
    """A line on whether results lie in the tested range; empty where that is unknown.

    Args:
        file: the file of a single result, which `inspect` shows with the details.
    """
    texts = [
        dataset.attrs[attr.OUTSIDE_TESTED_RANGE] for dataset in datasets if attr.OUTSIDE_TESTED_RANGE in dataset.attrs
    ]
    line = range_line(sentence for text in texts for sentence in json.loads(text))
    return [line + f" Details: warpimpact inspect {file}" * bool(file and "Outside" in line)] if texts else []
