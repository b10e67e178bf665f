"""Plates side by side: which protects better, by how much, and whether the hits show a difference.

Shot k hits every plate at the same place of its unit cell under the same conditions. What the shots have in common then
cancels in the differences (common random numbers), which are means of differences shot by shot with their intervals
(statistics/intervals.py). Where one plate has more hits, the first ones are paired and the others count, too. Plates
that were hit by different shots are compared as independent (statistics/comparisons.py). No hit is left out.

Plates of different weight are compared by their ratios to the solid plate of the same areal density.

The intervals of all pairs of plates hold together, for each measure on its own: each has its share of the error
(Bonferroni). They include the shift of both plates by the numerics and by the tolerance of a limit. Two plates are told
apart where the interval of their difference excludes 0 by more than rounding.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray

from warpimpact.analysis.comparison_text import Comparison, Difference, Pair, PlateScore
from warpimpact.analysis.effectiveness import Score, ScoreData, depth_note, measures_of, scores
from warpimpact.analysis.numbers import of_each
from warpimpact.analysis.plate_text import common_name, plate_text, reference_name, solid_note, solid_plate, weights_of
from warpimpact.analysis.summary import breaks_promise, hits_at_two_levels, sampling_note
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.measures import Measure, dealing, estimate_from
from warpimpact.results.vocabulary import base_thickness, has_base
from warpimpact.runs.parts import first_difference
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.statistics.comparisons import (
    ROUNDED,
    Ratio,
    confidence_of_each,
    difference_numbers,
    difference_of_independent,
    ratio_numbers,
)
from warpimpact.statistics.intervals import Array, Estimate, Estimating, estimate_of

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""
_ANGLES = ("obliquity", "azimuth", "pitch", "yaw")
_SAME_WEIGHT = 1.01
"""Largest ratio of the areal densities of plates that count as equally heavy."""


def compare(
    datasets: Sequence[xarray.Dataset],
    names: Sequence[str],
    texts: Sequence[str] = (),
    *,
    confidence: float = 0.95,
) -> Comparison:
    """Compare the plates of some hit maps, by all their hits.

    Args:
        datasets: two or more, with the same core and impact. Of open files one number per hit is in memory.
        names: names of the plates, each once.
        texts: texts of measures; by default the measures that `inspect` shows for all the plates.
        confidence: confidence of all differences in a measure together.

    Raises:
        ResultError: core, impact or stand-offs differ, so that the question is not the same; or a plate lacks what a
            measure needs.
    """
    for dataset, name in zip(datasets[1:], names[1:], strict=True):
        _check_same_question(datasets[0], names[0], dataset, name)
    pairs = list(combinations(range(len(datasets)), 2))
    used = [_used(datasets[i], names[i], datasets[j], names[j]) for i, j in pairs]
    asked = [measures_of(dataset, texts) for dataset in datasets]
    common = set.intersection(*({measure.quantity.name for measure in measures} for measures in asked))
    differ_in_weight, by_ratio = _differ_in_weight(datasets), set()
    of_each_pair = confidence_of_each(confidence, len(pairs))
    of_plates: list[list[Score]] = [[] for _ in datasets]
    differences = list[Difference]()
    for scored in zip(
        *(
            scores(dataset, [measure for measure in measures if measure.quantity.name in common])
            for dataset, measures in zip(datasets, asked, strict=True)
        ),
        strict=True,
    ):
        for plate, side in zip(of_plates, scored, strict=True):
            plate.append(side.score)
        measure = scored[0].score.measure
        if not measure.has_interval or (measure.name == "base_depth" and _depths_are_bounds(datasets, of_plates)):
            continue
        has_ratios = scored[0].data.numbers is not None and not any(math.isnan(side.score.ratio) for side in scored)
        if differ_in_weight and has_ratios:
            by_ratio.add(measure.text)
        for (i, j), pair in zip(pairs, used, strict=True):
            both, sides, is_ratio = (datasets[i], datasets[j]), (scored[i], scored[j]), measure.text in by_ratio
            paired = not pair.independent and measure.kind != "quantile"
            interval = _apart(sides, both, of_each_pair, by_ratio=is_ratio, paired=paired)
            differences.append(Difference(measure.text, names[i], names[j], *interval))
    plates = tuple(
        PlateScore(
            name,
            dataset.sizes["hit"],
            dataset.attrs[attr.AREAL_DENSITY],
            dataset.attrs[attr.OPEN_AREA],
            tuple(plate),
            solid_plate(dataset),
            reference_name(dataset),
            weights_of(dataset),
        )
        for name, dataset, plate in zip(names, datasets, of_plates, strict=True)
    )
    at_equal_weight = frozenset(by_ratio) if differ_in_weight else None
    cautions = dict(_cautions(datasets, names))
    notes = (
        *(*_weights(datasets, names), *cautions.values()),
        *(*_notes(datasets, names), *_notes_of_bases(datasets, plates)),
    )
    return Comparison(plates, tuple(differences), tuple(used), at_equal_weight, confidence, notes, tuple(cautions))


def _apart(
    scored: tuple[ScoreData, ScoreData],
    datasets: tuple[xarray.Dataset, xarray.Dataset],
    confidence: float,
    *,
    by_ratio: bool,
    paired: bool,
) -> tuple[float, float, float]:
    """Difference of two plates with its interval, widened by the shift of both by the numerics. Rounding counts as
    0."""
    dealt = [Estimating(**dealing(dataset), confidence=confidence) for dataset in datasets]
    side, other = (_side(*given, by_ratio=by_ratio) for given in zip(scored, datasets, dealt, strict=True))
    value, low, high = _difference(side, other, dealt[0], paired=paired)
    shift = (side.estimate.numerics or 0.0) + (other.estimate.numerics or 0.0)
    rounded = ROUNDED * max(abs(side.estimate.value), abs(other.estimate.value))
    value, low, high = (0.0 if abs(end) <= rounded else end for end in (value, low - shift, high + shift))
    return value, low, high


def _differ_in_weight(datasets: Sequence[xarray.Dataset]) -> bool:
    """Whether the weights count and differ. In a search of thickness the limit itself is a weight."""
    densities = [dataset.attrs[attr.AREAL_DENSITY] for dataset in datasets]
    return datasets[0].attrs.get(attr.LIMIT) != "thickness" and max(densities) > _SAME_WEIGHT * min(densities)


def _depths_are_bounds(datasets: Sequence[xarray.Dataset], measures: Sequence[Sequence[Score]]) -> bool:
    """Whether depths cannot be ranked: cores pierce a base and count as its thickness, and the thicknesses differ."""
    thicknesses = [float(np.mean(base_thickness(dataset))) for dataset in datasets]
    return max(thicknesses) > _SAME_WEIGHT * min(thicknesses) and any(map(depth_note, measures))


def _notes_of_bases(datasets: Sequence[xarray.Dataset], plates: Sequence[PlateScore]) -> Iterator[str]:
    """Notes on the bases behind the plates."""
    based = [has_base(dataset) for dataset in datasets]
    if any(based) and not all(based) and attr.LIMIT not in datasets[0].attrs:
        alone = [plate.name for plate, is_based in zip(plates, based, strict=True) if not is_based]
        yield f"Without layers, and so without a base: {', '.join(alone)}. Measures of a base are left out."
        return
    measures = [plate.measures for plate in plates]
    if all(based) and _depths_are_bounds(datasets, measures):
        yield (
            "Cores pierce a base and count with its thickness as depth. The bases differ in thickness, so depths are "
            "not ranked."
        )
    elif any(
        notes := [f"{plate.name}: {depth_note(plate.measures)}" for plate in plates if depth_note(plate.measures)]
    ):
        yield from notes


def _used(result: xarray.Dataset, name: str, other: xarray.Dataset, other_name: str) -> Pair:
    """How the hits of two results are used."""
    common = min(result.sizes["hit"], other.sizes["hit"])
    why = _other_shots(result.isel(hit=slice(common)), other.isel(hit=slice(common)))
    return Pair(name, other_name, 0 if why else common, why)


class _Side(NamedTuple):
    """What is compared of a plate: whether it is a share or follows from one; whether it is a ratio to the solid plate;
    numbers whose mean it is; and its estimate, with the shift by the numerics."""

    is_share: bool
    by_ratio: bool
    numbers: Array
    estimate: Estimate


def _sought_to(dataset: xarray.Dataset, measure: Measure) -> float:
    """Largest distance of a limit in a result from the stated one, in the unit of the measure; 0 for other results, and
    for a share, where it is unknown."""
    attributes = dataset.attrs
    if measure.is_binary:
        return 0.0
    factor = (
        attributes.get(attr.LIMIT_DENSITY, 0.0) if measure.name == "limit_areal_density" else measure.display.factor
    )
    return float(attributes.get(attr.LIMIT_TOLERANCE, 0.0) * factor)


def _side(scored: ScoreData, dataset: xarray.Dataset, dealt: Estimating, *, by_ratio: bool) -> _Side:
    score, measure, data = scored.score, scored.score.measure, scored.data
    shift = float(np.nan_to_num(score.numerics or 0.0)) + _sought_to(dataset, measure)
    estimate = replace(estimate_from(measure, data.values, **dealt), numerics=shift)
    numbers = data.values if data.numbers is None else data.numbers
    if not by_ratio:
        return _Side(measure.is_binary, False, numbers, estimate)
    assert scored.solid is not None
    ratio = Ratio.of(estimate, numbers, scored.solid, dealt)
    numbers = ratio_numbers(numbers, scored.solid, ratio.value)
    estimate = replace(estimate, value=ratio.value, low=ratio.low, high=ratio.high, numerics=shift / ratio.reference)
    return _Side(measure.is_binary, True, numbers, estimate)


def _difference(side: _Side, other: _Side, dealt: Estimating, *, paired: bool) -> tuple[float, float, float]:
    """Difference of two plates and its interval; NaN where there is none."""
    a, b = side.estimate, other.estimate
    independent = a.value - b.value, *difference_of_independent(a, b)
    if not paired:
        return independent
    numbers = difference_numbers(side.numbers, other.numbers)
    matched = side.is_share and not side.by_ratio and len(side.numbers) == len(other.numbers)
    estimate = estimate_of("difference" if matched else "mean", numbers, **dealt)
    if math.isnan(a.low + b.low):
        return estimate.value, math.nan, math.nan
    if side.is_share and estimate.half_width == 0.0 and a.half_width + b.half_width > 0.0:
        return independent  # if shares agree in every shot, their difference is no more certain than the shares
    return estimate.value, estimate.low, estimate.high


def _weights(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[str]:
    if _differ_in_weight(datasets):
        weights = of_each(names, [plate_text(dataset).removeprefix(", ").rpartition(",")[0] for dataset in datasets])
        reference = common_name(map(reference_name, datasets))
        yield (
            f"The plates differ in weight ({weights}). They are ranked by the ratio to the {reference} of the same "
            "areal density; a measure without that ratio says so."
        )


def _cautions(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What the ranks do not consider, in a few words and in a sentence."""
    if len({d.attrs.get(attr.LAYERS, "") for d in datasets}) > 1:
        yield "layers", "The targets differ in the layers behind the plate."
    if differences := "; ".join(_materials(datasets, names)):
        yield "material", f"The plates differ in material, which no ranking allows for: {differences}."
    texts = [dataset.attrs[attr.NUMERICS_GIVEN] for dataset in datasets if attr.NUMERICS_GIVEN in dataset.attrs]
    asked = [json.loads(text) for text in texts]
    differing = (first_difference(first, other) for first, other in pairwise(asked))
    if (caution := next(filter(None, differing), None)) is not None:
        yield (
            "different numerics",
            "The plates were computed with different numerics: {} is {} and {}.".format(*caution),
        )
    if broken := [name for name, dataset in zip(names, datasets, strict=True) if breaks_promise(dataset)]:
        sentence = f"The numerics are less exact than promised: {', '.join(broken)} (warpimpact inspect)."
        yield "numerics less exact than promised", sentence
    if unknown := [name for name, dataset in zip(names, datasets, strict=True) if not hits_at_two_levels(dataset)]:
        sentence = f"numerics ± is not known of {', '.join(unknown)}: intervals are by the hits alone"
        yield "the error of the numerics", f"{sentence} (warpimpact inspect)."


def _notes(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[str]:
    solid = {name: solid_note(dataset) for name, dataset in zip(names, datasets, strict=True)}
    alike = len(set(solid.values())) == 1
    yield from dict.fromkeys(note if alike else f"{name}: {note}" for name, note in solid.items() if note)
    yield from dict.fromkeys(filter(None, map(sampling_note, datasets)))


def _materials(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[str]:
    """Quantities in which the materials differ, with the value of every plate that has one."""
    materials = {
        name: json.loads(d.attrs[attr.MATERIAL])
        for name, d in zip(names, datasets, strict=True)
        if attr.MATERIAL in d.attrs
    }
    for quantity in dict.fromkeys(key for material in materials.values() for key in material):
        values = {name: material.get(quantity) for name, material in materials.items()}
        if len(set(values.values())) > 1:
            read = reader_of(QUANTITIES[quantity].type).text if quantity in QUANTITIES else "{:g}".format
            shown = [
                "not given" if value is None else value if isinstance(value, str) else read(value)
                for value in values.values()
            ]
            yield f"{quantity} ({of_each(list(values), shown)})"


def _check_same_question(result: xarray.Dataset, name: str, other: xarray.Dataset, other_name: str) -> None:
    """Refuse results with another core, impact or stand-offs.

    Raises:
        ResultError: the message names the first difference.
    """
    asked, asked_other = _question(result, name), _question(other, other_name)
    if (mismatch := first_difference(asked, asked_other)) is not None:
        place, was, now = mismatch
        raise ResultError(f"{other_name}: cannot be compared with {name}: {place} is {now} here and {was} there")


def _question(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    """What must be the same for plates to be compared."""
    attributes = dataset.attrs
    if not {attr.CORE, attr.IMPACT} <= attributes.keys():
        raise ResultError(f"{name}: has no description of its core and impact, which a comparison needs; run it again")
    output = {"standoffs": dataset[v.STANDOFF].values.tolist(), "standoff_point": attributes[attr.STANDOFF_POINT]}
    limit = {"limit": attributes[attr.LIMIT]} if attr.LIMIT in attributes else {}
    return limit | {
        "core": json.loads(attributes[attr.CORE]),
        "impact": _in_degrees(json.loads(attributes[attr.IMPACT])),
        "output": output,
    }


def _in_degrees(impact: dict[str, Any]) -> dict[str, Any]:
    """An impact whose angles in numbers are in degrees."""
    return {
        name: f"{math.degrees(value)!r} deg" if name in _ANGLES and isinstance(value, float) else value
        for name, value in impact.items()
    }


def _other_shots(result: xarray.Dataset, other: xarray.Dataset) -> str:
    """Why the shots of two results differ; empty where they are the same."""
    if dealing(result) != dealing(other):
        return "their shots have other replicates"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (
            dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (result, other)
        )
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return "their shots hit other places of the cell"
    for name in (*v.SHOT_VARIABLES, v.MASS):
        if name in result and not (name in other and np.array_equal(result[name], other[name])):
            return f"their shots differ in {name}"
    return ""
