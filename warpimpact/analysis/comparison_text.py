"""A comparison of plates: values and ranks, and their text. The best plates come first, then every measure as a ranking
with its differences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from warpimpact.analysis.contestants import Contestant, Difference, Pair
from warpimpact.analysis.effectiveness import Score
from warpimpact.analysis.numbers import interval_text, number_text, of_each
from warpimpact.analysis.plate_text import common_name
from warpimpact.view.view import Column, Section, Table, number, text_of


@dataclass(frozen=True)
class ComparedPlates:
    """Plates side by side.

    Attributes:
        plates: in the order in which they were given; all have the same measures.
        differences: differences of every pair of plates in every measure that has intervals.
        pairs: how the hits of every pair were used.
        at_equal_weight: names of the measures in which plates of different weight were compared by their ratios to the
            solid plate; None if the weights are the same.
        confidence: confidence at which the intervals of a measure's differences hold together.
        notes: further notes, a sentence each.
        cautions: differences or unknowns of the plates that the ranks do not consider, in a few words.
    """

    plates: tuple[Contestant, ...]
    differences: tuple[Difference, ...]
    pairs: tuple[Pair, ...]
    at_equal_weight: frozenset[str] | None
    confidence: float
    notes: tuple[str, ...]
    cautions: tuple[str, ...] = ()

    @property
    def reference(self) -> str:
        """Name of the solid references."""
        return common_name(plate.reference for plate in self.plates)

    def ranks(self, measure: str) -> dict[str, int]:
        """Rank of each plate by its value, by name. Plates with the same rank form a group in which no two are told
        apart. The rank of a group is one more than the number of plates before it."""
        distinct = {(pair.one, pair.other) for pair in self.differences if pair.measure == measure and pair.told_apart}
        group: list[str] = []
        ranks: dict[str, int] = {}
        for place, name in enumerate(self.ordered(measure), start=1):
            if not group or any({(name, other), (other, name)} & distinct for other in group):
                group, rank = [], place
            group.append(name)
            ranks[name] = rank
        return ranks

    def ranked(self, measure: str) -> list[tuple[int, Contestant, Score]]:
        """Rank, plate and score, the best plate first."""
        plates = {plate.name: plate for plate in self.plates}
        return [(rank, plates[name], plates[name].score(measure)) for name, rank in self.ranks(measure).items()]

    def ordered(self, measure: str) -> list[str]:
        """Names of the plates, the best value first (or the best ratio to the solid plate, where that counts)."""
        by_ratio = measure in (self.at_equal_weight or ())

        def worse(plate: Contestant) -> float:
            told = plate.score(measure)
            value = told.ratio if by_ratio else told.value
            return math.inf if math.isnan(value) else -value if told.measure.higher_is_better else value

        return [plate.name for plate in sorted(self.plates, key=worse)]


def comparison_text(comparison: ComparedPlates) -> str:
    """The view of a comparison as text."""
    return text_of(comparison_view(comparison))


def comparison_view(comparison: ComparedPlates) -> list[Section]:
    """What was compared, the best plates, then every measure as a ranking with differences in words."""
    best = Table((Column("best at"), Column("plate")), best_rows(comparison))
    rankings = (_ranking(comparison, measure) for measure in compared_scores(comparison))
    return [Section(conditions(comparison)), Section([best]), *rankings]


def conditions(comparison: ComparedPlates) -> list[str]:
    """What was compared and how, a sentence each."""
    together = f"Differences of a measure hold together at {comparison.confidence:.0%} (Bonferroni over the pairs)."
    chance = "The intervals describe the hits that were drawn, not what the model leaves out."
    return [*hits_used(comparison), together, chance, *comparison.notes]


def hits_used(comparison: ComparedPlates) -> list[str]:
    """How many hits were compared and how, a sentence each."""
    hits = {plate.name: plate.hits for plate in comparison.plates}
    shared, *others = dict.fromkeys(hits.values())
    if not others and not any(pair.independent for pair in comparison.pairs):
        return [f"{shared} hits of each plate: the same shots at every plate, compared shot by shot."]
    lines = [f"Hits: {of_each(list(hits), list(map(str, hits.values())))}; all of them count."]
    for pair in comparison.pairs:
        if pair.independent:
            lines.append(f"{pair.one} and {pair.other}: compared as independent, because {pair.independent}.")
        elif hits[pair.one] == hits[pair.other]:
            lines.append(f"{pair.one} and {pair.other}: the same shots, compared shot by shot.")
        else:
            larger = max(pair.one, pair.other, key=hits.__getitem__)
            lines.append(
                f"{pair.one} and {pair.other}: the first {pair.paired} hits are the same shots, compared shot by shot; "
                f"the other {hits[larger] - pair.paired} of {larger} count on their own."
            )
    return lines


def compared_scores(comparison: ComparedPlates) -> list[Score]:
    """The measures of the first plate in which plates are compared, without worst hits, which have no interval."""
    return [score for score in comparison.plates[0].measures if score.measure.kind != "worst_point"]


def best_rows(comparison: ComparedPlates) -> list[tuple[str, str]]:
    """Every measure and the best plate in it."""
    rows = []
    for measure in compared_scores(comparison):
        if measure.measure.higher_is_better is None:
            continue
        first = [name for name, rank in comparison.ranks(measure.name).items() if rank == 1]
        told_apart = len(first) < len(comparison.plates)
        neither = "cannot be told apart" if is_ranked(comparison, measure.name) else "not ranked"
        sentence = listed(first) + _as_good(comparison, measure.name, first)
        rows.append((measure.measure.label, sentence if told_apart else neither))
    return rows


def _as_good(comparison: ComparedPlates, measure: str, first: Sequence[str]) -> str:
    """Words about plates behind the best that no difference tells from any of these; mostly empty."""
    apart = [{pair.one, pair.other} for pair in comparison.differences if pair.measure == measure and pair.told_apart]
    others = [plate.name for plate in comparison.plates if plate.name not in first]
    open_ = [name for name in others if not all({name, leader} in apart for leader in first)]
    return f" (not told apart for certain from {listed(open_)})" if open_ else ""


def is_ranked(comparison: ComparedPlates, measure: str) -> bool:
    """Whether the plates are ranked in a measure. If not, the notes or the missing interval say why."""
    return any(pair.measure == measure and not math.isnan(pair.low) for pair in comparison.differences)


def listed(names: Sequence[str]) -> str:
    """Names as text such as "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _ranking(comparison: ComparedPlates, measure: Score) -> Section:
    """One measure of all plates, the best first, and a sentence for every pair."""
    ranked = is_ranked(comparison, measure.name)
    reference, parted = comparison.reference, all("add-on" in plate.weights for plate in comparison.plates)
    rows = []
    for rank, plate, shown in comparison.ranked(measure.name):
        value = (plate.areal_density, shown.value, shown.interval, shown.ratio, shown.ratio_text)
        rows.append(
            (rank if ranked else "-", plate.name, *value, plate.weights.get("add-on"), shown.alone)[: 7 + 2 * parted]
        )
    columns = [
        *(number("rank", digits="d"), Column("plate"), number("whole kg/m²" if parted else "kg/m²", digits=".2f")),
        *(number("value"), Column("95 % interval"), number(f"ratio to the {reference}"), Column("95 % interval")),
    ]
    columns += [number("add-on kg/m²", digits=".2f"), number("base alone")] if parted else []
    what = f" in the ratio to the {reference}" if measure.name in (comparison.at_equal_weight or ()) else ""
    differences = [_in_words(pair, measure, what) for pair in comparison.differences if pair.measure == measure.name]
    title = f"{measure.measure.title}; {measure.measure.better}{weighed(comparison, measure.name)}"
    return Section([Table(columns, rows), *differences], title)


def weighed(comparison: ComparedPlates, measure: str) -> str:
    """By what plates of different weight are ranked in a measure, to follow its name; empty where weights are the
    same."""
    if comparison.at_equal_weight is None:
        return ""
    by_ratio = measure in comparison.at_equal_weight
    return f"; ranked by the ratio to the {comparison.reference}" if by_ratio else "; ranked without regard to weight"


def _in_words(pair: Difference, measure: Score, what: str) -> str:
    """Text such as "a better than b by 0.1 (0.05 to 0.15)"; `what` follows the difference."""
    if math.isnan(pair.low):
        text = f"difference{what} {number_text(pair.value)}"
        return f"{pair.one} and {pair.other}: {text}, of which these hits give no interval"
    if not pair.told_apart:
        interval = interval_text(pair.low, pair.high)
        difference = f"difference{what} {number_text(pair.value)} ({interval})"
        return f"{pair.one} and {pair.other} cannot be told apart: {difference}"
    better = measure.measure.higher_is_better
    names = [pair.one, pair.other] if (pair.value > 0.0) == (better is not False) else [pair.other, pair.one]
    by_hits = (pair.low, pair.high)
    interval = interval_text(*(negative(by_hits) if pair.value < 0.0 else by_hits))
    than = f"{'higher' if better is None else 'better'} than"
    return f"{names[0]} {than} {names[1]} by {number_text(abs(pair.value))}{what} ({interval})"


def negative(interval: tuple[float, float]) -> tuple[float, float]:
    """The interval of the negated number."""
    return -interval[1], -interval[0]
