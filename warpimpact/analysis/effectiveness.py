"""How well a plate protects: measures of a result and of the solid plate of equal areal density.

All numbers have the intervals of statistics/intervals.py, and their ratios to the solid plate those of
statistics/comparisons.py. The solid plate, the weights and the holes have their texts here, too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.estimates import MeasureData, by_hit_of, estimated, measure_data, measures_named
from warpimpact.analysis.numbers import View, interval_text, rows_of, text_of
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure, estimate_from, sampling_design
from warpimpact.results.references import reference as reference_of
from warpimpact.results.references import references_of
from warpimpact.results.vocabulary import Array
from warpimpact.statistics.comparisons import Ratio


def _three(quantity: str) -> tuple[str, ...]:
    return f"mean({quantity})", f"worst_tenth({quantity})", f"worst_point({quantity})"


PIERCED = "P(base_pierced)"
SHOWN = (
    *("P(base_perforated)", PIERCED, *_three("base_depth")),
    *(*_three("residual_energy_fraction"), *_three("residual_energy_density")),
    *("P(inclination > 30 deg)", "P(stopped)", "P(broken)", "P(stopped_or_broken)"),
)
"""Default measures of a map of hits, as far as the result has them."""
SHOWN_OF_LIMITS = (
    *("V50", "V05", *_three("limit_velocity")[1:], "H50", "H05", *_three("limit_thickness")[1:]),
    *("quantile(limit_areal_density, 0.5)", *_three("limit_areal_density")[1:]),
)
"""Default measures of a search of limits. A target is as good as its V50, not as the mean of its limits."""


@dataclass(frozen=True)
class Score:
    """A measure of a plate and of its references, in the display unit; NaN where something does not exist.

    Attributes:
        data: the measure with its estimate, and the numbers of the shots behind it.
        solid: numbers of the first shots at the solid reference, whose mean is its measure; None where there are none.
        ratio: value of the solid reference, and the ratio of the measure to it.
        alone: value of the base alone.
    """

    data: MeasureData
    solid: Array | None
    ratio: Ratio
    alone: float


def measures_of(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Measure]:
    """The measures with these texts in a result; by default SHOWN or SHOWN_OF_LIMITS.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    return measures_named(dataset, texts, SHOWN_OF_LIMITS if attr.LIMIT in dataset.attrs else SHOWN)


def effectiveness(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> pd.DataFrame:
    """How well the plate of a result protects.

    Args:
        dataset: the result; of an open file, one slice at a time and one number per hit are in memory.
        texts: texts of measures; by default those that `inspect` shows.

    Returns:
        A row for each measure in its display unit, by its text, with the columns: measure; value, low and high (95 %
        interval by the hits), numerics (largest shift); solid (value of the reference), ratio to it, ratio_low and
        ratio_high; alone (value of the base alone); hit (number of a worst point, else -1).

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    rows = []
    for score in scores(dataset, measures_of(dataset, texts)):
        estimate, ratio, worst = score.data.estimate, score.ratio, score.data.worst_shot
        numerics = math.nan if estimate.numerics is None else estimate.numerics
        hit = -1 if worst is None else int(dataset[v.HIT][worst])
        rows.append(
            (score.data.measure, estimate.value, estimate.low, estimate.high, numerics, *ratio, score.alone, hit)
        )
    columns = ["measure", "value", "low", "high", "numerics", "solid", "ratio", "ratio_low", "ratio_high", "alone"]
    table = pd.DataFrame(rows, columns=[*columns, "hit"])
    return table.set_index(pd.Index([row[0].text for row in rows], name="text"))


def scores(dataset: xarray.Dataset, measures: Sequence[Measure], confidence: float = 0.95) -> Iterator[Score]:
    """Measures one after the other, with those of the references."""
    reference, base = (reference_of(dataset, name) for name in ("solid", "base_alone"))
    for data in measure_data(dataset, measures, confidence):
        measure, solid, alone = data.measure, None, math.nan
        if reference is not None and _is_comparable(measure, dataset, reference):
            solid = _reference_numbers(measure, reference)
        if base is not None and measure.kind != "target":
            of_base = _reference_numbers(measure, base)
            alone = float(np.nanmean(of_base)) if np.isfinite(of_base).any() else math.nan
        numbers = data.values if measure.kind in ("quantile", "worst_point", "target") else data.numbers
        ratio = Ratio.of(data.estimate, numbers, solid, {**sampling_design(dataset), "confidence": confidence})
        yield Score(data, solid, ratio, alone)


def _is_comparable(measure: Measure, dataset: xarray.Dataset, reference: xarray.Dataset) -> bool:
    """Whether the reference has the measure. A limit thickness counts only if the rest of both targets is equally
    heavy."""
    if measure.kind == "target":
        return False
    if measure.name != "limit_thickness":
        return True
    elsewhere = [float(of.attrs.get(attr.LIMIT_ELSEWHERE, 0.0)) for of in (dataset, reference)]
    same_layer = dataset.attrs.get(attr.LIMIT_LAYER) == reference.attrs.get(attr.LIMIT_LAYER)
    return same_layer and math.isclose(*elsewhere, rel_tol=1e-9)


def _reference_numbers(measure: Measure, reference: xarray.Dataset) -> Array:
    """Numbers of the shots at a reference whose mean is its measure; for a quantile or a worst point a single one."""
    values = measure.display.factor * measure.counted(by_hit_of(reference, measure))
    if measure.kind in ("quantile", "worst_point"):
        return np.array([estimate_from(measure, values).value])
    return measure.averaged(values)


def effectiveness_view(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> View:
    """The scores of `effectiveness` as a table, with notes."""
    table = effectiveness(dataset, texts)
    with_solid = table.solid.notna().any()
    notes = [depth_note(dataset), solid_note(dataset)]
    if not with_solid and attr.OPEN_AREA in dataset.attrs and attr.LIMIT not in dataset.attrs:
        notes.append(
            "There is no solid plate or add-on to compare with. warpimpact run computes it into the file, unless "
            "output.solid_reference is false."
        )
    shown = measures_table(table, reference_name(dataset) if with_solid else None)
    return {f"effectiveness{plate_text(dataset)}": [shown, *filter(None, notes)]}


def effectiveness_text(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> str:
    """The view of `effectiveness` as text."""
    return text_of(effectiveness_view(dataset, texts))


def measures_table(table: pd.DataFrame, reference: str | None = "solid plate") -> pd.DataFrame:
    """The scores of `effectiveness` to be shown, with the solid reference of this name and the base alone."""
    shown = pd.DataFrame({"value": table.value}).set_index(
        pd.Index([one.title for one in table.measure], name="measure")
    )
    shown["95 % interval"] = [
        f"at hit {row.hit}" if row.hit >= 0 else interval_text(row.low, row.high, row.numerics)
        for row in rows_of(table)
    ]
    if reference is None:
        return shown
    shown[reference], shown["ratio to it"] = table.solid.to_numpy(), table.ratio.to_numpy()
    shown["interval of the ratio"] = [
        "" if math.isnan(row.ratio_low) else interval_text(row.ratio_low, row.ratio_high, row.numerics / row.solid)
        for row in rows_of(table)
    ]
    return shown.assign(**{"base alone": table.alone.to_numpy()}) if table.alone.notna().any() else shown


def depth_note(dataset: xarray.Dataset) -> str:
    """A note on the depths in a base that some cores pierce; empty if none does."""
    pierced = Measure.parse(PIERCED)
    share = 0.0 if pierced.quantity.lacking(dataset) else estimated(dataset, [pierced])[pierced].value
    if not share > 0.0:
        return ""
    return (
        f"{share:.1%} of the cores pierce the base. They count with its thickness as depth, so the depths are lower "
        "bounds. A thicker base, a witness block, tells the depths; warpimpact limit --quantity thickness --layer N "
        "tells the thickness that each hit needs."
    )


def plate_numbers(open_area: float, ligament: float, weights: Mapping[str, float]) -> dict[str, str]:
    """Numbers of a plate as text with units, by name.

    Args:
        open_area: share of holes.
        ligament: the smallest one [m]; inf if there is none, and then it is left out.
        weights: as `Target.weights`.
    """
    numbers = {"open area": f"{open_area:.1%}"}
    if math.isfinite(ligament):
        numbers["smallest ligament"] = f"{1e3 * ligament:.2f} mm"
    return numbers | {name: f"{weight:.1f} kg/m²" for name, weight in weights.items()}


def weights_of(dataset: xarray.Dataset) -> dict[str, float]:
    """`Target.weights` of a result; only the whole weight if the file does not separate add-on and base."""
    whole = float(dataset.attrs[attr.AREAL_DENSITY])
    if attr.ADD_ON_DENSITY not in dataset.attrs:
        return {"whole target" if v.LAYER_STATUS in dataset else "areal density": whole}
    add_on = float(dataset.attrs[attr.ADD_ON_DENSITY])
    return {"add-on": add_on, "base": whole - add_on, "whole target": whole}


def weights_text(weights: Mapping[str, float], digits: str = ".1f") -> str:
    """Weights as one phrase."""
    return ", ".join(f"{name} {weight:{digits}} kg/m²" for name, weight in weights.items())


def plate_text(dataset: xarray.Dataset) -> str:
    """Weights and open area, where a result carries them."""
    if attr.AREAL_DENSITY not in dataset.attrs:
        return ""
    weights = weights_text(weights_of(dataset), ".4g").removeprefix("areal density ")
    return f", {weights}, {dataset.attrs[attr.OPEN_AREA]:.1%} open"


def reference_name(dataset: xarray.Dataset) -> str:
    """Name of the reference with which a target is compared."""
    return "solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"


def common_name(references: Iterable[str]) -> str:
    """The name that several references share, or a general one."""
    names = {*references}
    return names.pop() if len(names) == 1 else "solid reference"


def solid_plate(dataset: xarray.Dataset) -> str:
    """Thickness and material of the solid reference as a phrase; empty where unknown."""
    attributes, solid = dataset.attrs, references_of(dataset).get("solid")
    if solid is None or attr.CAMPAIGN not in solid.attrs:
        return ""
    campaign = json.loads(solid.attrs[attr.CAMPAIGN])
    plates = [campaign["plate"], *campaign["layer"]]
    plates = plates[:-1] or plates  # the last of several layers is the base
    if attr.CONTINUUM in attributes:
        materials = json.loads(attributes[attr.CONTINUUM])["materials"]
        pairs = zip(plates, materials, strict=False)
        return " and ".join(f"{1e3 * plate['thickness']:.3g} mm of {name} by finite elements" for plate, name in pairs)
    names = [f"{plate['material']}, " if plate.get("material") else "" for plate in plates]
    return " and ".join(
        f"{1e3 * plate['thickness']:.3g} mm of {name}{1e-9 * plate['resistance']:.3g} GPa, {_weakening(plate)}"
        for plate, name in zip(plates, names, strict=True)
    )


def _weakening(material: Mapping[str, Any]) -> str:
    if not (share := material.get("degradation", 1.0)) < 1.0:
        return "which does not weaken"
    if material.get("degradation_distance") is not None:
        unit = f"{1e3 * material['degradation_distance']:.3g} mm of path"
    else:
        unit = f"{1e6 * material['degradation_interval']:.3g} µs of contact"
    return f"which weakens, through its whole thickness at once, to {share:.3g} in {unit}"


def solid_note(dataset: xarray.Dataset) -> str:
    """What the solid reference is, and why it may not be the best plate of its weight; empty where there is none."""
    plate = solid_plate(dataset)
    if not plate:
        return ""
    what = "the material of the plate in front"
    if attr.ADD_ON_DENSITY in dataset.attrs:
        what = f"as heavy as the add-on ({dataset.attrs[attr.ADD_ON_DENSITY]:.4g} kg/m²), before the same base"
    note = f"The {reference_name(dataset)} is {plate}, {what}."
    material = json.loads(dataset.attrs[attr.MATERIAL])
    if attr.CONTINUUM in dataset.attrs or not material.get("degradation", 1.0) < 1.0:
        return note
    note += " A thick plate that weakens as a whole holds less than a real one, so a ratio to it flatters the target."
    if material.get("degradation_distance") is not None:
        return note
    return (
        f"{note} Weakening by time, it stops no core, however slow; give degradation_distance in the place of "
        "degradation_interval for a solid plate that may stop cores."
    )
