"""Plates side by side: which protects better, by how much, and whether they can be told apart.

One rule: what is printed is what ranks. A value is the answer of its result, with its interval. A difference is that of
the values, with the interval of the difference in each draw (measures/draws.py): errors that both plates share cancel.
The intervals of a measure's differences hold together (Bonferroni). A difference is significant where its interval
excludes 0 by more than rounding; else the plates cannot be told apart. A rank is a range: from one more than the number
of plates that are better, to the place that the plates that are worse leave open (J. Klein, T. Wright, J. Wieczorek,
Journal of the Royal Statistical Society A 183 (2020) 1093).

Searches of limits and hits by elements alone have no draws. Shot k hits every plate at the same place of its unit cell
under the same conditions, so their differences are means of differences shot by shot (common random numbers). Where one
plate has more hits, the first ones are paired and the others count, too. Their intervals contain the shift by the
numerics and the tolerance of a limit. Plates that were hit by different shots, or of which one has draws and the other
has none, are compared as independent (statistics/comparisons.py). Weights stand beside the values and do not count.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.correction import has_draws, has_elements, is_trusted
from warpimpact.analysis.effectiveness import (
    Score,
    depth_note,
    measures_of,
    scores,
    weights_of,
    weights_text,
)
from warpimpact.analysis.inspection import sampling_note
from warpimpact.analysis.numbers import (
    View,
    difference_text,
    html_of,
    rows_of,
    value_text,
)
from warpimpact.analysis.same_shots import not_paired, shot_conditions
from warpimpact.campaign.inputs import first_difference
from warpimpact.errors import ResultError
from warpimpact.measures.draws import difference_of_draws, estimate_of_draws
from warpimpact.measures.estimates import Measured, measure_data
from warpimpact.measures.measure import Measure, sampling_design
from warpimpact.measures.references import ELEMENTS, FINER, NAMES, Result, as_dataset, node_places
from warpimpact.measures.vocabulary import base_thickness, has_base
from warpimpact.records import attributes as attr
from warpimpact.scene.units import count_text, list_text
from warpimpact.statistics.comparisons import (
    ROUNDED,
    difference_numbers,
    difference_of_independent,
)
from warpimpact.statistics.intervals import Estimate, SamplingDesign, estimate_of

_SAME_WEIGHT = 1.01
"""Largest ratio of the areal densities of plates that count as equally heavy."""


@dataclass(frozen=True)
class Comparison:
    """Plates side by side, with the differences that the hits show. A notebook shows the short view, and every measure.

    Attributes:
        plates: by name, in the given order: hits; areal_density of the whole target [kg/m²]; add_on of it, NaN where
            the file does not separate it; weights in words.
        measures: the compared measures by their texts.
        scores: by measure a row for each plate in the display unit: value, low, high; solid, the value of the solid
            reference; numerics, the shift by them; shift, that which low and high contain.
        differences: by measure a row for each pair of plates, `one` less `other`: value, low, high, and whether it is
            significant. The end of an interval that does not exist is NaN.
        confidence: confidence at which the intervals of a measure's differences hold together.
        hits_used: how the hits were compared, a sentence each.
        notes: further notes, a sentence each.
    """

    plates: pd.DataFrame
    measures: dict[str, Measure]
    scores: dict[str, pd.DataFrame]
    differences: dict[str, pd.DataFrame]
    confidence: float
    hits_used: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def ranking(self) -> list[Measure]:
        """The measures that rank plates: with a better direction and with intervals."""
        better = (one for one in self.measures.values() if one.higher_is_better is not None)
        return [one for one in better if self.is_ranked(one.text)]

    def is_ranked(self, text: str) -> bool:
        """Whether a measure has intervals of differences. If not, the notes say why."""
        return text in self.differences and bool(self.differences[text]["low"].notna().any())

    def ordered(self, text: str) -> list[str]:
        """Names of the plates, the best value first."""
        better = self.measures[text].higher_is_better
        return (
            self.scores[text]["value"]
            .sort_values(ascending=not better, kind="stable", na_position="last")
            .index.tolist()
        )

    def ranks(self, text: str) -> dict[str, tuple[int, int]]:
        """First and last possible rank of each plate that has a value of a measure, the best value first."""
        names = [name for name in self.ordered(text) if not math.isnan(self.scores[text]["value"][name])]
        better, worse = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
        for pair in rows_of(self.differences[text]) if text in self.differences else ():
            if pair.significant:
                first, last = sorted((pair.one, pair.other), key=names.index)
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

    def is_decided(self, text: str) -> bool:
        """Whether a measure ranks plates and shows a significant difference, not only to a base alone."""
        if self.measures[text] not in self.ranking:
            return False
        table = self.differences[text]
        others = table[(table[["one", "other"]] != NAMES["base_alone"]).all(axis=1)]
        return bool((others if len(others) else table)["significant"].any())

    def deciding(self) -> Measure | None:
        """The measure that decides (`deciding_measure`)."""
        return deciding_measure(self)

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        every = html_of(comparison_view(self))
        return f"{html_of(short_view(self))}<details><summary>Every measure</summary>{every}</details>"


def compare(
    results: Mapping[str, Result],
    texts: Sequence[str] = (),
    *,
    references: Collection[str] = (),
    confidence: float = 0.95,
) -> Comparison:
    """Compare the plates of some results, by all their hits.

    Args:
        results: two or more by the names of their plates, with the same core and impact. Of open files one number per
            hit is in memory.
        texts: texts of measures; by default the measures that `inspect` shows for all the plates.
        references: names of plates that are references of another one. A base alone is the base that cores perforate;
            a reference without the layers that a measure needs has no value of it.
        confidence: confidence of all differences in a measure together.

    Raises:
        ResultError: core, impact or stand-offs differ, so that the question is not the same; or a plate lacks what a
            measure needs.
    """
    names, datasets = [*results], [*map(as_dataset, results.values())]
    by_name = dict(zip(names, datasets, strict=True))
    check_same([shot_conditions(dataset, name) for name, dataset in by_name.items()], names)
    own = [dataset for name, dataset in by_name.items() if name not in references]
    of_plates = [measures_of(dataset, texts) for dataset in own]
    common = set.intersection(*({measure.text for measure in measures} for measures in of_plates))
    measures = {measure.text: measure for measure in of_plates[0] if measure.text in common}
    plates = pd.DataFrame([_plate(dataset) for dataset in datasets], index=pd.Index(names, name="plate"))
    thickness = [float(np.mean(base_thickness(dataset))) for dataset in datasets if has_base(dataset)] or [1.0]
    # Depths cannot be ranked where cores come out of a base, and the bases differ in thickness.
    bounds = max(thickness) > _SAME_WEIGHT * min(thickness) and any(map(depth_note, results.values()))
    pairs = list(combinations(range(len(datasets)), 2))
    independent = {(i, j): not_paired(datasets[i], datasets[j]) for i, j in pairs}
    each = 1.0 - (1.0 - confidence) / len(pairs)
    tables, differences = dict[str, pd.DataFrame](), dict[str, pd.DataFrame]()
    every = [scores(result, [*measures.values()], confidence) for result in results.values()]
    wider = [None if has_draws(one) else measure_data(one, [*measures.values()], each) for one in results.values()]
    for scored in zip(*every, strict=True):
        measure = scored[0].measure
        estimates = [_at_confidence(*one, each) for one in zip(scored, wider, strict=True)]
        tables[measure.text] = _scores_table(scored, datasets, names)
        shifts = tables[measure.text]["shift"].tolist()
        if not measure.has_interval or (bounds and measure.name == "base_depth"):
            continue
        rows = []
        for i, j in pairs:
            one, other, both, estimate = scored[i], scored[j], (estimates[i], estimates[j]), None
            if one.draws is not None and other.draws is not None:
                estimate = difference_of_draws(one.draws, other.draws, each, paired=not independent[i, j])
            elif not independent[i, j] and one.draws is other.draws:
                estimate = _paired(one, other, both, sampling_design(datasets[i], each))
            difference = _difference(*both, estimate, shifts[i] + shifts[j])
            rows.append((names[i], names[j], *difference))
        columns = ["one", "other", "value", "low", "high", "significant"]
        differences[measure.text] = pd.DataFrame(rows, columns=columns)
    hits, is_paired = plates.hits.drop(list(references)), not any(independent.values())
    own_results = [result for name, result in results.items() if name not in references]
    unpaired = [f"{names[i]} and {names[j]}: independent, because {why}" for (i, j), why in independent.items() if why]
    used = f"{count_text(hits.iloc[0], 'hit')} of each plate"
    if hits.nunique() > 1:
        used = f"hits: {', '.join(f'{name} {count}' for name, count in hits.items())}"
    if any(elements := [len(node_places(result, ELEMENTS)) for result in own_results]):
        used += f", of which finite elements computed {' and '.join(map(str, dict.fromkeys(elements)))}"
    elif any(map(has_draws, own_results)):
        used += ", by the fast law alone"
    untrusted = [name for name, result in results.items() if has_elements(result) and not is_trusted(result)]
    if untrusted:
        unpaired.append(f"do not trust {list_text(untrusted)}: too many hits by finite elements failed")
    return Comparison(
        plates=plates,
        measures=measures,
        scores=tables,
        differences=differences,
        confidence=confidence,
        hits_used=(f"{used}, the same shots" if is_paired else used, *unpaired),
        notes=tuple(_notes(results, references, bounds=bounds)),
    )


def check_same(questions: Sequence[dict[str, Any]], names: Sequence[str]) -> None:
    """Refuse results of different questions, which are nested dictionaries."""
    for other, name in zip(questions[1:], names[1:], strict=True):
        if (mismatch := first_difference(questions[0], other)) is not None:
            place, was, now = mismatch
            raise ResultError(f"{name}: cannot be compared with {names[0]}: {place} is {now} here, {was} in {names[0]}")


def _plate(dataset: xarray.Dataset) -> dict[str, Any]:
    weights = weights_of(dataset)
    return {
        "hits": dataset.sizes["hit"],
        "areal_density": float(dataset.attrs[attr.AREAL_DENSITY]),
        "add_on": weights.get("add-on", math.nan),
        "weights": weights_text(weights),
    }


def _scores_table(scored: Sequence[Score], datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> pd.DataFrame:
    """A table of `Comparison.scores`, with the shift that its intervals contain: the largest one by the numerics, and
    by the tolerance of a limit; 0 where it is unknown."""
    measure, table = scored[0].measure, pd.DataFrame([score.row for score in scored], pd.Index(names, name="plate"))
    numerics, tolerances = table.numerics.fillna(0.0), np.zeros(len(names))
    for place, attributes in enumerate(dataset.attrs for dataset in datasets if not measure.is_binary):
        is_weight = measure.name == "limit_areal_density"
        factor = attributes.get(attr.LIMIT_DENSITY, 0.0) if is_weight else measure.display.factor
        tolerances[place] = float(attributes.get(attr.LIMIT_TOLERANCE, 0.0)) * factor
    shift, ends = numerics + tolerances, [measure.display.factor * end for end in measure.bounds]
    low, high = (table.low - shift).clip(*ends), (table.high + shift).clip(*ends)
    return table[["value", "solid"]].assign(low=low, high=high, numerics=numerics, shift=shift)


def _at_confidence(score: Score, measured: Iterator[Measured] | None, confidence: float) -> Estimate:
    """The estimate of a score at another confidence; of a plate without draws the next of its measures."""
    if measured is not None:
        return next(measured).estimate
    if score.draws is None:
        return score.estimate
    ends = (score.measure.display.factor * end for end in score.measure.bounds)
    return estimate_of_draws(*score.draws, confidence).within(*ends)


def _paired(one: Score, other: Score, both: tuple[Estimate, Estimate], options: SamplingDesign) -> Estimate | None:
    """The difference of two plates from the differences shot by shot; None where these determine none."""
    (a, b), is_share = both, one.measure.is_binary
    matched = is_share and len(one.numbers) == len(other.numbers)
    numbers = difference_numbers(one.numbers, other.numbers)
    estimate = estimate_of("difference" if matched else "mean", numbers, **options)
    # Shares that agree in every shot, and equal numbers, are no more certain than each of them.
    is_equal = is_share or a.spread == b.spread == 0.0
    agree = is_equal and estimate.half_width == 0.0 and a.half_width + b.half_width > 0.0
    return None if agree or math.isnan(estimate.low + sum(difference_of_independent(a, b))) else estimate


def _difference(a: Estimate, b: Estimate, paired: Estimate | None, shift: float) -> tuple[float, float, float, bool]:
    """Difference of the values of two plates, its interval, and whether it is significant. Rounding counts as 0.

    The interval is never wider than the intervals of both values leave open.
    """
    value, (low, high) = a.value - b.value, difference_of_independent(a, b)
    if paired is not None:  # its value differs by shots that count for one plate alone; that of a quantile is none
        low, high = value + paired.low - paired.value, value + paired.high - paired.value
    low, high = float(np.fmax(low, a.low - b.high)), float(np.fmin(high, a.high - b.low))
    rounding = ROUNDED * max((abs(end) for end in (a.value, b.value) if math.isfinite(end)), default=0.0)
    value, low, high = (0.0 if abs(end) <= rounding else end for end in (value, low - shift, high + shift))
    return value, low, high, bool(low > 0.0 or high < 0.0)


def _notes(results: Mapping[str, Result], references: Collection[str], *, bounds: bool) -> Iterator[str]:
    """Notes on what intervals contain, numerics, sampling, and the bases behind the plates."""
    names, datasets = [*results], [*map(as_dataset, results.values())]
    if plain := {name: result for name, result in results.items() if not has_draws(result)}:
        yield f"Intervals do not contain the error of the method: {', '.join(plain)}."
    by_law = [name for name, result in results.items() if name not in references and not has_elements(result)]
    if any(map(has_elements, results.values())) and by_law:
        yield f"By the fast law alone, without hits by finite elements: {list_text(by_law)}."
    if unknown := [name for name, result in plain.items() if not len(node_places(result, FINER))]:
        sentence = f"numerics ± is not known of {', '.join(unknown)}: intervals are those of the hits alone"
        yield f"{sentence} (warpimpact inspect)."
    yield from dict.fromkeys(filter(None, map(sampling_note, results.values())))
    pairs = zip(names, datasets, strict=True)
    alone = [name for name, dataset in pairs if not has_base(dataset) and name not in references]
    if 0 < len(alone) < len(names) - len(references) and attr.LIMIT not in datasets[0].attrs:
        yield f"No base, because no table [[layer]]: {', '.join(alone)}. Measures of a base are left out."
    elif bounds:
        yield (
            "Cores come out of the rear face of a base and count with its thickness as depth. The bases differ in "
            "thickness, so depths are not ranked."
        )
    else:
        of_plates = zip(names, map(depth_note, results.values()), strict=True)
        yield from (f"{name}: {note}" for name, note in of_plates if note)


def deciding_measure(*comparisons: Comparison) -> Measure | None:
    """The first measure that shows a significant difference in some comparison, else the first that ranks; or None.

    Measures have the order of the texts, by default that of `effectiveness.SHOWN`: what reaches the base comes before
    what flies behind the target.
    """
    first, *others = comparisons
    common = [one for one in first.ranking if all(one.text in other.measures for other in others)]
    decided = (one for one in common if any(comparison.is_decided(one.text) for comparison in comparisons))
    return next(decided, common[0] if common else None)


def undecided_before(comparison: Comparison, measure: Measure) -> str:
    """A sentence on the measures before the deciding one, which show no difference; empty if it is the first."""
    ranking = [one.label for one in comparison.ranking]
    before = ranking[: ranking.index(measure.label)]
    return f" They cannot be told apart by: {'; '.join(before)}." if before else ""


def short_view(comparison: Comparison, notes: Sequence[str] = ()) -> View:
    """The deciding measure as a table, a verdict in a sentence, the hits, and last more notes."""
    measure = deciding_measure(comparison)
    if measure is None:
        return {"": [*comparison.hits_used, "no measure ranks these plates", *notes]}
    used = "; ".join(comparison.hits_used)
    return {heading(comparison, measure): [ranking_table(comparison, measure), *verdict_of(comparison), used, *notes]}


def verdict_of(comparison: Comparison) -> list[str]:
    """A sentence about the best plates by the deciding measure, and by others; empty where none decides."""
    measure = deciding_measure(comparison)
    if measure is None:
        return []
    best = comparison.first(measure.text)
    if len(best) == len(comparison.ranks(measure.text)):
        return [f"By {measure.label} {list_text(best)} cannot be told apart."]
    sentence = f"Best by {measure.label}: {list_text(best)}" + ", which cannot be told apart" * (len(best) > 1)
    others = {other.label: comparison.first(other.text) for other in comparison.ranking}
    contrary = [f"by {label}: {list_text(first)}" for label, first in others.items() if not {*best} & {*first}]
    return [f"{'; but '.join([sentence, *contrary[:1]])}.{undecided_before(comparison, measure)}"]


def comparison_view(comparison: Comparison, notes: Sequence[str] = ()) -> View:
    """What was compared, then every measure that has an interval as a ranking."""
    together = f"All differences of a measure hold together at {comparison.confidence:.0%} confidence (Bonferroni)."
    view: dict[str, list[str | pd.DataFrame]] = {"": [*comparison.hits_used, together, *comparison.notes, *notes]}
    measures = (one for text, one in comparison.measures.items() if comparison.scores[text]["low"].notna().any())
    return view | {heading(comparison, measure): [ranking_table(comparison, measure)] for measure in measures}


def ranking_table(comparison: Comparison, measure: Measure) -> pd.DataFrame:
    """Ranks, weights and values of the plates, and differences from the best one, which is first."""
    text, is_ranked = measure.text, measure in comparison.ranking
    names, ranks = comparison.ordered(text), comparison.ranks(text)
    plates, shown = comparison.plates.loc[names], comparison.scores[text].loc[names]
    places = [rank_text(ranks[name]) if name in ranks else "-" for name in names]
    table = pd.DataFrame({"rank": places if is_ranked else "not ranked"}, index=plates.index)
    has_add_on = bool(plates.add_on.notna().all())
    if has_add_on:
        table["add-on kg/m²"] = plates.add_on.map("{:.2f}".format)
    table["whole kg/m²" if has_add_on else "kg/m²"] = plates.areal_density.map("{:.2f}".format)
    table["value"] = [value_text(measure, row.value, row.low, row.high) for row in rows_of(shown)]
    if is_ranked:
        others = comparison.from_best(text)
        differences = zip(others.value, others.low, others.high, strict=True)
        texts = ("-" if math.isnan(one[0]) else difference_text(measure, *one) for one in differences)
        table[f"less {names[0]}"] = ["", *texts]
    return table


def rank_text(rank: tuple[int, int]) -> str:
    """First and last possible rank."""
    first, last = rank
    return f"{first}" if first == last else f"{first} to {last}"


def heading(comparison: Comparison, measure: Measure) -> str:
    """A measure and its better direction."""
    return f"{measure.title}, {measure.better}"
