"""How well a plate protects, as numbers that are defined, cited, and certain to a stated degree.

Every number but the worst point is a mean over the shots: of one number per shot, or of numbers made for the purpose
(statistics/worst_tenth.py). All of them have the intervals of statistics/intervals.py, and their ratios to the solid
plate those of statistics/comparisons.py.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.analysis.base import solid_note
from warpimpact.analysis.effects import Effect, effects
from warpimpact.analysis.numbers import Ends, intervals_text
from warpimpact.analysis.survival import by_draws, over_draws
from warpimpact.analysis.vocabulary import MEAN, SHARE, SHOWN_UNITS, WORST_POINT, WORST_TENTH, Statistic
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import finer_pair, solid_reference
from warpimpact.results.limits import solid_limits
from warpimpact.results.measures import dealing
from warpimpact.scene.units import Radians
from warpimpact.statistics.comparisons import Ratio, ratio_numbers
from warpimpact.statistics.intervals import Estimate, Estimating, estimate_of
from warpimpact.statistics.shifts import shift_of_mean, shift_of_share, shift_of_yes
from warpimpact.statistics.tails import has_interval, worst_tenth, worst_tenth_weights
from warpimpact.view.view import Column, Section, Table, number, text_of

Array = NDArray[np.float64]

ANGLE = Radians(math.radians(30.0))
"""Inclination beyond which a core counts as tilted, unless said otherwise [rad]."""


@dataclass(frozen=True)
class EffectMeasure:
    """One number of how well a plate protects; NaN where something does not exist.

    Attributes:
        name, label, units, definition, source, higher_is_better: as of `Effect`, and of what is made of it.
        value: the number.
        low, high: its confidence interval by the hits; none of a worst point: what lies between the hits may be worse.
        solid: the same of the solid plate of equal areal density.
        ratio, ratio_low, ratio_high: the value as a multiple of that.
        hit: number of the hit that is the worst point; None of anything else.
        parameters: its interval by the parameters as of an `Estimate`.
        ratio_parameters: that of the ratio.
        numerics: how far the numerics may shift the value; None or NaN where that is not known.
    """

    name: str
    label: str
    value: float
    low: float
    high: float
    units: str
    definition: str
    source: str
    higher_is_better: bool
    solid: float
    ratio: float
    ratio_low: float
    ratio_high: float
    hit: int | None = None
    parameters: tuple[float, float] | None = None
    ratio_parameters: tuple[float, float] | None = None
    numerics: float | None = None

    @property
    def ends(self) -> Ends:
        """Its intervals."""
        return Ends(self.low, self.high, self.parameters, self.numerics)

    @property
    def ratio_text(self) -> str:
        """The interval of the ratio, or both; empty where there is none."""
        if math.isnan(self.ratio) or (self.ratio_parameters is None and math.isnan(self.ratio_low)):
            return ""
        numerics = None if self.numerics is None else self.numerics / self.solid
        return intervals_text(Ends(self.ratio_low, self.ratio_high, self.ratio_parameters, numerics))


@dataclass(frozen=True)
class Evidence:
    """A measure, and what it is the mean of.

    Attributes:
        kind: that of the numbers, "mean" or "share" as in `intervals.Dealt`.
        numbers: what each shot says, NaN where it does not count, shape [hits]; None of a worst point.
        solid: the same of the first shots at the solid plate; None where there is none.
        drawn, solid_drawn: as `numbers` and `solid`, but their means over the shots of a draw are the numbers of the
            draw.
    """

    measure: EffectMeasure
    kind: str
    numbers: Array | None = None
    solid: Array | None = None
    drawn: Array | None = None
    solid_drawn: Array | None = None


def effectiveness(
    dataset: xarray.Dataset, *, angle: float | str = ANGLE, standoff: float | str | None = None
) -> list[EffectMeasure]:
    """How well the plate of a result protects.

    Args:
        dataset: a hit map; of an open file a slice is in memory at a time, and one number per hit.
        angle: inclination beyond which a core counts as tilted: degrees, a string with its unit, or `Radians`.
        standoff: distance behind the rear face where tilt counts [m], or a string; the largest of the result if None.

    Raises:
        ResultError: the result has no such stand-off.
    """
    return [evidence.measure for evidence in gather(dataset, angle=angle, standoff=standoff)]


def effect_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the effects of a result, in the order of its measures."""
    return [effect.name for effect in effects(dataset, angle=ANGLE, standoff=None)]


def gather(
    dataset: xarray.Dataset,
    *,
    angle: float | str = ANGLE,
    standoff: float | str | None = None,
    confidence: float = 0.95,
    only: Container[str] | None = None,
) -> Iterator[Evidence]:
    """The measures of `effectiveness` one after the other, each with the numbers that it is made of; of some effects
    `only`, by their names."""
    dealt: Estimating = {**dealing(dataset), "confidence": confidence}
    reference = solid_limits(dataset) if attr.LIMIT in dataset.attrs else solid_reference(dataset)
    pair = finer_pair(dataset)
    for effect in effects(dataset, angle=angle, standoff=standoff):
        if only is not None and effect.name not in only:
            continue
        values, solid = effect.over(dataset), None if reference is None else effect.over(reference)
        levels = None if pair is None else (effect.judged(pair[0]), effect.judged(pair[1]))
        if effect.kind == "share":
            yield _averaged(effect, SHARE, values, solid, levels, dealt, dataset)
        else:
            yield _averaged(effect, MEAN, values, solid, levels, dealt, dataset)
            yield _averaged(effect, WORST_TENTH, values, solid, levels, dealt, dataset)
            yield _worst_point(effect, values, solid, dataset)


def _averaged(
    effect: Effect,
    statistic: Statistic,
    values: Array,
    solid: Array | None,
    levels: tuple[Array, Array] | None,
    dealt: Estimating,
    dataset: xarray.Dataset,
) -> Evidence:
    """The measure that is a mean of what the shots say, or of numbers made of that; `levels` are those of some hits at
    two levels of resolution."""
    numbers = drawn = values
    of_solid = solid_drawn = solid
    if statistic is WORST_TENTH:
        sign = -1.0 if effect.higher_is_better else 1.0
        numbers, drawn = sign * worst_tenth(sign * values), sign * by_draws(dataset, sign * values, worst_tenth_weights)
        if solid is not None:
            of_solid = sign * worst_tenth(sign * solid)
            solid_drawn = of_solid if len(solid) == 1 else sign * by_draws(dataset, sign * solid, worst_tenth_weights)
    estimate = estimate_of(effect.kind, numbers, **dealt)
    if statistic is WORST_TENTH and not has_interval(estimate.count, dealt["images"]):
        estimate = _without_interval(estimate.value)
    if levels is not None:
        estimate = replace(estimate, numerics=_shift(effect, statistic, levels, dealt))
    estimate = over_draws(dataset, estimate, drawn).within(0.0, 1.0 if effect.units == "1" else math.inf)
    against = Ratio.of(estimate, numbers, of_solid, dealt)
    measure = _measure(effect, statistic, estimate, against)
    if measure.parameters and solid_drawn is not None:
        by_parameters = _without_interval(against.value)
        if np.isfinite(solid_drawn).any() and np.nanmean(solid_drawn) > 0.0:
            ends = replace(by_parameters, low=against.low, high=against.high)
            by_parameters = over_draws(dataset, ends, ratio_of_draws(drawn, solid_drawn)).within(0.0)
        measure = replace(measure, ratio_parameters=by_parameters.parameters or (math.nan, math.nan))
    return Evidence(measure, effect.kind, numbers, of_solid, drawn, solid_drawn)


def _shift(effect: Effect, statistic: Statistic, levels: tuple[Array, Array], dealt: Estimating) -> float:
    """How far the numerics may shift a measure, by what some hits say at two levels."""
    dealt = {**dealt, "replicates": 1}
    if effect.kind == "share":
        return (shift_of_yes if effect.margin is None else shift_of_share)(*levels, **dealt)
    if statistic is WORST_TENTH:
        sign = -1.0 if effect.higher_is_better else 1.0
        levels = worst_tenth(sign * levels[0]), worst_tenth(sign * levels[1])
    return shift_of_mean(*levels, **dealt)


def ratio_of_draws(drawn: Array, solid: Array) -> Array:
    """Numbers whose means over the shots of a draw are the ratios of two means, to first order."""
    return ratio_numbers(drawn, solid, float(np.nanmean(drawn) / np.nanmean(solid)))


def _worst_point(effect: Effect, values: Array, solid: Array | None, dataset: xarray.Dataset) -> Evidence:
    """The measure that is the worst value: the largest, or the lowest where higher is better."""
    known = ~np.isnan(values)
    sign = -1.0 if effect.higher_is_better else 1.0
    place = int(np.argmax(np.where(known, sign * values, -math.inf))) if known.any() else None
    estimate = _without_interval(math.nan if place is None else float(values[place]))
    hit = None if place is None else int(dataset[v.HIT][place])
    worst = None if solid is None else np.atleast_1d(sign * np.fmax.reduce(sign * solid))
    against = Ratio.of(estimate, values, worst, {})
    return Evidence(_measure(effect, WORST_POINT, estimate, against, hit), effect.kind)


def _without_interval(value: float) -> Estimate:
    return Estimate(value, math.nan, math.nan, 1, math.nan)


def _measure(
    effect: Effect, statistic: Statistic, estimate: Estimate, against: Ratio, hit: int | None = None
) -> EffectMeasure:
    return EffectMeasure(
        name=effect.name + statistic.name,
        label=effect.label + statistic.label,
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        units=effect.units,
        definition=effect.definition + statistic.definition,
        source=effect.source + statistic.source,
        higher_is_better=effect.higher_is_better,
        solid=against.reference,
        ratio=against.value,
        ratio_low=against.low,
        ratio_high=against.high,
        hit=hit,
        parameters=estimate.parameters,
        numerics=estimate.numerics,
    )


def effectiveness_text(
    dataset: xarray.Dataset, *, angle: float | str = ANGLE, standoff: float | str | None = None
) -> str:
    """The measures of `effectiveness` as a table, beside those of the solid plate of equal areal density."""
    return text_of([effectiveness_view(dataset, angle=angle, standoff=standoff)])


def effectiveness_view(
    dataset: xarray.Dataset, *, angle: float | str = ANGLE, standoff: float | str | None = None
) -> Section:
    """The same as a view."""
    measures = effectiveness(dataset, angle=angle, standoff=standoff)
    with_solid = any(not math.isnan(measure.solid) for measure in measures)
    notes = [depth_note(measures), solid_note(dataset)]
    if not with_solid and attr.OPEN_AREA in dataset.attrs and attr.LIMIT not in dataset.attrs:
        notes.append(
            "There is no solid plate to compare with: the result has no shots at one. They are computed unless "
            'output.solid_reference is false, and stand in the group "solid" of the file.'
        )
    table = measures_table(measures, with_solid=with_solid)
    return Section([table, *filter(None, notes)], f"effectiveness{plate_text(dataset)}")


def measures_table(measures: Sequence[EffectMeasure], *, with_solid: bool = True) -> Table:
    """Measures with their intervals, and beside the solid plate where that is wanted."""
    columns = [Column(), number("value"), Column("95 % interval")]
    if with_solid:
        columns += [number("solid plate"), number("ratio to it"), Column("95 % interval")]
    rows = [
        (
            measure.label + SHOWN_UNITS[measure.units],
            measure.value,
            intervals_text(measure.ends) if measure.hit is None else f"at hit {measure.hit}",
            measure.solid,
            measure.ratio,
            measure.ratio_text,
        )[: len(columns)]
        for measure in measures
    ]
    return Table(columns, rows)


def depth_note(measures: Sequence[EffectMeasure]) -> str:
    """What to know of the depths in a base that some cores pierce; empty if none does."""
    share = {measure.name: measure.value for measure in measures}.get("base_pierced_share", 0.0)
    if not share > 0.0:
        return ""
    return (
        f"{share:.1%} of the cores pierce the base. They count with its thickness as depth, so the depths are lower "
        "bounds. A thicker base, a witness block, tells the depths; warpimpact limit --quantity thickness --layer N "
        "tells the thickness that each hit needs."
    )


def plate_text(dataset: xarray.Dataset) -> str:
    """Areal density and open area, where a result carries them."""
    told = dataset.attrs
    if attr.AREAL_DENSITY not in told:
        return ""
    return f", {told[attr.AREAL_DENSITY]:.4g} kg/m², {told[attr.OPEN_AREA]:.1%} open"
