"""What a result says: its answer in a few lines, and its contents: origin, numbers, accuracy, failures."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.correction import (
    has_draws,
    has_elements,
    interval_of,
    passing,
    provenance_table,
    touching_note,
    trust_note,
    width_note,
)
from warpimpact.analysis.effectiveness import effectiveness_view, plate_numbers, reference_name, weights_of
from warpimpact.analysis.numbers import ROUNDING, View, interval_text, number_text
from warpimpact.campaign.evidence import range_line
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import difference_of_draws
from warpimpact.measures.estimates import estimated, means_of, measure_data, slices, status_shares
from warpimpact.measures.hits import failed, hit_numbers, is_choice, shot_variables
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import (
    ELEMENTS,
    FINER,
    Result,
    as_dataset,
    as_tree,
    node_places,
    reference_result,
)
from warpimpact.measures.vocabulary import has_base
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.units import STORED, count_text, list_text
from warpimpact.solver.accuracy import UNITS, errors_text, share_text
from warpimpact.statistics.intervals import Estimate

CAVEAT = "The results rank plates and show tendencies. They do not certify protection."
_BROKEN = Measure.parse("P(broken)")
_QUANTILES = (0.05, 0.5, 0.95)
_PASSED = "These numbers count the cores that passed."
_ARRESTED = "In the file an arrested core has the residual velocity 0."
UNKNOWN = 0.95
"""Length of the interval of a share beyond which the share is not known."""


def answer(result: Result, elements: str = "") -> list[str | pd.DataFrame]:
    """The answer of a map of hits: what was shot at what, how many bullets pass, and where that comes from.

    Args:
        elements: a sentence on what a correction by finite elements takes, or needs.
    """
    dataset = as_dataset(result)
    scene = dataset.attrs.get(attr.SCENE, dataset.attrs.get(attr.TITLE, "untitled"))
    lines: list[str | pd.DataFrame] = [f"{scene}.", _verdict(result)]
    if has_elements(result):
        measures = [passing(dataset), *([] if has_base(dataset) else _means_behind(dataset))]
        basis = f"By the fast law and {count_text(len(node_places(result, ELEMENTS)), 'hit')} by finite elements."
        lines.append(" ".join([basis, *(trust_note(result) or width_note(result, measures))]))
    elif attr.CONTINUUM not in dataset.attrs:
        lines.append(f"{law_line()} {elements}".strip())
    if exceeds_tolerance(dataset):
        errors = errors_text(dataset.attrs)
        level = json.loads(dataset.attrs[attr.RESOLUTION])["level"]
        remedy = f"To see what that moves, run with numerics.level = {level + 2} and compare both results."
        lines.append(f"The numerics err by {errors}, more than their tolerance. {remedy}")
    return [*lines, *touching_note(dataset), *stop_lines(result), *range_note([dataset])]


def law_line() -> str:
    """A sentence on numbers by the fast law alone."""
    return "By the fast law alone."


def _means_behind(dataset: xarray.Dataset) -> list[Measure]:
    """The mean residual velocity, and the mean tilt farthest behind the plate."""
    standoffs = dataset[v.STANDOFF].values.tolist()
    angle = f"tilt@{standoffs[-1]!r}m" if standoffs else v.DEFLECTION
    return [Measure.parse(f"mean({v.RESIDUAL_VELOCITY})"), Measure.parse(f"mean({angle})")]


def _verdict(result: Result) -> str:
    """How many bullets pass the base, behind the add-on, behind the solid one, and without one; without a base, how
    many pass, and with which velocity and tilt; how many break, and how many shots failed, where some do."""
    dataset, ends = as_dataset(result), ""
    if v.BROKEN in dataset:
        broken = share_words(estimated(result, [_BROKEN])[_BROKEN])
        ends += f"; {broken} {'of the cores' if '%' in broken else 'cores'} break"
    if bad := int(failed(dataset).sum()):
        ends += f"; {count_text(bad, 'shot')} failed"
    measure = passing(dataset)
    share = estimated(result, [measure])[measure]
    what, how_many = "pass the base" if has_base(dataset) else "pass", share_words(share)
    whose = "of the bullets" if "%" in how_many else "bullets"
    passed = f"{how_many[0].upper()}{how_many[1:]} {whose} {what}"
    if math.isnan(share.value):
        passed = f"How many bullets {what} is not known"
    elif share.high - share.low > UNKNOWN:
        passed = f"How many bullets {what} is not known: {how_many}"
    if _is_open(share):
        passed += f" (best estimate {_percent(share.value)})"
    if has_base(dataset):
        return f"{passed}{_behind_references(result, measure)}{ends}."
    if share.value > 0.0:
        means = [
            f"a mean {one.column.label} of {interval_of(one, mean, one.display.suffix)}"
            for one, mean in estimated(result, _means_behind(dataset)).items()
        ]
        passed += f"; those that pass have {' and '.join(means)}"
    return f"{passed}{ends}."


def _behind_references(result: Result, measure: Measure) -> str:
    """How many bullets pass the base behind the solid add-on and without one, and which add-on lets fewer pass."""
    dataset, parts = as_dataset(result), list[str]()
    names = {"solid": f"behind the {reference_name(dataset)} of the same weight", "base_alone": "without add-on"}
    for name, where in names.items():
        if (reference := reference_result(result, name)) is not None:
            share = estimated(reference, [measure])[measure]
            words = _percent(share.value) if math.isnan(share.low) else share_words(share)  # one hit stands for all
            parts.append(f"; {where} {words}" + f" ({_percent(share.value)})" * _is_open(share))
    return "".join(parts) + _against_solid(result, measure)


def _against_solid(result: Result, measure: Measure) -> str:
    """A sentence on the difference to the solid add-on, where both have draws."""
    solid, name = reference_result(result, "solid"), reference_name(as_dataset(result))
    if solid is None:
        return ""
    drawn = [next(measure_data(one, [measure])).draws for one in (result, solid)]
    if drawn[0] is None or drawn[1] is None:
        return ""
    difference = difference_of_draws(drawn[0], drawn[1])
    if difference.low <= 0.0 <= difference.high:
        return f". This target cannot be told apart from the {name}"
    return f". {'Fewer' if difference.high < 0.0 else 'More'} pass than behind the {name}"


def share_words(share: Estimate) -> str:
    """How many of all, in words that the interval carries."""
    if math.isnan(share.value):
        return "not known"
    if math.isnan(share.low) or math.isnan(share.high):
        return f"{share.value * share.count:.0f} of {share.count}"
    low, high = math.floor(100.0 * share.low + ROUNDING), math.ceil(100.0 * share.high - ROUNDING)
    if low == high:
        return f"{low} %"
    if _is_open(share):
        return f"between {low} and {high} %"
    return f"over {min(low, 99)} %" if high == 100 else f"under {max(high, 1)} %"


def _is_open(share: Estimate) -> bool:
    """Whether both ends of the interval of a share say something, beside the best estimate."""
    is_end = (share.value > 0.995 and share.low > 0.9) or (share.value < 0.005 and share.high < 0.1)
    return share.high > share.low and not is_end


def _percent(share: float) -> str:
    """A share in whole percent that is 0 or 100 % only where no or every bullet counts."""
    return "under 1 %" if 0.0 < share < 0.005 else "over 99 %" if 0.995 < share < 1.0 else f"{100.0 * share:.0f} %"


def inspect_view(result: Result) -> View:
    """All information on a hit map. Of an open file only a part is in memory at a time."""
    dataset = as_dataset(result)
    return {
        str(dataset.attrs.get(attr.TITLE, "untitled")): _origin(dataset),
        "how the shots ended": [_statuses(result)],
        **_numbers(result),
        **effectiveness_view(result),
        "where it comes from": provenance_table(result),
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


def _statuses(result: Result) -> pd.DataFrame:
    """Shares of the shots that ended, with intervals."""
    rows = {
        name: (f"{share.value:.2%}", interval_text(share.low, share.high, digits=".2%"))
        for name, share in status_shares(result).items()
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=["share", "95 % interval"]).rename_axis("status")


def _numbers(result: Result) -> View:
    """Means and quantiles of the cores that passed the plate, or the target, with intervals."""
    dataset = as_dataset(result)
    what = "target" if v.LAYER_STATUS in dataset else "plate"
    measures = list[Measure]()
    for mean in means_of(dataset, v.shown_by("inspect")):
        name = mean.text.removeprefix("mean(").removesuffix(")")
        measures += [mean, *(Measure.parse(f"quantile({name}, {share})") for share in _QUANTILES)]
    rows = {
        measure.title: (
            number_text(one.value, ".2f"),
            interval_text(one.low, one.high, math.nan if has_draws(result) else one.numerics, ".2f"),
            number_text(one.spread, ".2f") if measure.kind == "mean" else "",
        )
        for measure, one in estimated(result, measures).items()
        if one.count
    }
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["value", "95 % interval", "spread"])
    if not rows:
        return {f"no core passed the {what}": stop_lines(result)}
    counted = f"{_PASSED} {'' if has_draws(result) else _ARRESTED}".strip()
    notes = filter(None, (counted, sampling_note(result), numerics_note(result)))
    return {f"cores that passed the {what}": [table, *notes, *stop_lines(result)]}


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
    """How the shift of a result's numbers by the numerics is known, or why it is unknown; empty with draws, whose
    errors are larger."""
    dataset = as_dataset(result)
    if has_draws(result):
        return ""
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


def sampling_note(result: Result) -> str:
    """A note on the intervals of a result that its sampling needs, or none."""
    dataset = as_dataset(result)
    attributes = dataset.attrs
    if is_choice(dataset):
        return (
            f"A choice of {count_text(dataset.sizes['hit'], 'hit')} of a larger result. The numbers describe it "
            "alone. Intervals are those of independent shots."
        )
    sampling = attributes.get(attr.SAMPLING, "")
    if attributes.get(attr.REPLICATES, 1) > 1 or (sampling == "sobol" and has_draws(result)):
        return ""
    return _SAMPLINGS.get(sampling, "")


_STOP_REASONS = {
    "half_width": "the half width is reached",
    "numerics": "the numerics keep the half width out of reach of max_count hits; give a finer numerics.fidelity",
    "max_count": "max_count hits came before the half width",
}


def stop_lines(result: Result) -> list[str]:
    """Why the stop rule ended, and its estimate where that is by all that is known; empty without a stop rule."""
    attributes = as_dataset(result).attrs
    if attr.STOP_QUANTITY not in attributes:
        return []
    if has_draws(result):
        quantity, reason = attributes[attr.STOP_QUANTITY], _STOP_REASONS[attributes[attr.STOP_REASON]]
        return [f"The hits ended by the fast law's {quantity}: {reason}."]
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
