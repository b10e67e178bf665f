"""The short answer of a comparison: the deciding measure, the plates in its order with their differences from the best
one, and open points. `comparison_text` has every measure."""

from __future__ import annotations

from collections.abc import Sequence

from warpimpact.analysis.comparison_text import (
    ComparedPlates,
    compared_scores,
    hits_used,
    is_ranked,
    listed,
    negative,
    weighed,
)
from warpimpact.analysis.contestants import Difference
from warpimpact.analysis.effectiveness import Score
from warpimpact.analysis.numbers import interval_text
from warpimpact.view.view import Column, Section, Table, number


def deciding(comparison: ComparedPlates) -> Score | None:
    """The measure that decides, with the values of the first plate: the first measure by which hits tell two plates
    apart, else the first one that ranks plates; None if there is none.

    Measures have the order in which they were asked for, by default that of `effectiveness.SHOWN`: what reaches the
    base comes before what flies behind the target.
    """
    ranked = _ranking_scores(comparison)
    apart = {pair.measure for pair in comparison.differences if pair.told_apart}
    return next((score for score in ranked if score.name in apart), ranked[0] if ranked else None)


def _ranking_scores(comparison: ComparedPlates) -> list[Score]:
    """Measures with a better direction and with intervals."""
    return [
        score
        for score in compared_scores(comparison)
        if score.measure.higher_is_better is not None and is_ranked(comparison, score.name)
    ]


def from_best(comparison: ComparedPlates, measure: str) -> list[Difference]:
    """Differences of the other plates from the best one, in the order of the ranks."""
    best, *others = comparison.ordered(measure)
    pairs = {(pair.one, pair.other): pair for pair in comparison.differences if pair.measure == measure}
    return [pairs[name, best] if (name, best) in pairs else _reversed(pairs[best, name]) for name in others]


def _reversed(pair: Difference) -> Difference:
    """The difference with both plates exchanged."""
    low, high = negative((pair.low, pair.high))
    return Difference(pair.measure, pair.other, pair.one, 0.0 - pair.value, low, high)


def short_view(comparison: ComparedPlates, notes: Sequence[str] = ()) -> Section:
    """The deciding measure with its ranks and differences, what is not told apart, and last more notes."""
    score = deciding(comparison)
    if score is None:
        return Section([*hits_used(comparison), "no measure ranks these plates", *notes])
    every = (_open(comparison, score), _used(comparison), *notes)
    return Section([_ranks(comparison, score), *filter(None, every)], _title(comparison, score))


def verdict_of(comparison: ComparedPlates) -> list[str]:
    """Sentences about the best plate by the deciding measure, and what is not told apart; empty where none decides."""
    score = deciding(comparison)
    if score is None:
        return []
    ranks = comparison.ranks(score.name)
    best = [name for name, rank in ranks.items() if rank == 1]
    first = "no two plates are told apart" if len(best) == len(ranks) else f"{listed(best)} first"
    return [f"{_title(comparison, score)}: {first}", *filter(None, [_open(comparison, score)])]


def _title(comparison: ComparedPlates, score: Score) -> str:
    """The deciding measure, its better direction, and the measures before it that tell no plates apart."""
    before = []
    for other in _ranking_scores(comparison):
        if other.name == score.name:
            break
        before.append(other.measure.label)
    tell = "tells" if len(before) == 1 else "tell"
    undecided = f" ({listed(before)} {tell} no two plates apart)" if before else ""
    return f"{score.measure.title}, {score.measure.better}{weighed(comparison, score.name)}{undecided}"


def _ranks(comparison: ComparedPlates, score: Score) -> Table:
    differences = {pair.one: pair for pair in from_best(comparison, score.name)}
    by_ratio = score.name in (comparison.at_equal_weight or ())
    parted = all("add-on" in plate.weights for plate in comparison.plates)
    rows = []
    for rank, plate, shown in comparison.ranked(score.name):
        value = (shown.value, interval_text(shown.low, shown.high))
        ratio = (shown.ratio,) if by_ratio else ()
        pair = differences.get(plate.name)
        apart = (None, "") if pair is None else (pair.value, interval_text(pair.low, pair.high))
        add_on = (plate.weights["add-on"],) if parted else ()
        rows.append((rank, plate.name, *add_on, plate.areal_density, *value, *ratio, *apart))
    best = comparison.ordered(score.name)[0]
    columns = (
        *(number("rank", digits="d"), Column("plate")),
        *([number("add-on kg/m²", digits=".2f")] if parted else []),
        number("whole kg/m²" if parted else "kg/m²", digits=".2f"),
        *(
            number("value"),
            Column("95 % interval"),
            *([number(f"ratio to {comparison.reference}")] if by_ratio else []),
        ),
        *(
            number(f"{'ratio' if by_ratio else 'value'} less {best}", digits="+#.3g"),
            Column(f"{100.0 * comparison.confidence:g} % interval"),
        ),
    )
    return Table(columns, rows)


def _open(comparison: ComparedPlates, score: Score) -> str:
    """Pairs that the measure does not tell apart, and other measures in which another plate is best."""
    pairs = [pair for pair in comparison.differences if pair.measure == score.name and not pair.told_apart]
    total = sum(pair.measure == score.name for pair in comparison.differences)
    alike = "; ".join(f"{pair.one} and {pair.other}" for pair in pairs)
    sentences = [f"not told apart: {'no two of them' if len(pairs) == total else alike or 'none'}"]
    best = {name for name, rank in comparison.ranks(score.name).items() if rank == 1}
    for other in _ranking_scores(comparison):
        ranks = comparison.ranks(other.name)
        first = [name for name, rank in ranks.items() if rank == 1]
        if len(first) < len(ranks) and not best & {*first}:
            sentences.append(f"by {other.measure.label}: {listed(first)} first")
    return "; ".join(sentences)


def _used(comparison: ComparedPlates) -> str:
    """How many hits were compared, and what the ranks do not consider."""
    hits = {plate.hits for plate in comparison.plates}
    count = f"{min(hits)}" if len(hits) == 1 else f"{min(hits)} to {max(hits)}"
    same = "" if any(pair.independent for pair in comparison.pairs) else ", the same shots"
    left_open = f"; not allowed for: {', '.join(comparison.cautions)}" if comparison.cautions else ""
    return f"{count} hits of each plate{same}{left_open}"
