"""Plates side by side: which protects better, by how much, and whether that can be told.

Shot k hits every plate at the same place of its unit cell under the same conditions. What the shots have in common
then drops out of the differences (common random numbers), which are means of differences shot by shot and have their
intervals (statistics/intervals.py). Plates that were hit by other shots are compared as independent
(statistics/comparisons.py).

The intervals of all pairs of plates hold together, for each measure on its own: each has its share of the error
(Bonferroni). Two plates are told apart where the interval of their difference leaves out 0.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import xarray

from warpimpact.analysis.effectiveness import ANGLE, SHOWN_UNITS, Evidence, Measure, gather
from warpimpact.analysis.numbers import interval_text
from warpimpact.analysis.numbers import number_text as number
from warpimpact.analysis.summary import sampling_note
from warpimpact.campaign.parts import first_difference
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.measures import dealing
from warpimpact.statistics.comparisons import confidence_of_each, difference_of_independent
from warpimpact.statistics.intervals import estimate_of

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""


@dataclass(frozen=True)
class Contestant:
    """A plate and how well it protects; areal density [kg/m²], open area as a share."""

    name: str
    areal_density: float
    open_area: float
    measures: tuple[Measure, ...]


@dataclass(frozen=True)
class Difference:
    """By how much a measure of one plate exceeds that of another, with its interval; NaN where there is none."""

    measure: str
    one: str
    other: str
    value: float
    low: float
    high: float

    @property
    def told_apart(self) -> bool:
        """Whether the interval leaves out 0."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Comparison:
    """Plates side by side.

    Attributes:
        plates: in the order in which they were given; all have the same measures.
        differences: of every pair of plates in every measure that has intervals.
        hits: that were compared, of each plate.
        independent: why the plates were compared as independent; empty where they were hit by the same shots.
        confidence: at which the intervals of a measure's differences hold together.
        notes: what else there is to say, a sentence each.
    """

    plates: tuple[Contestant, ...]
    differences: tuple[Difference, ...]
    hits: int
    independent: str
    confidence: float
    notes: tuple[str, ...]

    def ranks(self, measure: str) -> dict[str, int]:
        """Name of each plate → one more than the number of plates that are better by more than can be chance."""
        (up,) = {told.higher_is_better for told in self.plates[0].measures if told.name == measure}
        worse = [
            (pair.one if (pair.value > 0.0) != up else pair.other)
            for pair in self.differences
            if pair.measure == measure and pair.told_apart
        ]
        return {plate.name: 1 + worse.count(plate.name) for plate in self.plates}


def compare(
    datasets: Sequence[xarray.Dataset],
    names: Sequence[str],
    *,
    angle: float = ANGLE,
    standoff: float | None = None,
    confidence: float = 0.95,
) -> Comparison:
    """Compare the plates of some hit maps; where one has fewer hits, the first ones of the others.

    Args:
        datasets: two or more, of the same core under the same impact; of open files one number per hit is in memory.
        names: of the plates, each once.
        angle, standoff: as in `effectiveness`.
        confidence: of all differences in a measure together.

    Raises:
        ResultError: core, impact or stand-offs differ, so that the plates were not asked the same.
    """
    for dataset, name in zip(datasets[1:], names[1:], strict=True):
        _check_same_question(datasets[0], names[0], dataset, name)
    hits = min(dataset.sizes["hit"] for dataset in datasets)
    datasets = [dataset.isel(hit=slice(hits)) for dataset in datasets]
    independent = next((why for other in datasets[1:] if (why := _other_shots(datasets[0], other))), "")
    pairs = list(combinations(range(len(datasets)), 2))
    each = confidence_of_each(confidence, len(pairs))
    measures: list[list[Measure]] = [[] for _ in datasets]
    differences = []
    for evidences in zip(*(gather(dataset, angle=angle, standoff=standoff) for dataset in datasets), strict=True):
        for told, evidence in zip(measures, evidences, strict=True):
            told.append(evidence.measure)
        for i, j in pairs:
            if evidences[i].numbers is not None:
                dealt = [dealing(datasets[k]) | {"confidence": each} for k in (i, j)]
                interval = _apart(evidences[i], evidences[j], dealt) if independent else None
                value, low, high = interval or _paired(evidences[i], evidences[j], dealt[0])
                differences.append(Difference(evidences[i].measure.name, names[i], names[j], value, low, high))
    plates = tuple(
        Contestant(name, dataset.attrs[attr.AREAL_DENSITY], dataset.attrs[attr.OPEN_AREA], tuple(told))
        for name, dataset, told in zip(names, datasets, measures, strict=True)
    )
    return Comparison(plates, tuple(differences), hits, independent, confidence, tuple(_notes(datasets)))


def _paired(one: Evidence, other: Evidence, dealt: dict[str, Any]) -> tuple[float, float, float]:
    """Mean difference of the same shots and its interval."""
    assert one.numbers is not None
    assert other.numbers is not None
    kind = "difference" if one.kind == "share" else one.kind
    estimate = estimate_of(kind, one.numbers - other.numbers, **dealt)
    if math.isnan(one.measure.low + other.measure.low):
        return estimate.value, math.nan, math.nan
    return estimate.value, estimate.low, estimate.high


def _apart(one: Evidence, other: Evidence, dealt: Sequence[dict[str, Any]]) -> tuple[float, float, float]:
    """Difference of two independent estimates and its interval."""
    assert one.numbers is not None
    assert other.numbers is not None
    difference = one.measure.value - other.measure.value
    if math.isnan(one.measure.low + other.measure.low):
        return difference, math.nan, math.nan
    a, b = estimate_of(one.kind, one.numbers, **dealt[0]), estimate_of(other.kind, other.numbers, **dealt[1])
    return difference, *difference_of_independent(a, b)


def _check_same_question(one: xarray.Dataset, name: str, other: xarray.Dataset, other_name: str) -> None:
    asked, asked_other = _question(one, name), _question(other, other_name)
    if (found := first_difference(asked, asked_other)) is not None:
        place, was, now = found
        raise ResultError(f"{other_name}: cannot be compared with {name}: {place} is {now} here and {was} there")


def _question(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    """What must be the same for plates to be compared."""
    told = dataset.attrs
    if not {attr.CORE, attr.IMPACT} <= told.keys():
        raise ResultError(f"{name}: does not tell its core and impact, which a comparison needs; run it again")
    output = {"standoffs": dataset[v.STANDOFF].values.tolist(), "standoff_point": told[attr.STANDOFF_POINT]}
    return {"core": json.loads(told[attr.CORE]), "impact": json.loads(told[attr.IMPACT]), "output": output}


def _other_shots(one: xarray.Dataset, other: xarray.Dataset) -> str:
    """Why the shots of two results are not the same ones; empty where they are."""
    if dealing(one) != dealing(other):
        return "their shots have other replicates or symmetries"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (one, other))
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return "their shots hit other places of the cell"
    for name in (*v.SHOT_VARIABLES, v.MASS):
        if name in one and not (name in other and np.array_equal(one[name], other[name])):
            return f"their shots differ in {name}"
    return ""


def _notes(datasets: Sequence[xarray.Dataset]) -> Iterator[str]:
    densities = [dataset.attrs[attr.AREAL_DENSITY] for dataset in datasets]
    if max(densities) > 1.01 * min(densities):
        yield "The plates differ in weight; the ratio to the solid plate of the same areal density allows for it."
    texts = [dataset.attrs[attr.NUMERICS_GIVEN] for dataset in datasets if attr.NUMERICS_GIVEN in dataset.attrs]
    asked = [json.loads(text) for text in texts]
    differences = (first_difference(one, other) for one, other in pairwise(asked))
    if (found := next(filter(None, differences), None)) is not None:
        yield "The plates were computed with different numerics: {} is {} and {}.".format(*found)
    if note := sampling_note(datasets[0]):
        yield note


def comparison_text(comparison: Comparison) -> str:
    """Who is best at what, then every measure as a ranking with differences in words."""
    measures = comparison.plates[0].measures
    compared = [measure for measure in measures if measure.hit is None]
    blocks = [_conditions(comparison), _best(comparison, compared)]
    blocks += [_ranking(comparison, measure) for measure in compared]
    return "\n\n".join("\n".join(block) for block in blocks)


def _conditions(comparison: Comparison) -> list[str]:
    how = "the same shots at every plate, compared shot by shot"
    if comparison.independent:
        how = f"compared as independent, because {comparison.independent}"
    together = f"Differences of a measure hold together at {comparison.confidence:.0%} (Bonferroni over the pairs)."
    chance = "Intervals tell of the hits that were drawn, not of what the model leaves out."
    return [f"{comparison.hits} hits of each plate: {how}.", together, chance, *comparison.notes]


def _best(comparison: Comparison, measures: Sequence[Measure]) -> list[str]:
    width = max(len(measure.label) for measure in measures)
    lines = [f"{'best at':<{width}}   plate"]
    for measure in measures:
        first = [name for name, rank in comparison.ranks(measure.name).items() if rank == 1]
        if len(first) == len(comparison.plates):
            lines.append(f"{measure.label:<{width}}   cannot be told apart")
        else:
            lines.append(f"{measure.label:<{width}}   {_listed(first)}")
    return lines


def _listed(names: Sequence[str]) -> str:
    """Such as "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _ranking(comparison: Comparison, measure: Measure) -> list[str]:
    place = comparison.plates[0].measures.index(measure)
    ranks, better = comparison.ranks(measure.name), "higher" if measure.higher_is_better else "lower"
    width = max(5, *(len(plate.name) for plate in comparison.plates))
    lines = [
        f"{measure.label}{SHOWN_UNITS[measure.units]}; {better} is better",
        f"rank  {'plate':<{width}}{'kg/m²':>8}{'value':>10}   {'95 % interval':<20}ratio to the solid plate",
    ]
    sign = -1.0 if measure.higher_is_better else 1.0
    for plate in sorted(comparison.plates, key=lambda plate: (ranks[plate.name], sign * plate.measures[place].value)):
        told = plate.measures[place]
        interval = "" if math.isnan(told.ratio_low) else f"  {interval_text(told.ratio_low, told.ratio_high)}"
        lines.append(
            f"{ranks[plate.name]:>4}  {plate.name:<{width}}{plate.areal_density:>8.2f}{number(told.value):>10}   "
            f"{interval_text(told.low, told.high):<20}{number(told.ratio)}{interval}"
        )
    lines += [_in_words(pair, measure) for pair in comparison.differences if pair.measure == measure.name]
    return lines


def _in_words(pair: Difference, measure: Measure) -> str:
    """Such as "a better than b by 0.1 (0.05 to 0.15)"."""
    if not pair.told_apart:
        interval = f"({interval_text(pair.low, pair.high)})"
        return f"{pair.one} and {pair.other} cannot be told apart: difference {number(pair.value)} {interval}"
    names = [pair.one, pair.other] if (pair.value > 0.0) == measure.higher_is_better else [pair.other, pair.one]
    low, high = sorted((abs(pair.low), abs(pair.high)))
    return f"{names[0]} better than {names[1]} by {number(abs(pair.value))} ({interval_text(low, high)})"
