"""A comparison of plates in words: who is best at what, then every measure as a ranking with its differences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from warpimpact.analysis.effectiveness import SHOWN_UNITS
from warpimpact.analysis.numbers import interval_text, of_each
from warpimpact.analysis.numbers import number_text as number

if TYPE_CHECKING:
    from warpimpact.analysis.comparison import Comparison, Contestant, Difference
    from warpimpact.analysis.effectiveness import Measure


def comparison_text(comparison: Comparison) -> str:
    """Who is best at what, then every measure as a ranking with differences in words."""
    measures = comparison.plates[0].measures
    compared = [measure for measure in measures if measure.hit is None]
    blocks = [_conditions(comparison), _best(comparison, compared)]
    blocks += [_ranking(comparison, measure) for measure in compared]
    return "\n\n".join("\n".join(block) for block in blocks)


def _conditions(comparison: Comparison) -> list[str]:
    together = f"Differences of a measure hold together at {comparison.confidence:.0%} (Bonferroni over the pairs)."
    chance = "The intervals describe the hits that were drawn, not what the model leaves out."
    return [*hits_used(comparison), together, chance, *comparison.notes]


def hits_used(comparison: Comparison) -> list[str]:
    """How many hits were compared and how, a sentence each."""
    hits = {plate.name: plate.hits for plate in comparison.plates}
    one, *others = dict.fromkeys(hits.values())
    if not others and not any(pair.independent for pair in comparison.pairs):
        return [f"{one} hits of each plate: the same shots at every plate, compared shot by shot."]
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
        f"{measure.label}{SHOWN_UNITS[measure.units]}; {better} is better{weighed(comparison, measure.name)}",
        f"rank  {'plate':<{width}}{'kg/m²':>8}{'value':>10}   {'95 % interval':<20}ratio to the solid plate",
    ]
    sign, by_ratio = -1.0 if measure.higher_is_better else 1.0, measure.name in (comparison.at_equal_weight or ())

    def order(plate: Contestant) -> tuple[int, float]:
        told = plate.measures[place]
        return ranks[plate.name], sign * (told.ratio if by_ratio else told.value)

    for plate in sorted(comparison.plates, key=order):
        told = plate.measures[place]
        interval = "" if math.isnan(told.ratio_low) else f"  {interval_text(told.ratio_low, told.ratio_high)}"
        lines.append(
            f"{ranks[plate.name]:>4}  {plate.name:<{width}}{plate.areal_density:>8.2f}{number(told.value):>10}   "
            f"{interval_text(told.low, told.high):<20}{number(told.ratio)}{interval}"
        )
    what = " in the ratio to the solid plate" if by_ratio else ""
    lines += [_in_words(pair, measure, what) for pair in comparison.differences if pair.measure == measure.name]
    return lines


def weighed(comparison: Comparison, measure: str) -> str:
    """By what plates of different weight are ranked in a measure, to follow its name; empty where weights are the
    same."""
    if comparison.at_equal_weight is None:
        return ""
    by_ratio = measure in comparison.at_equal_weight
    return "; ranked by the ratio to the solid plate" if by_ratio else "; ranked without regard to weight"


def _in_words(pair: Difference, measure: Measure, what: str) -> str:
    """Such as "a better than b by 0.1 (0.05 to 0.15)"; `what` follows the difference."""
    if not pair.told_apart:
        interval = f"({interval_text(pair.low, pair.high)})"
        return f"{pair.one} and {pair.other} cannot be told apart: difference{what} {number(pair.value)} {interval}"
    names = [pair.one, pair.other] if (pair.value > 0.0) == measure.higher_is_better else [pair.other, pair.one]
    low, high = sorted((abs(pair.low), abs(pair.high)))
    return f"{names[0]} better than {names[1]} by {number(abs(pair.value))}{what} ({interval_text(low, high)})"
