"""How well a plate protects: measures of a result and of the solid plate of equal areal density.

Numbers and their ratios to the solid plate have the intervals of the draws; without draws those of
statistics/intervals.py and comparisons.py. The solid plate, the weights and the holes have their texts here, too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.numbers import View, digits_of, interval_text, number_text, rows_of, value_text
from warpimpact.measures.draws import Draws, ends_of_draws
from warpimpact.measures.estimates import by_hit_of, estimated, measure_data, measures_named
from warpimpact.measures.measure import Measure, estimate_from, sampling_design
from warpimpact.measures.references import Result, as_dataset, node_hits, reference_result
from warpimpact.measures.vocabulary import Array
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.statistics.comparisons import Ratio
from warpimpact.statistics.intervals import Estimate, pseudo_values

NEXT_TO_ZERO = 0.05
"""Share of a reference's value below which the lower end of its interval gives a ratio no upper end."""


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
        numbers: of the shots, whose mean is the measure; for a quantile pseudo-values (statistics/intervals.py).
        draws: as in `Measured`.
        ratio: value of the solid reference, and the ratio of the measure to it.
        alone: value of the base alone.
        hit: number of the hit that is a worst point, else -1.
    """

    measure: Measure
    estimate: Estimate
    numbers: Array
    ratio: Ratio
    alone: float
    hit: int
    draws: tuple[Array, Array] | None = None

    @property
    def row(self) -> dict[str, float]:
        """Value, interval and shift, the solid reference with the ratio to it, the base alone, and the worst hit."""
        one, ratio = self.estimate, self.ratio
        return {
            **{"value": one.value, "low": one.low, "high": one.high, "numerics": one.numerics},
            **{"solid": ratio.reference, "ratio": ratio.value, "ratio_low": ratio.low, "ratio_high": ratio.high},
            **{"alone": self.alone, "hit": self.hit},
        }


def measures_of(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Measure]:
    """The measures with these texts in a result; by default SHOWN or SHOWN_OF_LIMITS.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    return measures_named(dataset, texts, SHOWN_OF_LIMITS if attr.LIMIT in dataset.attrs else SHOWN)


def effectiveness(result: Result, texts: Sequence[str] = ()) -> pd.DataFrame:
    """How well the plate of a result protects.

    Args:
        result: of an open file, one slice at a time and one number per hit are in memory.
        texts: texts of measures; by default those that `inspect` shows.

    Returns:
        A row for each measure in its display unit, by its text, with the columns: measure; value, low and high (95 %
        interval), numerics (largest shift; NaN with draws); solid (value of the reference), ratio to it, ratio_low
        and ratio_high; alone (value of the base alone); hit (number of a worst point, else -1).

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    every = list(scores(result, list(dict.fromkeys(measures_of(as_dataset(result), texts)))))
    index = pd.Index([score.measure.text for score in every], name="text")
    return pd.DataFrame([{"measure": score.measure, **score.row} for score in every], index)


def scores(result: Result, measures: Sequence[Measure], confidence: float = 0.95) -> Iterator[Score]:
    """Measures one after the other, with those of the references."""
    dataset = as_dataset(result)
    reference, base = (reference_result(result, name) for name in ("solid", "base_alone"))
    both = [dataset, dataset if reference is None else as_dataset(reference)]
    elsewhere = (float(of.attrs.get(attr.LIMIT_ELSEWHERE, 0.0)) for of in both)
    # A limit thickness is compared only if the rest of both targets is equally heavy.
    rest_alike = len({of.attrs.get(attr.LIMIT_LAYER) for of in both}) == 1 and math.isclose(*elsewhere, rel_tol=1e-9)
    known = [measure for measure in measures if measure.kind != "target"]
    of_solid = None if reference is None else Draws.of(reference)
    alone = {} if base is None else {measure: one.value for measure, one in estimated(base, known).items()}
    for measure, estimate, values, draws in measure_data(result, measures, confidence):
        solid, hit = None, -1
        if reference is not None and measure.kind != "target" and (measure.name != "limit_thickness" or rest_alike):
            solid = _reference_numbers(measure, reference)
        if measure.kind == "worst_point" and not np.isnan(values).all():
            hit = int(dataset[v.HIT][np.nanargmax(measure.worse * values)])
        numbers, ends = measure.averaged(values), [measure.display.factor * end for end in measure.bounds]
        if draws is not None:
            estimate = replace(estimate.within(*ends), numerics=math.nan)  # smaller than what the draws contain
            ratio = Ratio() if solid is None else ratio_of_draws(draws, _draws_of(measure, solid, of_solid), confidence)
        else:
            ratio = Ratio.of(estimate, numbers, solid, sampling_design(dataset, confidence))
        if measure.kind == "quantile":
            numbers = pseudo_values(values, measure.share)
        yield Score(measure, estimate, numbers, ratio, alone.get(measure, math.nan), hit, draws)


def _draws_of(measure: Measure, numbers: Array, draws: Draws | None) -> tuple[Array, Array]:
    """The measure of a reference in each draw; one number for all draws where it has none."""
    if draws is not None:
        return draws.numbers(measure)
    known = numbers[np.isfinite(numbers)]
    whole = np.full(1, known.mean() if len(known) else math.nan)
    return whole, whole


def ratio_of_draws(draws: tuple[Array, Array], reference: tuple[Array, Array], confidence: float) -> Ratio:
    """Ratio of the values of a measure and its reference; its interval is that of the ratios of all draws.

    It has no upper end where the reference may be next to 0, and no number where it is 0.
    """
    value, whole = (float(np.nanmean(own)) if np.isfinite(own).any() else math.nan for own, _ in (draws, reference))
    if not whole > 0.0:
        return Ratio(whole)
    own, of_reference = np.broadcast_arrays(draws[1], reference[1])
    known = np.isfinite(own) & np.isfinite(of_reference)
    if not known.any():
        return Ratio(whole, value / whole)
    own, of_reference, largest = own[known], of_reference[known], np.full(known.sum(), np.finfo(float).max)
    ratios = np.divide(own, of_reference, out=largest, where=of_reference > 0.0)
    ratio, tail = value / whole, 0.5 * (1.0 - confidence)
    low, high = ends_of_draws(ratios, confidence)
    if np.quantile(of_reference, tail) < NEXT_TO_ZERO * whole:
        high = math.nan
    return Ratio(whole, ratio, float(min(low, ratio)), float(np.maximum(high, ratio)))


def _reference_numbers(measure: Measure, result: Result) -> Array:
    """Numbers of the shots at a reference whose mean is its measure; for a quantile or a worst point a single one."""
    reference = as_dataset(result)
    values = measure.display.factor * measure.counted(by_hit_of(reference, measure))
    if measure.kind in ("quantile", "worst_point"):
        return np.array([estimate_from(measure, values).value])
    return measure.averaged(values)


def effectiveness_view(result: Result, texts: Sequence[str] = ()) -> View:
    """The scores of `effectiveness` as a table, with notes."""
    table, dataset = effectiveness(result, texts), as_dataset(result)
    with_solid = table.solid.notna().any()
    notes = filter(None, (depth_note(result), solid_note(result)))
    shown = measures_table(table, reference_name(dataset) if with_solid else None)
    return {"effectiveness": [shown, *notes]}


def measures_table(table: pd.DataFrame, reference: str | None = "solid plate") -> pd.DataFrame:
    """The scores of `effectiveness` to be shown, with the solid reference of this name and the base alone."""
    shown = pd.DataFrame(index=pd.Index([one.title for one in table.measure], name="measure"))
    shown["value (95 % interval)"] = [
        value_text(row.measure, row.value, row.low, row.high, row.numerics) + f" at hit {row.hit}" * (row.hit >= 0)
        for row in rows_of(table)
    ]
    if reference is None:
        return shown
    shown[reference] = [number_text(row.solid, digits_of(row.measure)) for row in rows_of(table)]
    shown["ratio"] = [
        number_text(row.ratio)
        + ("" if math.isnan(row.ratio_low) else f" ({interval_text(row.ratio_low, row.ratio_high)})")
        for row in rows_of(table)
    ]
    if table.alone.notna().any():
        shown["base alone"] = [number_text(row.alone, digits_of(row.measure)) for row in rows_of(table)]
    return shown


def depth_note(result: Result) -> str:
    """A note on the depths in a base where cores come out of its rear face; empty if none does."""
    pierced = Measure.parse(PIERCED)
    share = 0.0 if pierced.quantity.lacking(as_dataset(result)) else estimated(result, [pierced])[pierced].value
    if not share > 0.0:
        return ""
    return (
        f"{share:.1%} of the cores come out of the rear face of the base. They count with its thickness as depth, so "
        "the depths are lower bounds. A thicker base, a witness block, shows the depths; warpimpact limit --quantity "
        "thickness --layer N finds the thickness that each hit needs."
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


def weights_text(weights: Mapping[str, float]) -> str:
    """Weights as one phrase."""
    return ", ".join(f"{name} {weight:.1f} kg/m²" for name, weight in weights.items())


def reference_name(dataset: xarray.Dataset) -> str:
    """Name of the reference with which a target is compared."""
    return "solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"


def solid_note(result: Result) -> str:
    """What the solid reference is, and why it may not be the best plate of its weight; empty where there is none."""
    dataset, solid = as_dataset(result), node_hits(result, "solid")
    if solid is None or attr.CAMPAIGN not in solid.attrs:
        return ""
    campaign = json.loads(solid.attrs[attr.CAMPAIGN])
    plates = [campaign["plate"], *campaign["layer"]]
    names = json.loads(dataset.attrs.get(attr.CONTINUUM, "{}")).get("materials", [])
    parts = []
    for place, plate in enumerate(plates[:-1] or plates):  # the last of several layers is the base
        name = f"{plate['material']}, " if plate.get("material") else ""
        law = f"{names[place]} by finite elements" if names else f"{name}{1e-9 * plate['resistance']:.3g} GPa"
        parts.append(f"{1e3 * plate['thickness']:.3g} mm of {law}")
    what = "the material of the plate in front"
    if attr.ADD_ON_DENSITY in dataset.attrs:
        what = f"as heavy as the add-on ({dataset.attrs[attr.ADD_ON_DENSITY]:.4g} kg/m²), before the same base"
    note = f"The {reference_name(dataset)} is {' and '.join(parts)}, {what}."
    share = float(np.median(dataset[v.DEGRADATION])) if v.DEGRADATION in dataset else 1.0
    if attr.CONTINUUM in dataset.attrs or not share < 1.0:
        return note
    note += f" It weakens as a whole, to {share:.3g}, so it holds less than a real one and flatters the target."
    if "degradation_distance" in dataset:
        return note
    return (
        f"{note} Weakening by time, it stops no core, however slow; give degradation_distance in the place of "
        "degradation_interval for a solid plate that may stop cores."
    )
