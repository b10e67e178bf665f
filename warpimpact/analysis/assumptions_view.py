"""A view of the assumptions: how much the numbers of a result change under each."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from warpimpact.analysis.estimates import estimated, means_of
from warpimpact.analysis.numbers import rough_text
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate
from warpimpact.view.view import Column, Section, Table

if TYPE_CHECKING:
    from warpimpact.results.table import Result

MOST_NAMED = 3
"""Assumptions that are named beside a number: those with the largest changes."""


def assumptions_view(dataset: Result, measures: Sequence[Measure] = ()) -> Section:
    """How much each number changes if one thing that nobody measured is otherwise, and the assumptions of the largest
    changes. Without measures they are those of `_first`."""
    estimates = estimated(dataset, measures or _first(dataset))
    table = assumptions_table(
        {measure.title: estimate.times(measure.display.factor) for measure, estimate in estimates.items()}
    )
    notes = notes_of(dataset, known=bool(table.rows))
    return Section([*([table] if table.rows else []), *notes], "what nobody measured")


def assumptions_table(estimates: Mapping[str, Estimate]) -> Table:
    """Range of numbers under assumptions, and the assumptions of the largest changes; a row for each known number."""
    columns = [Column(header, write=rough_text, right=True) for header in ("as given", "lowest", "highest")]
    rows = [
        (name, estimate.value, *estimate.assumed, largest_text(estimate) or "nothing moves it")
        for name, estimate in estimates.items()
        if estimate.assumed is not None
    ]
    return Table((Column(), *columns, Column("moved most by")), rows)


def _first(dataset: Result) -> list[Measure]:
    """The measures to show by default: the limit of a search of limits; else means behind the target, and shares."""
    if attr.LIMIT in dataset.attrs:
        return [Measure.parse(f"quantile({v.LIMITS[dataset.attrs[attr.LIMIT]].value}, 0.5)")]
    standoffs = dataset[v.STANDOFF].values.tolist()[-1:]
    events = [Measure.parse(f"P({event})") for event in ("perforated", "base_perforated", "base_pierced")]
    means = means_of([name for name in (v.RESIDUAL_VELOCITY, v.TILT) if name in dataset], standoffs)
    return [*means, *(event.of(dataset) for event in events if not event.quantity.lacking(dataset))]


def largest_text(estimate: Estimate) -> str:
    """The assumptions that change a number most, with its values under them; empty where none changes it visibly."""
    by_move = sorted(estimate.assumptions.items(), key=lambda under: -abs(under[1] - estimate.value))
    shown = [
        f"{name}: {rough_text(value)}" for name, value in by_move if rough_text(value) != rough_text(estimate.value)
    ]
    return ", ".join(shown[:MOST_NAMED])


def notes_of(dataset: Result, *, known: bool = True) -> Iterator[str]:
    """Further notes on assumptions: how they were computed, and which cores would break."""
    if not known:
        yield f"how far assumptions move these numbers is not known: {_why_not(dataset)}"
        return
    for name, share in json.loads(dataset.attrs.get(attr.WOULD_BREAK, "{}")).items():
        yield f"the core is taken to be unbreakable; {name} bending strength would break in {share:.0%} of these hits"
    count = dataset.sizes["assumed"] // max(int(dataset[v.ASSUMPTION].values.max()) + 1, 1)
    took = dataset.attrs.get(attr.ASSUMED_TIME)
    yield f"each assumption alone, on {count} of the hits" + ("" if took is None else f"; took {took:.2g} s")


def _why_not(dataset: Result) -> str:
    if v.ASSUMPTION in dataset:
        return "none of these hits was computed under them"
    return "no hits were computed under them; [assumptions] compute = true has them computed"


def assumptions_lines(dataset: Result) -> list[str]:
    """A sentence for each number of `_first`; empty where the changes are unknown."""
    lines = []
    for measure, estimate in estimated(dataset, _first(dataset)).items():
        if moved := largest_text(estimate.times(measure.display.factor)):
            lines.append(f"{measure.title} under other assumptions: {moved}")
    return [*lines, *notes_of(dataset)] if lines else []
