"""Plates under several impacts: which one holds best at which angle, and against which threat."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import pandas as pd
import xarray

from warpimpact.analysis.comparison import (
    Comparison,
    check_same,
    compare,
    comparison_view,
    deciding_measure,
    rank_text,
    short_view,
    undecided_before,
    verdict_of,
)
from warpimpact.analysis.numbers import View, rows_of, value_text
from warpimpact.analysis.same_shots import shot_conditions
from warpimpact.errors import ResultError
from warpimpact.measures.references import Result, as_dataset
from warpimpact.records import variables as v
from warpimpact.results.dataset import outlines
from warpimpact.scene.quantities import BY_LAYER
from warpimpact.scene.units import list_text

_LAW = ("resistance", "shear_coefficient")
"""Keys of a layer that the catalogue chooses by threat and angle."""
_MOST_NAMED = 3
"""Most inputs that are named where two results differ."""


def compare_by_impact(
    results: Sequence[Result],
    names: Sequence[str],
    texts: Sequence[str] = (),
    *,
    references: Collection[str] = (),
    confidence: float = 0.95,
) -> dict[str, Comparison]:
    """Compare plates under each of several impacts: angles, velocities, threats.

    Args:
        results: those of two plates or more under every impact. Layers of the same shape and materials are the same
            plate.
        names: their names. A plate under several impacts has the words that its results share, so `slots` of `slots_0`
            and `slots_30`.
        texts, references, confidence: as in `compare`.

    Returns:
        By the text of the impact, such as "30°", the comparison of the plates; one alone if all impacts are the same.

    Raises:
        ResultError: as in `compare`; or a plate is alone under its impact.
    """
    datasets = [*map(as_dataset, results)]
    questions = [shot_conditions(dataset, name) for dataset, name in zip(datasets, names, strict=True)]
    outputs = [{key: part for key, part in one.items() if key not in ("core", "impact")} for one in questions]
    check_same(outputs, names)
    inputs = [one["core"] | one["impact"] for one in questions]
    differing = _differing(inputs)
    impacts = [", ".join(_input_text(key, one.get(key)) for key in differing) for one in inputs]
    if len(set(impacts)) == 1:
        return {
            impacts[0]: compare(
                dict(zip(names, results, strict=True)), texts, references=references, confidence=confidence
            )
        }
    plates = _plate_names(datasets, names, impacts)
    groups: dict[str, dict[str, Result]] = {impact: {} for impact in impacts}
    for impact, plate, result in zip(impacts, plates, results, strict=True):
        groups[impact][plate] = result
    for impact, group in groups.items():
        if len(group) < 2:
            place = impacts.index(impact)
            other = next(k for k in range(len(impacts)) if impacts[k] != impact)
            raise ResultError(
                f"{names[place]} and {names[other]} differ in {_difference_text(inputs[place], inputs[other])}. "
                "Give plates under the same impact, or two or more under each impact."
            )
    return {impact: compare(group, texts, confidence=confidence) for impact, group in groups.items()}


def _differing(inputs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Inputs of core and impact that are not the same; a threat stands for its core and velocity."""
    keys = dict.fromkeys(key for one in inputs for key in one)
    differing = [key for key in keys if len({json.dumps(one.get(key)) for one in inputs}) > 1]
    if "threat" in differing and all(one.get("threat") for one in inputs):
        shot = {variable.field for variable in v.SHOT_VARIABLES} - {"velocity"}
        return ["threat", *(key for key in differing if key in shot)]
    return differing


def _difference_text(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """The inputs in which two results differ, with both values: the first few."""
    keys = _differing([one, other])[:_MOST_NAMED]
    return list_text(
        [
            f"{key.replace('_', ' ')} ({' and '.join(_value_text(key, of.get(key)) for of in (one, other))})"
            for key in keys
        ]
    )


def _value_text(key: str, value: object) -> str:
    angle = re.fullmatch(r"(\S+) deg", str(value))
    text = "none" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"{float(angle[1]):.4g}°" if angle else f"{text} m/s" if key == "velocity" else text


def _input_text(key: str, value: object) -> str:
    text = _value_text(key, value)
    return text if key in ("obliquity", "threat", "velocity") else f"{key.replace('_', ' ')} {text}"


def _plate_names(datasets: Sequence[xarray.Dataset], names: Sequence[str], impacts: Sequence[str]) -> list[str]:
    """The name of the plate of each result, which all results of this plate have."""
    plates = [_layers_text(dataset, with_law=False) for dataset in datasets]
    if len({*zip(impacts, plates, strict=True)}) < len(datasets):
        plates = [_layers_text(dataset, with_law=True) for dataset in datasets]
    if len({*zip(impacts, plates, strict=True)}) < len(datasets):
        raise ResultError(f"{', '.join(names)}: two results are of the same plate under the same impact; give one")
    words = [re.split(r"[\W_]+", name) for name in names]
    by_plate = dict[str, str]()
    for plate in dict.fromkeys(plates):
        own = [k for k, other in enumerate(plates) if other == plate]
        shared = [word for word in words[own[0]] if all(word in words[k] for k in own)]
        short = " ".join(word for word in shared if not all(word in other for other in words))
        alike = len({names[k] for k in own}) == 1
        by_plate[plate] = names[own[0]] if alike or not short or short in by_plate.values() else short
    return [by_plate[plate] for plate in plates]


def _layers_text(dataset: xarray.Dataset, *, with_law: bool) -> str:
    """What makes two plates the same: numbers, materials and holes of all layers, as text."""
    numbers = {}
    for name, column in dataset.variables.items():
        of_plate = str(name).startswith(("layer_", "pattern_", "size_")) or name in (*BY_LAYER, "material", "density")
        if of_plate and (with_law or str(name).removeprefix("layer_") not in _LAW):
            constant = column.dims in ((), ("layer",))
            numbers[str(name)] = column.values.tolist() if constant else column.attrs.get("distribution")
    holes = [outlines(dataset, layer)[0].tolist() for layer in range(dataset.sizes.get("layer", 1))]
    return json.dumps([numbers, holes])


def impact_view(comparisons: Mapping[str, Comparison], notes: Sequence[str] = ()) -> View:
    """Plates × impacts by the deciding measure: value, range and rank, and a verdict in a sentence; of one impact the
    short view of its comparison."""
    if len(comparisons) == 1:
        return short_view(next(iter(comparisons.values())), notes)
    measure = deciding_measure(*comparisons.values())
    if measure is None:
        return {"": ["no measure ranks these plates under every impact", *notes]}
    names = dict.fromkeys(name for comparison in comparisons.values() for name in comparison.plates.index)
    weights = pd.concat([comparison.plates.areal_density for comparison in comparisons.values()])
    table = pd.DataFrame({"kg/m²": [f"{weights[[name]].iloc[0]:.2f}" for name in names]}, pd.Index(names, name="plate"))
    for impact, comparison in comparisons.items():
        shown, ranks = comparison.scores[measure.text], comparison.ranks(measure.text)
        cells = {row.Index: value_text(measure, row.value, row.low, row.high) for row in rows_of(shown)}
        table[impact] = [cells.get(name, "-") for name in names]
        table[f"rank at {impact}"] = [rank_text(ranks[name]) if name in ranks else "-" for name in names]
    used = "; ".join(dict.fromkeys(line for comparison in comparisons.values() for line in comparison.hits_used))
    (verdict,) = verdict_by_impact(comparisons)
    verdict += undecided_before(next(iter(comparisons.values())), measure)
    return {f"{measure.title}, {measure.better}": [table, verdict, used, *notes]}


def every_view(comparisons: Mapping[str, Comparison], notes: Sequence[str] = ()) -> View:
    """Every measure under every impact."""
    if len(comparisons) == 1:
        return comparison_view(next(iter(comparisons.values())), notes)
    views = {impact: comparison_view(comparison) for impact, comparison in comparisons.items()}
    of_each = {f"{impact}: {title}": parts for impact, view in views.items() for title, parts in view.items()}
    return {**impact_view(comparisons, notes), **of_each}


def verdict_by_impact(comparisons: Mapping[str, Comparison]) -> list[str]:
    """A sentence: which plates are best under which impact, and which under all of them; empty where none decides."""
    if len(comparisons) == 1:
        return verdict_of(*comparisons.values())
    if (measure := deciding_measure(*comparisons.values())) is None:
        return []
    firsts = {impact: comparison.first(measure.text) for impact, comparison in comparisons.items()}
    parts = [
        f"{' or '.join(first)} best at {impact}"
        if len(first) < len(comparisons[impact].plates)
        else f"{list_text(first)} cannot be told apart at {impact}"
        for impact, first in firsts.items()
    ]
    best = [name for name in next(iter(firsts.values())) if all(name in first for first in firsts.values())]
    whole = "both" if len(firsts) == 2 else "all"
    if len(best) == 1 and all(first == best for first in firsts.values()):
        return [f"{best[0]} best at {whole}."]
    at_all = f"no plate is best at {whole}" if not best else f"{list_text(best)} may be best at {whole}"
    return [f"{', '.join(parts)}; {at_all}."]
