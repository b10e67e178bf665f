"""A comparison of plates: values, ranks, and their text.

The short answer has the deciding measure, the plates in its order with their differences from the best one, and open
points. The long answer has every measure as a ranking.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from warpimpact.analysis.effectiveness import Score
from warpimpact.analysis.numbers import interval_text, number_text, of_each
from warpimpact.analysis.plate_text import common_name
from warpimpact.view.view import Column, Section, Table, html_of, number


@dataclass(frozen=True)
class PlateScore:
    """A plate and how well it protects: areal density of the whole target [kg/m²], share of open area, solid reference
    and its name, and `Target.weights`."""

    name: str
    hits: int
    areal_density: float
    open_area: float
    measures: tuple[Score, ...]
    solid: str = ""
    reference: str = "solid plate"
    weights: Mapping[str, float] = field(default_factory=dict)

    def score(self, measure: str) -> Score:
        """The score in a measure of this text."""
        return next(score for score in self.measures if score.name == measure)


@dataclass(frozen=True)
class Difference:
    """Difference of a measure between one plate and another, with its interval; NaN where there is none."""

    measure: str
    one: str
    other: str
    value: float
    low: float
    high: float

    @property
    def is_significant(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low > 0.0 or self.high < 0.0

    def exchanged(self) -> Difference:
        """The difference with both plates exchanged."""
        return Difference(self.measure, self.other, self.one, 0.0 - self.value, -self.high, -self.low)


@dataclass(frozen=True)
class Pair:
    """How the hits of two plates were used.

    Attributes:
        paired: number of first hits that are the same shots at both plates, which are compared shot by shot.
        independent: why the plates were compared as independent; empty where they were hit by the same shots.
    """

    one: str
    other: str
    paired: int
    independent: str


@dataclass(frozen=True)
class Comparison:
    """Plates side by side, by their measures, with the differences that the hits show. A notebook shows the short
    answer, and every measure behind it.

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

    plates: tuple[PlateScore, ...]
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
        """Rank of each plate by its value, by name. Plates with the same rank form a group without a significant
        difference. The rank of a group is one more than the number of plates before it."""
        distinct = {(pair.one, pair.other) for pair in self.pairs_in(measure) if pair.is_significant}
        group: list[str] = []
        ranks: dict[str, int] = {}
        for place, name in enumerate(self.ordered(measure), start=1):
            if not group or any({(name, other), (other, name)} & distinct for other in group):
                group, rank = [], place
            group.append(name)
            ranks[name] = rank
        return ranks

    def pairs_in(self, measure: str) -> list[Difference]:
        """The differences in a measure."""
        return [pair for pair in self.differences if pair.measure == measure]

    def first(self, measure: str) -> list[str]:
        """Names of the plates of rank 1."""
        return [name for name, rank in self.ranks(measure).items() if rank == 1]

    def ranked(self, measure: str) -> list[tuple[int, PlateScore, Score]]:
        """Rank, plate and score, the best plate first."""
        plates = {plate.name: plate for plate in self.plates}
        return [(rank, plates[name], plates[name].score(measure)) for name, rank in self.ranks(measure).items()]

    def ordered(self, measure: str) -> list[str]:
        """Names of the plates, the best value first (or the best ratio to the solid plate, where that counts)."""
        by_ratio = measure in (self.at_equal_weight or ())

        def worse(plate: PlateScore) -> float:
            score = plate.score(measure)
            value = score.ratio if by_ratio else score.value
            return math.inf if math.isnan(value) else -value if score.measure.higher_is_better else value

        return [plate.name for plate in sorted(self.plates, key=worse)]

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        every = html_of(comparison_view(self))
        return f"{html_of([short_view(self)])}<details><summary>Every measure</summary>{every}</details>"


def deciding(comparison: Comparison) -> Score | None:
    """The measure that decides, with the values of the first plate: the first measure by which hits tell two plates
    apart, else the first one that ranks plates; None if there is none.

    Measures have the order in which they were asked for, by default that of `effectiveness.SHOWN`: what reaches the
    base comes before what flies behind the target.
    """
    ranked = _ranking_scores(comparison)
    apart = {pair.measure for pair in comparison.differences if pair.is_significant}
    return next((score for score in ranked if score.name in apart), ranked[0] if ranked else None)


def _ranking_scores(comparison: Comparison) -> list[Score]:
    """Measures with a better direction and with intervals."""
    return [
        score
        for score in _compared_scores(comparison)
        if score.measure.higher_is_better is not None and is_ranked(comparison, score.name)
    ]


def from_best(comparison: Comparison, measure: str) -> list[Difference]:
    """Differences of the other plates from the best one, in the order of the ranks."""
    best, *others = comparison.ordered(measure)
    pairs = {(pair.one, pair.other): pair for pair in comparison.pairs_in(measure)}
    pairs |= {(pair.other, pair.one): pair.exchanged() for pair in pairs.values()}
    return [pairs[name, best] for name in others]


def short_view(comparison: Comparison, notes: Sequence[str] = ()) -> Section:
    """The deciding measure with its ranks and differences, what is not told apart, and last more notes."""
    score = deciding(comparison)
    if score is None:
        return Section([*hits_used(comparison), "no measure ranks these plates", *notes])
    every = (_open(comparison, score), _used(comparison), *notes)
    return Section([_ranks(comparison, score), *filter(None, every)], _title(comparison, score))


def verdict_of(comparison: Comparison) -> list[str]:
    """Sentences about the best plate by the deciding measure, and what is not told apart; empty where none decides."""
    score = deciding(comparison)
    if score is None:
        return []
    best = comparison.first(score.name)
    first = "no two plates are told apart" if len(best) == len(comparison.plates) else f"{_listed(best)} first"
    return [f"{_title(comparison, score)}: {first}", *filter(None, [_open(comparison, score)])]


def _title(comparison: Comparison, score: Score) -> str:
    """The deciding measure, its better direction, and the measures before it that tell no plates apart."""
    before = []
    for other in _ranking_scores(comparison):
        if other.name == score.name:
            break
        before.append(other.measure.label)
    tell = "tells" if len(before) == 1 else "tell"
    undecided = f" ({_listed(before)} {tell} no two plates apart)" if before else ""
    return f"{score.measure.title}, {score.measure.better}{_weighed(comparison, score.name)}{undecided}"


def _ranks(comparison: Comparison, score: Score) -> Table:
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


def _open(comparison: Comparison, score: Score) -> str:
    """Pairs that the measure does not tell apart, and other measures in which another plate is best."""
    pairs = comparison.pairs_in(score.name)
    alike = [f"{pair.one} and {pair.other}" for pair in pairs if not pair.is_significant]
    sentences = [f"not told apart: {'no two of them' if len(alike) == len(pairs) else '; '.join(alike) or 'none'}"]
    best = comparison.first(score.name)
    for other in _ranking_scores(comparison):
        first = comparison.first(other.name)
        if len(first) < len(comparison.plates) and not {*best} & {*first}:
            sentences.append(f"by {other.measure.label}: {_listed(first)} first")
    return "; ".join(sentences)


def _used(comparison: Comparison) -> str:
    """How many hits were compared, and what the ranks do not consider."""
    hits = {plate.hits for plate in comparison.plates}
    count = f"{min(hits)}" if len(hits) == 1 else f"{min(hits)} to {max(hits)}"
    same = "" if any(pair.independent for pair in comparison.pairs) else ", the same shots"
    left_open = f"; not allowed for: {', '.join(comparison.cautions)}" if comparison.cautions else ""
    return f"{count} hits of each plate{same}{left_open}"


def comparison_view(comparison: Comparison) -> list[Section]:
    """What was compared, the best plates, then every measure as a ranking with differences in words."""
    best = Table((Column("best at"), Column("plate")), best_rows(comparison))
    rankings = (_ranking(comparison, measure) for measure in _compared_scores(comparison))
    together = f"Differences of a measure hold together at {comparison.confidence:.0%} (Bonferroni over the pairs)."
    chance = "The intervals describe the hits that were drawn, not what the model leaves out."
    conditions = [*hits_used(comparison), together, chance, *comparison.notes]
    return [Section(conditions), Section([best]), *rankings]


def hits_used(comparison: Comparison) -> list[str]:
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


def _compared_scores(comparison: Comparison) -> list[Score]:
    """The measures of the first plate in which plates are compared, without worst hits, which have no interval."""
    return [score for score in comparison.plates[0].measures if score.measure.kind != "worst_point"]


def best_rows(comparison: Comparison) -> list[tuple[str, str]]:
    """Every measure and the best plate in it."""
    rows = []
    for measure in _compared_scores(comparison):
        if measure.measure.higher_is_better is None:
            continue
        first = comparison.first(measure.name)
        sentence = _listed(first) + _as_good(comparison, measure.name, first)
        if len(first) == len(comparison.plates):
            sentence = "cannot be told apart" if is_ranked(comparison, measure.name) else "not ranked"
        rows.append((measure.measure.label, sentence))
    return rows


def _as_good(comparison: Comparison, measure: str, first: Sequence[str]) -> str:
    """Words about plates behind the best that no difference tells from any of these; mostly empty."""
    apart = [{pair.one, pair.other} for pair in comparison.pairs_in(measure) if pair.is_significant]
    others = [plate.name for plate in comparison.plates if plate.name not in first]
    open_ = [name for name in others if not all({name, leader} in apart for leader in first)]
    return f" (not told apart for certain from {_listed(open_)})" if open_ else ""


def is_ranked(comparison: Comparison, measure: str) -> bool:
    """Whether the plates are ranked in a measure. If not, the notes or the missing interval say why."""
    return not all(math.isnan(pair.low) for pair in comparison.pairs_in(measure))


def _listed(names: Sequence[str]) -> str:
    """Names as text such as "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _ranking(comparison: Comparison, measure: Score) -> Section:
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
    differences = [_in_words(pair, measure, what) for pair in comparison.pairs_in(measure.name)]
    title = f"{measure.measure.title}; {measure.measure.better}{_weighed(comparison, measure.name)}"
    return Section([Table(columns, rows), *differences], title)


def _weighed(comparison: Comparison, measure: str) -> str:
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
    if not pair.is_significant:
        interval = interval_text(pair.low, pair.high)
        difference = f"difference{what} {number_text(pair.value)} ({interval})"
        return f"{pair.one} and {pair.other} cannot be told apart: {difference}"
    better = measure.measure.higher_is_better
    more = pair if pair.value > 0.0 else pair.exchanged()
    names = (more.other, more.one) if better is False else (more.one, more.other)
    than = "higher than" if better is None else "better than"
    return f"{names[0]} {than} {names[1]} by {number_text(more.value)}{what} ({interval_text(more.low, more.high)})"
