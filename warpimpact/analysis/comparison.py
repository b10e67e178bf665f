"""Plates side by side: which protects better, by how much, and whether the hits show a difference.

Shot k hits every plate at the same place of its unit cell under the same conditions. What the shots have in common then
cancels in the differences (common random numbers), which are means of differences shot by shot with their intervals.
Where one plate has more hits, the first ones are paired and the others count, too. Plates that were hit by different
shots are compared as independent (statistics/comparisons.py). No hit is left out.

Plates of different weight are compared by their ratios to the solid plate of the same areal density.

One rule: what is printed is what ranks. Every interval, of a value and of a difference, contains the shift by the
numerics and the tolerance of a limit, and has the same confidence, so that all differences of a measure hold together
(Bonferroni). A difference is significant where its interval excludes 0 by more than rounding, which it does where the
intervals of the values do not meet. A rank is a range: from one more than the number of plates that
are better, to the place that the plates that are worse leave open (J. Klein, T. Wright, J. Wieczorek, Journal of the
Royal Statistical Society A 183 (2020) 1093).

Two models of the same shots at one plate are compared hit by hit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.effectiveness import (
    Score,
    depth_note,
    measures_of,
    reference_name,
    scores,
    solid_note,
    solid_plate,
    weights_of,
    weights_text,
)
from warpimpact.analysis.inspection import hits_at_two_levels, sampling_note
from warpimpact.analysis.numbers import View, html_of, interval_text, listed, of_each, rows_of
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed
from warpimpact.results.files import ResultError
from warpimpact.results.measures import Measure, sampling_design
from warpimpact.results.vocabulary import base_thickness, has_base
from warpimpact.runs.compute import first_difference
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.statistics.comparisons import (
    ROUNDED,
    difference_numbers,
    difference_of_independent,
    ratio_numbers,
)
from warpimpact.statistics.intervals import SamplingDesign, estimate_of

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""
_ANGLES = ("obliquity", "azimuth", "pitch", "yaw")
_SAME_WEIGHT = 1.01
"""Largest ratio of the areal densities of plates that count as equally heavy."""
MOST_NAMED, MOST_WORST = 12, 3
"""Most hits that are named as ending differently by two models, and as the largest differences of a quantity."""
CONTRADICTION = 0.25
"""Share of the hits that must end differently for two models to contradict each other."""


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
        by_ratio: measures that rank by the ratio to the solid reference.
        differ_in_weight: whether the weights count and differ.
        confidence: confidence at which the intervals of a measure's differences hold together.
        reference: name of the solid references.
        hits_used: how the hits were compared, a sentence each.
        cautions: what the ranks do not consider: a sentence each, by a few words for it.
        notes: further notes, a sentence each.
    """

    plates: pd.DataFrame
    measures: dict[str, Measure]
    scores: dict[str, pd.DataFrame]
    differences: dict[str, pd.DataFrame]
    by_ratio: frozenset[str]
    differ_in_weight: bool
    confidence: float
    reference: str
    hits_used: tuple[str, ...]
    cautions: dict[str, str]
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

    def deciding(self) -> Measure | None:
        """The first measure with a significant difference, else the first that ranks plates; None without one.

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
    first, *others = (_question(dataset, name) for dataset, name in zip(datasets, names, strict=True))
    for other, name in zip(others, names[1:], strict=True):
        if (mismatch := first_difference(first, other)) is not None:
            place, was, now = mismatch
            raise ResultError(f"{name}: cannot be compared with {names[0]}: {place} is {now} here and {was} there")
    pairs = list(combinations(range(len(datasets)), 2))
    independent = {(i, j): _not_paired(datasets[i], datasets[j]) for i, j in pairs}
    of_plates = [measures_of(dataset, texts) for dataset in datasets]
    common = set.intersection(*({measure.text for measure in measures} for measures in of_plates))
    measures = {measure.text: measure for measure in of_plates[0] if measure.text in common}
    plates = pd.DataFrame([_plate(dataset) for dataset in datasets], index=pd.Index(names, name="plate"))
    is_weight = datasets[0].attrs.get(attr.LIMIT) == "thickness"  # then the limit itself is a weight
    differ = not is_weight and plates.areal_density.max() > _SAME_WEIGHT * plates.areal_density.min()
    each, by_ratio = 1.0 - (1.0 - confidence) / len(pairs), set[str]()
    bounds = all(map(has_base, datasets)) and _depths_are_bounds(datasets)
    tables, differences = dict[str, pd.DataFrame](), dict[str, pd.DataFrame]()
    for scored in zip(*(scores(dataset, list(measures.values()), each) for dataset in datasets), strict=True):
        measure = scored[0].measure
        shifts = [_shift(score, dataset) for score, dataset in zip(scored, datasets, strict=True)]
        tables[measure.text] = _scores_table(scored, shifts, names)
        if not measure.has_interval or (bounds and measure.name == "base_depth"):
            continue
        kind = "quantile" if measure.kind == "quantile" else "share" if measure.is_binary else "mean"
        if differ and not any(math.isnan(score.ratio.low) for score in scored):
            by_ratio.add(measure.text)
            kind = "quantile" if kind == "quantile" else "mean"
            shifts = [shift / score.ratio.reference for score, shift in zip(scored, shifts, strict=True)]
            scored = tuple(map(_as_ratio, scored))
        rows = []
        for i, j in pairs:
            options: SamplingDesign = {**sampling_design(datasets[i]), "confidence": each}
            shift, paired = shifts[i] + shifts[j], not independent[i, j]
            difference = _difference(scored[i], scored[j], shift, kind, options, paired=paired)
            rows.append((names[i], names[j], *difference))
        columns = ["one", "other", "value", "low", "high", "significant"]
        differences[measure.text] = pd.DataFrame(rows, columns=columns)
    references, hits = {*map(reference_name, datasets)}, plates.hits
    used = f"{hits.iloc[0]} hits of each plate" if hits.nunique() == 1 else f"hits: {of_each(names, map(str, hits))}"
    unpaired = [f"{names[i]} and {names[j]}: independent, because {why}" for (i, j), why in independent.items() if why]
    return Comparison(
        plates=plates,
        measures=measures,
        scores=tables,
        differences=differences,
        by_ratio=frozenset(by_ratio),
        differ_in_weight=differ,
        confidence=confidence,
        reference=references.pop() if len(references) == 1 else "solid reference",
        hits_used=(used if unpaired else f"{used}, the same shots", *unpaired),
        cautions=dict(_cautions(datasets, names)),
        notes=tuple(_notes(datasets, names, bounds=bounds)),
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
    measure, attributes = score.measure, dataset.attrs
    tolerance = 0.0 if measure.is_binary else float(attributes.get(attr.LIMIT_TOLERANCE, 0.0))
    is_weight = measure.name == "limit_areal_density"
    factor = attributes.get(attr.LIMIT_DENSITY, 0.0) if is_weight else measure.display.factor
    return float(np.nan_to_num(score.estimate.numerics or 0.0)) + tolerance * factor


def _scores_table(scored: Sequence[Score], shifts: Sequence[float], names: Sequence[str]) -> pd.DataFrame:
    """A table of `Comparison.scores`: the intervals contain the shifts."""
    table, measure = (
        pd.DataFrame([score.row for score in scored], index=pd.Index(names, name="plate")),
        scored[0].measure,
    )
    shift, factor = np.array(shifts), measure.display.factor
    of_ratio = shift / table.solid.where(table.solid != 0.0)
    return table.assign(
        low=(table.low - shift).clip(factor * measure.least, factor * measure.most),
        high=(table.high + shift).clip(factor * measure.least, factor * measure.most),
        ratio_low=(table.ratio_low - of_ratio).clip(0.0),
        ratio_high=table.ratio_high + of_ratio,
        numerics=table.numerics.fillna(0.0),
    )


def _as_ratio(score: Score) -> Score:
    """The ratio to the solid reference in the place of the value."""
    ratio, numbers = score.ratio, score.numbers
    if score.solid is not None:
        numbers = ratio_numbers(numbers, score.solid, ratio.value)
    estimate = replace(score.estimate, value=ratio.value, low=ratio.low, high=ratio.high)
    return replace(score, estimate=estimate, numbers=numbers)


def _difference(
    one: Score, other: Score, shift: float, kind: str, options: SamplingDesign, *, paired: bool
) -> tuple[float, float, float, bool]:
    """Difference of two plates, its interval, and whether it is significant. Rounding counts as 0.

    The interval is never wider than the intervals of both values leave open.
    """
    a, b = one.estimate, other.estimate
    value, (low, high) = a.value - b.value, difference_of_independent(a, b)
    if paired:
        matched = kind == "share" and len(one.numbers) == len(other.numbers)
        numbers = difference_numbers(one.numbers, other.numbers)
        estimate = estimate_of("difference" if matched else "mean", numbers, **options)
        # Shares that agree in every shot are no more certain than each of them.
        agrees = kind == "share" and estimate.half_width == 0.0 and a.half_width + b.half_width > 0.0
        if not agrees and not math.isnan(estimate.low + low + high):
            value = value if kind == "quantile" else estimate.value  # pseudo-values give its error alone
            low, high = value + estimate.low - estimate.value, value + estimate.high - estimate.value
    low, high = float(np.fmax(low, a.low - b.high)), float(np.fmin(high, a.high - b.low))
    rounding = ROUNDED * max(abs(end) for end in (a.value, b.value) if math.isfinite(end) or not end)
    value, low, high = (0.0 if abs(end) <= rounding else end for end in (value, low - shift, high + shift))
    return value, low, high, bool(low > 0.0 or high < 0.0)


def _depths_are_bounds(datasets: Sequence[xarray.Dataset]) -> bool:
    """Whether depths cannot be ranked: cores pierce a base and count as its thickness, and the thicknesses differ."""
    thicknesses = [float(np.mean(base_thickness(dataset))) for dataset in datasets]
    return max(thicknesses) > _SAME_WEIGHT * min(thicknesses) and any(map(depth_note, datasets))


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


def _not_paired(result: xarray.Dataset, other: xarray.Dataset) -> str:
    """Why the first hits of both are not the same shots; empty where they are."""
    common = min(result.sizes["hit"], other.sizes["hit"])
    one, two = (dataset.isel(hit=slice(common)) for dataset in (result, other))
    if sampling_design(one) != sampling_design(two):
        return "their shots have other replicates"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (one, two))
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return "their shots hit other places of the cell"
    names = (name for name in (*v.SHOT_VARIABLES, v.MASS) if name in one)
    differing = (name for name in names if not (name in two and np.array_equal(one[name], two[name])))
    return next((f"their shots differ in {name}" for name in differing), "")


def _cautions(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What the ranks do not consider, in a few words and in a sentence."""
    if len({d.attrs.get(attr.LAYERS, "") for d in datasets}) > 1:
        yield "layers", "The targets differ in the layers behind the plate."
    if differences := "; ".join(_materials(datasets, names)):
        yield "material", f"The plates differ in material, which no ranking allows for: {differences}."
    if unknown := [name for name, dataset in zip(names, datasets, strict=True) if not hits_at_two_levels(dataset)]:
        sentence = f"numerics ± is not known of {', '.join(unknown)}: intervals are by the hits alone"
        yield "the error of the numerics", f"{sentence} (warpimpact inspect)."


def _materials(datasets: Sequence[xarray.Dataset], names: Sequence[str]) -> Iterator[str]:
    """Quantities in which the materials differ, with the value of every plate that has one."""
    known = {
        n: json.loads(d.attrs[attr.MATERIAL]) for n, d in zip(names, datasets, strict=True) if attr.MATERIAL in d.attrs
    }
    for quantity in dict.fromkeys(key for material in known.values() for key in material):
        values = [material.get(quantity) for material in known.values()]
        if len({*values}) > 1:
            read = reader_of(QUANTITIES[quantity].type).text if quantity in QUANTITIES else "{:g}".format
            shown = [
                str(value or "not given") if value is None or isinstance(value, str) else read(value)
                for value in values
            ]
            yield f"{quantity} ({of_each(known, shown)})"


def _notes(datasets: Sequence[xarray.Dataset], names: Sequence[str], *, bounds: bool) -> Iterator[str]:
    """Notes on weights, solid references, sampling, and the bases behind the plates."""
    solid = {name: solid_note(dataset) for name, dataset in zip(names, datasets, strict=True)}
    alike = len(set(solid.values())) == 1
    yield from dict.fromkeys(note if alike else f"{name}: {note}" for name, note in solid.items() if note)
    yield from dict.fromkeys(filter(None, map(sampling_note, datasets)))
    alone = [name for name, dataset in zip(names, datasets, strict=True) if not has_base(dataset)]
    if 0 < len(alone) < len(names) and attr.LIMIT not in datasets[0].attrs:
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
    """The deciding measure with its ranks and differences, what is not significant, and last more notes."""
    measure = comparison.deciding()
    if measure is None:
        return {"": [*comparison.hits_used, "no measure ranks these plates", *notes]}
    open_ = f"not allowed for: {', '.join(comparison.cautions)}"
    used = "; ".join([*comparison.hits_used, *([open_] if comparison.cautions else [])])
    table, *verdict = ranking_table(comparison, measure), _undecided(comparison, measure), used
    return {_heading(comparison, measure): [table, *verdict, *notes]}


def verdict_of(comparison: Comparison) -> list[str]:
    """Sentences about the best plate by the deciding measure, and on other measures; empty where none decides."""
    measure = comparison.deciding()
    if measure is None:
        return []
    best = comparison.first(measure.text)
    first = "no difference is significant" if len(best) == len(comparison.plates) else f"{listed(best)} first"
    return [f"{_heading(comparison, measure)}: {first}", _undecided(comparison, measure)]


def comparison_view(comparison: Comparison, notes: Sequence[str] = ()) -> View:
    """What was compared, then every measure as a ranking."""
    together = (
        f"Intervals contain the numerics where they are known, and not what the model leaves out. Differences of a "
        f"measure hold together at {comparison.confidence:.0%} (Bonferroni over the pairs)."
    )
    notes = [*comparison.hits_used, together, *comparison.cautions.values(), *comparison.notes, *notes]
    view: dict[str, list[str | pd.DataFrame]] = {"": [*notes]}
    measures = (one for one in comparison.measures.values() if one.kind != "worst_point")
    view |= {_heading(comparison, measure): [ranking_table(comparison, measure)] for measure in measures}
    return view


def ranking_table(comparison: Comparison, measure: Measure) -> pd.DataFrame:
    """Ranks, weights, values and ratios of the plates, and differences from the best one, which is first."""
    text = measure.text
    ranks = comparison.ranks(text)
    plates, shown = comparison.plates.loc[list(ranks)], comparison.scores[text].loc[list(ranks)]
    is_ranked = measure in comparison.ranking
    ends = [f"{first}" if first == last else f"{first} to {last}" for first, last in ranks.values()]
    table = pd.DataFrame({"rank": ends if is_ranked else "not ranked"}, index=plates.index)
    has_add_on = bool(plates.add_on.notna().all())
    if has_add_on:
        table["add-on kg/m²"] = plates.add_on.map("{:.2f}".format)
    table["whole kg/m²" if has_add_on else "kg/m²"] = plates.areal_density.map("{:.2f}".format)
    table["value"] = shown.value
    table["interval"] = [*map(interval_text, shown.low, shown.high)]
    if shown.ratio.notna().any():
        table[f"ratio to the {comparison.reference}"] = shown.ratio
        table["interval of the ratio"] = [*map(interval_text, shown.ratio_low, shown.ratio_high)]
    if shown.alone.notna().any():
        table["base alone"] = shown.alone
    if is_ranked:
        (best, *_), others = ranks, comparison.from_best(text)
        less = f"{'ratio' if text in comparison.by_ratio else 'value'} less {best}"
        table[less] = ["", *map("{:+#.3g}".format, others.value)]
        table["its interval"] = ["", *map(interval_text, others.low, others.high)]
    return table


def _heading(comparison: Comparison, measure: Measure) -> str:
    """A measure, its better direction, and by what plates of different weight are ranked."""
    by = ""
    if comparison.differ_in_weight:
        by_ratio = measure.text in comparison.by_ratio
        by = f"; ranked by the ratio to the {comparison.reference}" if by_ratio else "; ranked without regard to weight"
    return f"{measure.title}, {measure.better}{by}"


def _undecided(comparison: Comparison, measure: Measure) -> str:
    """Pairs without a significant difference, and other measures in which another plate is best."""
    pairs = comparison.differences[measure.text]
    alike = [f"{pair.one} and {pair.other}" for pair in rows_of(pairs) if not pair.significant]
    which = "any two" if len(alike) == len(pairs) else "; ".join(alike)
    sentences = [f"no significant difference between {which}" if alike else "every difference is significant"]
    best = comparison.first(measure.text)
    for other in comparison.ranking:
        first = comparison.first(other.text)
        if len(first) < len(comparison.plates) and not {*best} & {*first}:
            sentences.append(f"by {other.label}: {listed(first)} first")
    return "; ".join(sentences)


def shared_hits(datasets: Mapping[str, xarray.Dataset]) -> dict[str, xarray.Dataset] | None:
    """The hits that both results have, in memory, the result by finite elements last; None unless there are two results
    of the same shots, one of them by finite elements. Results are given and returned by their names."""
    by_elements = [name for name, dataset in datasets.items() if attr.CONTINUUM in dataset.attrs]
    if len(datasets) != 2 or len(by_elements) != 1:
        return None
    (reference,), (name,) = by_elements, {*datasets} - {*by_elements}
    one, other = datasets[name], datasets[reference]
    numbers, first, second = np.intersect1d(hit_numbers(one), hit_numbers(other), return_indices=True)
    fast, slow = one.isel(hit=first).load(), other.isel(hit=second).load()
    shots = (v.HIT_Y, v.HIT_Z, *v.SHOT_VARIABLES)
    same = len(numbers) and all(np.allclose(fast[at], slow[at], atol=1e-9) for at in shots if at in fast)
    return {name: fast, reference: slow} if same else None


def shot_by_shot(shared: Mapping[str, xarray.Dataset]) -> View:
    """How two results differ, hit by hit: bias, root mean square, correlation of ranks and the worst hits by quantity.
    The numbers describe these hits and have no intervals. Hits that failed in either result are left out, and counted.

    Where many cores are stopped by one model and pass by the other, a difference of velocities means nothing; a
    sentence says so in its place.
    """
    (name, one), (reference, other) = shared.items()
    numbers, sound = hit_numbers(one), ~(failed(one) | failed(other))
    differs = sound & (passed(one) != passed(other))
    left_out = f"; {int((~sound).sum())} of them failed and count nowhere" if (~sound).any() else ""
    parts: list[str | pd.DataFrame] = [f"{name} less {reference}, of the {len(numbers)} hits that both have{left_out}"]
    if differs.any():
        more = f" and {differs.sum() - MOST_NAMED} more" if differs.sum() > MOST_NAMED else ""
        named = ", ".join(map(str, numbers[differs][:MOST_NAMED]))
        parts.append(f"{name} and {reference} end differently at hits {named}{more}")
    if differs.sum() >= CONTRADICTION * sound.sum() and differs.any():
        counts = (f"{int(passed(result)[sound].sum())} pass by {label}" for label, result in shared.items())
        parts.append(
            f"The models contradict each other here: of {int(sound.sum())} hits, {' and '.join(counts)}. Believe "
            "neither without a shot. Differences are of the hits that end alike."
        )
    standoffs, rows = np.intersect1d(one[v.STANDOFF], other[v.STANDOFF]), {}
    ours, theirs = (_columns(result, standoffs).set_axis(numbers)[sound & ~differs] for result in (one, other))
    for label in ours:
        pair = pd.concat([ours[label], theirs[label]], axis=1, keys=["ours", "theirs"]).dropna()
        difference = pair.ours - pair.theirs
        if len(pair):
            ranked = pair.rank().corr(min_periods=3).loc["ours", "theirs"]
            worst = difference[difference.abs().nlargest(MOST_WORST).index]
            rows[label] = {
                "hits": str(len(difference)),
                "bias": f"{difference.mean():.3g}",
                "rms": f"{np.sqrt((difference**2).mean()):.3g}",
                "rank correlation": "-" if math.isnan(ranked) else f"{ranked:.2f}",
                "largest differences at hits": ", ".join(f"{hit} ({value:+.3g})" for hit, value in worst.items()),
            }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("quantity")
    return {"shot by shot": [*parts, *([table] if rows else [])]}


def _columns(result: xarray.Dataset, standoffs: Any) -> pd.DataFrame:
    """Quantities of the hits with their units."""
    columns = {"residual velocity, m/s": result[v.RESIDUAL_VELOCITY], "deflection, °": result[v.DEFLECTION]}
    columns |= {f"tilt at {1e3 * at:g} mm, °": result[v.TILT].sel(standoff=at) for at in standoffs}
    return pd.DataFrame({label: column.values.astype(float) for label, column in columns.items()})
