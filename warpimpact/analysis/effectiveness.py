"""How well a plate protects: measures of a result beside those of the solid plate of equal areal density.

Every number but a quantile and the worst point is a mean over the shots, either of their values or of pseudo-values
(statistics/tails.py). All numbers have the intervals of statistics/intervals.py, and their ratios to the solid plate
those of statistics/comparisons.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray

from warpimpact.analysis.estimates import MeasureData, asked_measures, by_hit_of, measure_data
from warpimpact.analysis.numbers import interval_text
from warpimpact.analysis.plate_text import plate_text, reference_name, solid_note
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure, dealing, estimate_from
from warpimpact.results.references import reference as reference_of
from warpimpact.results.vocabulary import Array
from warpimpact.statistics.comparisons import Ratio
from warpimpact.view.view import Column, Section, Table, number, text_of


def _three(quantity: str) -> tuple[str, ...]:
    return f"mean({quantity})", f"worst_tenth({quantity})", f"worst_point({quantity})"


_PIERCED = "P(base_pierced)"
SHOWN = (
    *("P(base_perforated)", _PIERCED, *_three("base_depth")),
    *(*_three("residual_energy_fraction"), *_three("residual_energy_density")),
    *("P(inclination > 30 deg)", "P(stopped)", "P(broken)", "P(stopped_or_broken)"),
)
"""Default measures of a map of hits, as far as the result has them."""
SHOWN_OF_LIMITS = tuple(
    text for quantity in ("limit_velocity", "limit_thickness", "limit_areal_density") for text in _three(quantity)
)
"""Default measures of a search of limits."""


@dataclass(frozen=True)
class Score:
    """A measure of how well a plate protects, in the unit of its title; NaN where something does not exist.

    Attributes:
        measure: the measure.
        value: its value.
        low, high: confidence interval by the hits. A worst point has none, because a point between the hits may be
            worse.
        solid: value of the solid reference: a plate of equal areal density, or an add-on before the same base.
        ratio, ratio_low, ratio_high: ratio of the value to `solid`, with its interval.
        hit: number of the hit that is the worst point; None for other measures.
        numerics: largest shift of the value by the numerics; None or NaN where unknown.
        alone: value of the base alone.
    """

    measure: Measure
    value: float
    low: float
    high: float
    solid: float
    ratio: float
    ratio_low: float
    ratio_high: float
    hit: int | None = None
    numerics: float | None = None
    alone: float = math.nan

    @property
    def name(self) -> str:
        """The text of the measure."""
        return self.measure.text

    @property
    def interval(self) -> str:
        """Its interval, with the shift by the numerics, as text."""
        return interval_text(self.low, self.high, self.numerics)

    @property
    def ratio_text(self) -> str:
        """The interval of the ratio; empty where there is none."""
        if math.isnan(self.ratio) or math.isnan(self.ratio_low):
            return ""
        numerics = None if self.numerics is None else self.numerics / self.solid
        return interval_text(self.ratio_low, self.ratio_high, numerics)


@dataclass(frozen=True)
class ScoreData:
    """A score and the numbers behind it.

    Attributes:
        solid: numbers of the first shots at the solid plate whose mean is its measure; None where there are none.
    """

    score: Score
    data: MeasureData
    solid: Array | None = None


def measures_of(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Measure]:
    """The measures with these texts at the stand-offs and layers of a result; by default SHOWN or SHOWN_OF_LIMITS.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    asked = asked_measures(dataset, texts, SHOWN_OF_LIMITS if attr.LIMIT in dataset.attrs else SHOWN)
    pierced = Measure.parse(_PIERCED)  # with it, readers see whether depths are lower bounds
    is_depth = texts and any(measure.name == "base_depth" for measure in asked)
    return [*asked, pierced] if is_depth and pierced not in asked else asked


def effectiveness(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Score]:
    """How well the plate of a hit map protects, in measures with these texts, by default those that `inspect` shows. Of
    an open file, one slice at a time and one number per hit are in memory.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    return [each.score for each in scores(dataset, measures_of(dataset, texts))]


def scores(dataset: xarray.Dataset, measures: Sequence[Measure]) -> Iterator[ScoreData]:
    """Measures one after the other, beside those of the solid plate, with the numbers behind them."""
    reference, base = (reference_of(dataset, name) for name in ("solid", "base_alone"))
    for data in (each.shown() for each in measure_data(dataset, measures)):
        measure, estimate, solid, alone = data.measure, data.estimate, None, math.nan
        if reference is not None and _is_comparable(measure, dataset, reference):
            solid = _reference_numbers(measure, reference)
        if base is not None and measure.kind != "target":
            of_base = _reference_numbers(measure, base)
            alone = float(np.nanmean(of_base)) if np.isfinite(of_base).any() else math.nan
        numbers = data.values if data.numbers is None else data.numbers
        ratio = Ratio.of(estimate, numbers, solid, {**dealing(dataset), "confidence": 0.95})
        score = Score(
            measure=measure,
            value=estimate.value,
            low=estimate.low,
            high=estimate.high,
            solid=ratio.reference,
            ratio=ratio.value,
            ratio_low=ratio.low,
            ratio_high=ratio.high,
            hit=None if data.worst_shot is None else int(dataset[v.HIT][data.worst_shot]),
            numerics=estimate.numerics,
            alone=alone,
        )
        yield ScoreData(score, data, solid)


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


def effectiveness_text(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> str:
    """The scores of `effectiveness` as a table, beside those of the solid plate of equal areal density."""
    return text_of([effectiveness_view(dataset, texts)])


def effectiveness_view(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> Section:
    """The scores of `effectiveness` as a view."""
    measures = effectiveness(dataset, texts)
    with_solid = any(not math.isnan(measure.solid) for measure in measures)
    notes = [depth_note(measures), solid_note(dataset)]
    if not with_solid and attr.OPEN_AREA in dataset.attrs and attr.LIMIT not in dataset.attrs:
        notes.append(
            "There is no solid plate or add-on to compare with. warpimpact run computes it into the file, unless "
            "output.solid_reference is false."
        )
    table = measures_table(measures, reference_name(dataset) if with_solid else None)
    return Section([table, *filter(None, notes)], f"effectiveness{plate_text(dataset)}")


def measures_table(measures: Sequence[Score], reference: str | None = "solid plate") -> Table:
    """Measures with their intervals, beside the references: the solid one of this name, and the base alone."""
    columns = [Column(), number("value"), Column("95 % interval")]
    if reference is not None:
        columns += [number(reference), number("ratio to it"), Column("95 % interval")]
        columns += [number("base alone")] if any(not math.isnan(measure.alone) for measure in measures) else []
    rows = [
        (
            measure.measure.title,
            measure.value,
            measure.interval if measure.hit is None else f"at hit {measure.hit}",
            measure.solid,
            measure.ratio,
            measure.ratio_text,
            measure.alone,
        )[: len(columns)]
        for measure in measures
    ]
    return Table(columns, rows)


def depth_note(measures: Sequence[Score]) -> str:
    """A note on the depths in a base that some cores pierce; empty if none does."""
    share = {measure.name: measure.value for measure in measures}.get(_PIERCED, 0.0)
    if not share > 0.0:
        return ""
    return (
        f"{share:.1%} of the cores pierce the base. They count with its thickness as depth, so the depths are lower "
        "bounds. A thicker base, a witness block, tells the depths; warpimpact limit --quantity thickness --layer N "
        "tells the thickness that each hit needs."
    )
