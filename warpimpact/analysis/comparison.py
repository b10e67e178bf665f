"""Plates side by side: which protects better, by how much, and whether the hits show a difference.

Shot k hits every plate at the same place of its unit cell under the same conditions. What the shots have in common then
cancels in the differences (common random numbers), which are means of differences shot by shot with their intervals.
Where one plate has more hits, the first ones are paired and the others count, too. Plates that were hit by different
shots are compared as independent (statistics/comparisons.py). No hit is left out.

Plates of different weight are compared by their ratios to the solid plate of the same areal density.

One rule: what is printed is what ranks. Every interval, of a value and of a difference, contains the shift by the
numerics and the tolerance of a limit, and has the same confidence, so that all differences of a measure hold together
(Bonferroni). Two plates are told apart where the interval of their difference excludes 0 by more than rounding, which
it does where the intervals of the values do not meet. A rank is a range: from one more than the number of plates that
are better, to the place that the plates that are worse leave open (J. Klein, T. Wright, J. Wieczorek, Journal of the
Royal Statistical Society A 183 (2020) 1093).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.effectiveness import (
    Score,
    common_name,
    depth_note,
    measures_of,
    reference_name,
    scores,
    solid_note,
    solid_plate,
    weights_of,
    weights_text,
)
from warpimpact.analysis.inspection import breaks_promise, hits_at_two_levels, sampling_note
from warpimpact.analysis.numbers import View, html_of, interval_text, listed, of_each, rows_of
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.measures import Measure, sampling_design
from warpimpact.results.vocabulary import base_thickness, has_base
from warpimpact.runs.chunks import first_difference
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.statistics.comparisons import (
    ROUNDED,
    confidence_of_each,
    difference_numbers,
    difference_of_independent,
    ratio_numbers,
)
from warpimpact.statistics.intervals import Array, Estimate, SamplingDesign, estimate_of

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""
_ANGLES = ("obliquity", "azimuth", "pitch", "yaw")
_SAME_WEIGHT = 1.01
"""Largest ratio of the areal densities of plates that count as equally heavy."""


@dataclass(frozen=True)
class Comparison:
    """Plates side by side, with the differences that the hits show. A notebook shows the short view, and every measure.

    Attributes:
        plates: by name, in the given order: hits; areal_density of the whole target [kg/m²]; add_on of it, NaN where
            the file does not separate it; weights in words; solid: the solid reference in words.
        measures: the compared measures by their texts.
        scores: by measure a row for each plate in the display unit: value, low, high; solid, ratio, ratio_low,
            ratio_high; alone; numerics, the shift that low and high contain.
        differences: by measure a row for each pair of plates, `one` less `other`, by ratio where that ranks: value,
            low, high, and whether it is significant. The end of an interval that does not exist is NaN.
        pairs: a row for each pair of plates: number of paired first hits; why they are independent, or "".
        by_ratio: measures that rank by the ratio to the solid reference.
        differ_in_weight: whether the weights count and differ.
        confidence: confidence at which the intervals of a measure's differences hold together.
        reference: name of the solid references.
        notes: further notes, a sentence each.
        cautions: differences or unknowns of the plates that the ranks do not consider, in a few words.
    """

    plates: pd.DataFrame
    measures: dict[str, Measure]
    scores: dict[str, pd.DataFrame]
    differences: dict[str, pd.DataFrame]
    pairs: pd.DataFrame
    by_ratio: frozenset[str]
    differ_in_weight: bool
    confidence: float
    reference: str
    notes: tuple[str, ...]
    cautions: tuple[str, ...]

    @property
    def compared(self) -> list[Measure]:
        """The measures without worst points, which have no interval."""
        return [measure for measure in self.measures.values() if measure.kind != "worst_point"]

    @property
    def ranking(self) -> list[Measure]:
        """The measures that rank plates: with a better direction and with intervals."""
        return [one for one in self.compared if one.higher_is_better is not None and self.is_ranked(one.text)]

    def is_ranked(self, text: str) -> bool:
        """Whether a measure has intervals of differences. If not, the notes say why."""
        return text in self.differences and bool(self.differences[text]["low"].notna().any())

    def ordered(self, text: str) -> list[str]:
        """Names of the plates, the best value (or ratio, where that ranks) first."""
        column = self.scores[text]["ratio" if text in self.by_ratio else "value"]
        better = self.measures[text].higher_is_better
        return column.sort_values(ascending=not better, kind="stable", na_position="last").index.tolist()

    def ranks(self, text: str) -> dict[str, tuple[int, int]]:
        """First and last possible rank of each plate by a measure, the best value first."""
        names = self.ordered(text)
        better, worse = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
        for pair in rows_of(self.differences[text]) if text in self.differences else ():
            if pair.significant:
                first, last = (pair.one, pair.other)[:: 1 if names.index(pair.one) < names.index(pair.other) else -1]
                worse[first] += 1
                better[last] += 1
        return {name: (1 + better[name], len(names) - worse[name]) for name in names}

    def first(self, text: str) -> list[str]:
        """Names of the plates that no other one is better than."""
        return [name for name, (rank, _) in self.ranks(text).items() if rank == 1]

    def from_best(self, text: str) -> pd.DataFrame:
        """Differences of the other plates from the best one, by plate, in the order of the values."""
        best, *others = self.ordered(text)
        table = self.differences[text]
        turned = table.assign(
            one=table.other, other=table.one, value=0.0 - table.value, low=-table.high, high=-table.low
        )
        both = pd.concat([table, turned])
        return both[both.other == best].set_index("one").loc[others]

    def deciding(self) -> Measure | None:
        """The first measure by which hits tell two plates apart, else the first that ranks plates; None without one.

        Measures have the order of the texts, by default that of `effectiveness.SHOWN`: what reaches the base comes
        before what flies behind the target.
        """
        ranking = self.ranking
        significant = (one for one in ranking if self.differences[one.text]["significant"].any())
        return next(significant, ranking[0] if ranking else None)

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        every = html_of(comparison_view(self))
        return f"{html_of(short_view(self))}<details><summary>Every measure</summary>{every}</details>"


def compare(
    datasets: Sequence[xarray.Dataset],
    names: Sequence[str],
    texts: Sequence[str] = (),
    *,
    confidence: float = 0.95,
) -> Comparison:
    """Compare the plates of some results, by all their hits.

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
    places = list(combinations(range(len(datasets)), 2))
    used = [(names[i], names[j], *_used(datasets[i], datasets[j])) for i, j in places]
    pairs = pd.DataFrame(used, columns=["one", "other", "paired", "independent"])
    of_plates = [measures_of(dataset, texts) for dataset in datasets]
    common = set.intersection(*({measure.text for measure in measures} for measures in of_plates))
    measures = {measure.text: measure for measure in of_plates[0] if measure.text in common}
    each, differ, by_ratio = confidence_of_each(confidence, len(places)), _differ_in_weight(datasets), set[str]()
    bounds = all(map(has_base, datasets)) and _depths_are_bounds(datasets)
    tables, differences = dict[str, pd.DataFrame](), dict[str, pd.DataFrame]()
    for scored in zip(*(scores(dataset, list(measures.values()), each) for dataset in datasets), strict=True):
        measure = scored[0].data.measure
        shifts = [_shift(score, dataset) for score, dataset in zip(scored, datasets, strict=True)]
        rows = [_row(score, shift) for score, shift in zip(scored, shifts, strict=True)]
        tables[measure.text] = pd.DataFrame(rows, index=pd.Index(names, name="plate"))
        if not measure.has_interval or (bounds and measure.name == "base_depth"):
            continue
        if ratios := differ and not any(math.isnan(score.ratio.low) for score in scored):
            by_ratio.add(measure.text)
        sides = [_side(score, shift, by_ratio=ratios) for score, shift in zip(scored, shifts, strict=True)]
        compared = []
        for (i, j), independent in zip(places, pairs.independent, strict=True):
            options: SamplingDesign = {**sampling_design(datasets[i]), "confidence": each}
            compared.append((names[i], names[j], *_difference(sides[i], sides[j], options, paired=not independent)))
        columns = ["one", "other", "value", "low", "high", "significant"]
        differences[measure.text] = pd.DataFrame(compared, columns=columns)
    cautions = dict(_cautions(datasets, names))
    return Comparison(
        plates=pd.DataFrame([_plate(dataset) for dataset in datasets], index=pd.Index(names, name="plate")),
        measures=measures,
        scores=tables,
        differences=differences,
        pairs=pairs,
        by_ratio=frozenset(by_ratio),
        differ_in_weight=differ,
        confidence=confidence,
        reference=common_name(map(reference_name, datasets)),
        notes=(*cautions.values(), *_notes(datasets, names, bounds=bounds)),
        cautions=tuple(cautions),
    )


def _plate(dataset: xarray.Dataset) -> dict[str, Any]:
    weights = weights_of(dataset)
    return {
        "hits": dataset.sizes["hit"],
        "areal_density": float(dataset.attrs[attr.AREAL_DENSITY]),
        "add_on": weights.get("add-on", math.nan),
        "weights": weights_text(weights),
        "solid": solid_plate(dataset),
    }


def _shift(score: Score, dataset: xarray.Dataset) -> float:
    """Largest shift of a value by the numerics, and by the tolerance of a limit; 0 where it is unknown."""
    measure, attributes = score.data.measure, dataset.attrs
    tolerance = 0.0 if measure.is_binary else float(attributes.get(attr.LIMIT_TOLERANCE, 0.0))
    is_weight = measure.name == "limit_areal_density"
    factor = attributes.get(attr.LIMIT_DENSITY, 0.0) if is_weight else measure.display.factor
    return float(np.nan_to_num(score.data.estimate.numerics or 0.0)) + tolerance * factor


def _row(score: Score, shift: float) -> dict[str, float]:
    """A row of `Comparison.scores`."""
    estimate, measure, ratio = score.data.estimate, score.data.measure, score.ratio
    wide = replace(estimate, low=estimate.low - shift, high=estimate.high + shift)
    wide = wide.within(measure.display.factor * measure.least, measure.display.factor * measure.most)
    of_ratio = shift / ratio.reference if ratio.reference else math.nan
    return {
        "value": estimate.value,
        "low": wide.low,
        "high": wide.high,
        "solid": ratio.reference,
        "ratio": ratio.value,
        "ratio_low": float(np.fmax(ratio.low - of_ratio, 0.0)) if ratio.low == ratio.low else math.nan,
        "ratio_high": ratio.high + of_ratio,
        "alone": score.alone,
        "numerics": float(np.nan_to_num(estimate.numerics or 0.0)),
    }


class _Side(NamedTuple):
    """What is compared of a plate: an estimate by the hits, numbers whose mean it is, its shift, and its kind."""

    estimate: Estimate
    numbers: Array
    shift: float
    kind: str


def _side(score: Score, shift: float, *, by_ratio: bool) -> _Side:
    """The value of a plate, or its ratio to the solid reference."""
    estimate, numbers, ratio, measure = score.data.estimate, score.data.numbers, score.ratio, score.data.measure
    kind = "quantile" if measure.kind == "quantile" else "share" if measure.is_binary and not by_ratio else "mean"
    if by_ratio and score.solid is not None:
        numbers, shift = ratio_numbers(numbers, score.solid, ratio.value), shift / ratio.reference
        estimate = replace(estimate, value=ratio.value, low=ratio.low, high=ratio.high)
    return _Side(estimate, numbers, shift, kind)


def _difference(one: _Side, other: _Side, options: SamplingDesign, *, paired: bool) -> tuple[float, float, float, bool]:
    """Difference of two plates, its interval, and whether it is significant. Rounding counts as 0.

    The interval is never wider than the intervals of both values leave open.
    """
    a, b, shift = one.estimate, other.estimate, one.shift + other.shift
    value, (low, high) = a.value - b.value, difference_of_independent(a, b)
    if paired:
        matched = one.kind == "share" and len(one.numbers) == len(other.numbers)
        numbers = difference_numbers(one.numbers, other.numbers)
        estimate = estimate_of("difference" if matched else "mean", numbers, **options)
        # Shares that agree in every shot are no more certain than each of them.
        agrees = one.kind == "share" and estimate.half_width == 0.0 and a.half_width + b.half_width > 0.0
        if not agrees and not math.isnan(estimate.low + low + high):
            value = value if one.kind == "quantile" else estimate.value  # pseudo-values give its error alone
            low, high = value + estimate.low - estimate.value, value + estimate.high - estimate.value
    low, high = float(np.fmax(low, a.low - b.high)), float(np.fmin(high, a.high - b.low))
    rounding = ROUNDED * max(abs(end) for end in (a.value, b.value) if math.isfinite(end) or not end)
    value, low, high = (0.0 if abs(end) <= rounding else end for end in (value, low - shift, high + shift))
    return value, low, high, bool(low > 0.0 or high < 0.0)


def _differ_in_weight(datasets: Sequence[xarray.Dataset]) -> bool:
    """Whether the weights count and differ. In a search of thickness the limit itself is a weight."""
    densities = [dataset.attrs[attr.AREAL_DENSITY] for dataset in datasets]
    return datasets[0].attrs.get(attr.LIMIT) != "thickness" and max(densities) > _SAME_WEIGHT * min(densities)


def _depths_are_bounds(datasets: Sequence[xarray.Dataset]) -> bool:
    """Whether depths cannot be ranked: cores pierce a base and count as its thickness, and the thicknesses differ."""
    thicknesses = [float(np.mean(base_thickness(dataset))) for dataset in datasets]
    if max(thicknesses) <= _SAME_WEIGHT * min(thicknesses):
        return False
    return any(map(depth_note, datasets))


def _check_same_question(result: xarray.Dataset, name: str, other: xarray.Dataset, other_name: str) -> None:
    """Refuse results with another core, impact or stand-offs.

    Raises:
        ResultError: the message names the first difference.
    """
    if (mismatch := first_difference(_question(result, name), _question(other, other_name))) is not None:
        place, was, now = mismatch
        raise ResultError(f"{other_name}: cannot be compared with {name}: {place} is {now} here and {was} there")


def _question(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    """What must be the same for plates to be compared; the angles of the impact in degrees."""
    attributes = dataset.attrs
    if not {attr.CORE, attr.IMPACT} <= attributes.keys():
        raise ResultError(f"{name}: has no description of its core and impact, which a comparison needs; run it again")
    impact = {
        key: f"{math.degrees(value)!r} deg" if key in _ANGLES and isinstance(value, float) else value
        for key, value in json.loads(attributes[attr.IMPACT]).items()
    }
    output = {"standoffs": dataset[v.STANDOFF].values.tolist(), "standoff_point": attributes[attr.STANDOFF_POINT]}
    limit = {"limit": attributes[attr.LIMIT]} if attr.LIMIT in attributes else {}
    return limit | {"core": json.loads(attributes[attr.CORE]), "impact": impact, "output": output}


def _used(result: xarray.Dataset, other: xarray.Dataset) -> tuple[int, str]:
    """Number of first hits that are the same shots, and why there are none; empty where there are."""
    common = min(result.sizes["hit"], other.sizes["hit"])
    one, two = (dataset.isel(hit=slice(common)) for dataset in (result, other))
    if sampling_design(one) != sampling_design(two):
        return 0, "their shots have other replicates"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (one, two))
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return 0, "their shots hit other places of the cell"
    for name in (*v.SHOT_VARIABLES, v.MASS):
        if name in one and not (name in two and np.array_equal(one[name], two[name])):
            return 0, f"their shots differ in {name}"
    return common, ""


def _cautions(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What the ranks do not consider, in a few words and in a sentence."""
    if len({d.attrs.get(attr.LAYERS, "") for d in datasets}) > 1:
        yield "layers", "The targets differ in the layers behind the plate."
    if differences := "; ".join(_materials(datasets, names)):
        yield "material", f"The plates differ in material, which no ranking allows for: {differences}."
    texts = [dataset.attrs[attr.NUMERICS_GIVEN] for dataset in datasets if attr.NUMERICS_GIVEN in dataset.attrs]
    differing = (first_difference(json.loads(first), json.loads(other)) for first, other in pairwise(texts))
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


def _materials(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[str]:
    """Quantities in which the materials differ, with the value of every plate that has one."""
    known = {
        n: json.loads(d.attrs[attr.MATERIAL]) for n, d in zip(names, datasets, strict=True) if attr.MATERIAL in d.attrs
    }
    for quantity in dict.fromkeys(key for material in known.values() for key in material):
        values = {name: material.get(quantity) for name, material in known.items()}
        if len(set(values.values())) > 1:
            read = reader_of(QUANTITIES[quantity].type).text if quantity in QUANTITIES else "{:g}".format
            shown = [
                "not given" if value is None else value if isinstance(value, str) else read(value)
                for value in values.values()
            ]
            yield f"{quantity} ({of_each(values, shown)})"


def _notes(datasets: Sequence[xarray.Dataset], names: Sequence[str], *, bounds: bool) -> Iterator[str]:
    """Notes on weights, solid references, sampling, and the bases behind the plates."""
    if _differ_in_weight(datasets):
        weights = of_each(
            names, [weights_text(weights_of(one), ".4g").removeprefix("areal density ") for one in datasets]
        )
        yield (
            f"The plates differ in weight ({weights}). They are ranked by the ratio to the solid reference of the same "
            "areal density; a measure without that ratio says so."
        )
    solid = {name: solid_note(dataset) for name, dataset in zip(names, datasets, strict=True)}
    alike = len(set(solid.values())) == 1
    yield from dict.fromkeys(note if alike else f"{name}: {note}" for name, note in solid.items() if note)
    yield from dict.fromkeys(filter(None, map(sampling_note, datasets)))
    based = [has_base(dataset) for dataset in datasets]
    if any(based) and not all(based) and attr.LIMIT not in datasets[0].attrs:
        alone = [name for name, is_based in zip(names, based, strict=True) if not is_based]
        yield f"Without layers, and so without a base: {', '.join(alone)}. Measures of a base are left out."
    elif bounds:
        yield (
            "Cores pierce a base and count with its thickness as depth. The bases differ in thickness, so depths are "
            "not ranked."
        )
    else:
        of_plates = zip(names, map(depth_note, datasets), strict=True)
        yield from (f"{name}: {note}" for name, note in of_plates if note)


def short_view(comparison: Comparison, notes: Sequence[str] = ()) -> View:
    """The deciding measure with its ranks and differences, what is not told apart, and last more notes."""
    measure = comparison.deciding()
    if measure is None:
        return {"": [*hits_used(comparison), "no measure ranks these plates", *notes]}
    plates, text = comparison.plates, measure.text
    (best, *_), from_best, table = comparison.ordered(text), comparison.from_best(text), _scores_table(comparison, text)
    less = f"{'ratio' if text in comparison.by_ratio else 'value'} less {best}"
    table[less] = ["", *map("{:+#.3g}".format, from_best.value)]
    table["its interval"] = ["", *map(interval_text, from_best.low, from_best.high)]
    hits = f"{plates.hits.min()}" + ("" if plates.hits.nunique() == 1 else f" to {plates.hits.max()}")
    same = "" if comparison.pairs.independent.any() else ", the same shots"
    left_open = f"; not allowed for: {', '.join(comparison.cautions)}" if comparison.cautions else ""
    used = f"{hits} hits of each plate{same}{left_open}"
    return {_title(comparison, measure): [table, _undecided(comparison, measure), used, *notes]}


def verdict_of(comparison: Comparison) -> list[str]:
    """Sentences about the best plate by the deciding measure, and what is not told apart; empty where none decides."""
    measure = comparison.deciding()
    if measure is None:
        return []
    best = comparison.first(measure.text)
    first = "no two plates are told apart" if len(best) == len(comparison.plates) else f"{listed(best)} first"
    return [f"{_title(comparison, measure)}: {first}", _undecided(comparison, measure)]


def comparison_view(comparison: Comparison, notes: Sequence[str] = ()) -> View:
    """What was compared, the best plates, then every measure as a ranking with differences in words."""
    together = (
        f"Intervals contain the numerics where they are known. Differences of a measure hold together at "
        f"{comparison.confidence:.0%} (Bonferroni over the pairs)."
    )
    chance = "The intervals describe the hits that were drawn, not what the model leaves out."
    sentences = [*hits_used(comparison), together, chance, *comparison.notes, *notes]
    view: dict[str, list[str | pd.DataFrame]] = {"": [*sentences]}
    if len(best := best_plates(comparison)):
        view["best plates"] = [best.to_frame("plate")]
    for measure in comparison.compared:
        heading = f"{measure.title}; {measure.better}{_weighed(comparison, measure.text)}"
        view[heading] = [_scores_table(comparison, measure.text)]
        if measure.text in comparison.differences:
            view[heading].append(_differences_table(comparison, measure))
    return view


def best_plates(comparison: Comparison) -> pd.Series:
    """The plates that no other one is better than, in words, by the label of a measure."""
    best = {}
    for measure in comparison.compared:
        if measure.higher_is_better is not None:
            first, ranked = comparison.first(measure.text), comparison.is_ranked(measure.text)
            undecided = "cannot be told apart" if ranked else "not ranked"
            best[measure.label] = undecided if len(first) == len(comparison.plates) else listed(first)
    return pd.Series(best, dtype=object).rename_axis("best at")


def hits_used(comparison: Comparison) -> list[str]:
    """How many hits were compared and how, a sentence each."""
    hits, pairs = comparison.plates.hits, comparison.pairs
    if hits.nunique() == 1 and not pairs.independent.any():
        return [f"{hits.iloc[0]} hits of each plate: the same shots at every plate, compared shot by shot."]
    lines = [f"Hits: {of_each(hits.index, map(str, hits))}; all of them count."]
    for pair in rows_of(pairs):
        left = {name: hits[name] - pair.paired for name in (pair.one, pair.other) if hits[name] > pair.paired}
        how = f"the first {pair.paired} hits are the same shots, compared shot by shot"
        how += "".join(f"; the other {count} of {name} count on their own" for name, count in left.items())
        how = f"compared as independent, because {pair.independent}" if pair.independent else how
        lines.append(f"{pair.one} and {pair.other}: {how}.")
    return lines


def _scores_table(comparison: Comparison, text: str) -> pd.DataFrame:
    """Ranks, weights, values and ratios of the plates in a measure, the best value first."""
    ranks = comparison.ranks(text)
    plates, shown = comparison.plates.loc[list(ranks)], comparison.scores[text].loc[list(ranks)]
    is_ranked = comparison.is_ranked(text) and comparison.measures[text].higher_is_better is not None
    ends = [f"{first}" if first == last else f"{first} to {last}" for first, last in ranks.values()]
    table = pd.DataFrame({"rank": ends if is_ranked else "-"}, index=plates.index)
    has_base = bool(plates.add_on.notna().all())
    if has_base:
        table["add-on kg/m²"] = plates.add_on.map("{:.2f}".format)
    table["whole kg/m²" if has_base else "kg/m²"] = plates.areal_density.map("{:.2f}".format)
    table["value"] = shown.value
    table["interval"] = [*map(interval_text, shown.low, shown.high)]
    if shown.ratio.notna().any():
        table[f"ratio to the {comparison.reference}"] = shown.ratio
        table["interval of the ratio"] = [*map(interval_text, shown.ratio_low, shown.ratio_high)]
    if shown.alone.notna().any():
        table["base alone"] = shown.alone
    return table


def _title(comparison: Comparison, measure: Measure) -> str:
    """The deciding measure, its better direction, and the measures before it that tell no plates apart."""
    before = [other.label for other in comparison.ranking]
    before = before[: before.index(measure.label)]
    tell = "tells" if len(before) == 1 else "tell"
    undecided = f" ({listed(before)} {tell} no two plates apart)" if before else ""
    return f"{measure.title}, {measure.better}{_weighed(comparison, measure.text)}{undecided}"


def _weighed(comparison: Comparison, text: str) -> str:
    """By what plates of different weight are ranked, to follow a name; empty where weights are the same."""
    if not comparison.differ_in_weight:
        return ""
    by_ratio = text in comparison.by_ratio
    return f"; ranked by the ratio to the {comparison.reference}" if by_ratio else "; ranked without regard to weight"


def _undecided(comparison: Comparison, measure: Measure) -> str:
    """Pairs that the measure does not tell apart, and other measures in which another plate is best."""
    pairs = comparison.differences[measure.text]
    alike = [f"{pair.one} and {pair.other}" for pair in rows_of(pairs) if not pair.significant]
    sentences = [f"not told apart: {'no two of them' if len(alike) == len(pairs) else '; '.join(alike) or 'none'}"]
    best = comparison.first(measure.text)
    for other in comparison.ranking:
        first = comparison.first(other.text)
        if len(first) < len(comparison.plates) and not {*best} & {*first}:
            sentences.append(f"by {other.label}: {listed(first)} first")
    return "; ".join(sentences)


def _differences_table(comparison: Comparison, measure: Measure) -> pd.DataFrame:
    """The difference of every pair of plates, with a verdict."""
    table, than = (
        comparison.differences[measure.text],
        "higher than" if measure.higher_is_better is None else "better than",
    )
    verdicts = []
    for pair in rows_of(table):
        one, other = (pair.one, pair.other)[
            :: 1 if (pair.value > 0.0) == (measure.higher_is_better is not False) else -1
        ]
        verdicts.append(f"{one} {than} {other}" if pair.significant else "cannot be told apart")
    what = "difference of the ratios" if measure.text in comparison.by_ratio else "difference"
    intervals = [*map(interval_text, table["low"], table["high"])]
    columns = {what: table["value"], "interval": intervals, "verdict": verdicts}
    return pd.DataFrame(columns).set_axis(table["one"] + " less " + table["other"])
