"""How much numbers of a result change under other assumptions about what nobody measured, from hits under
assumptions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import assumed_pair, hit_numbers
from warpimpact.results.measures import Measure
from warpimpact.results.per_hit import Array
from warpimpact.results.tallies import estimate_from
from warpimpact.statistics.student import student_quantile

if TYPE_CHECKING:
    from warpimpact.results.table import Result


AS_GIVEN = "as given"


@dataclass(frozen=True)
class Moves:
    """Changes of a measure by assumptions.

    Attributes:
        by: change of the measure by each assumption, by name; without assumptions that leave no hit that counts.
        hits: numbers of the hits from which the changes follow, shape [hits].
        of_hits: change of the number of each hit by each assumption, shape [hits] each.
    """

    by: Mapping[str, float]
    hits: NDArray[np.int64]
    of_hits: Mapping[str, Array]

    def times(self, factor: float) -> Moves:
        """The changes in another unit."""
        by = {name: factor * move for name, move in self.by.items()}
        return Moves(by, self.hits, {name: factor * moves for name, moves in self.of_hits.items()})


class Assumed:
    """The hits of a result that were computed under assumptions, too; empty if there are none."""

    def __init__(self, dataset: Result, measures: Sequence[Measure]) -> None:
        names: dict[str, int] = json.loads(dataset.attrs.get(attr.ASSUMPTIONS, "{}"))
        of_measures = (name for measure in measures for name in measure.quantity.of)
        needed = dict.fromkeys((v.STATUS, *v.GROUPS["assumed"], *of_measures))
        pair = assumed_pair(dataset[[name for name in needed if name in dataset]]) if names else None
        self._given: Any = None
        self._names: dict[str, NDArray[np.int64]] = {}
        if pair is not None:
            self._given, self._changed, which = pair
            self._names = {name: np.flatnonzero(which == number) for name, number in names.items()}
        self._key: Any = None
        self._by_hit: tuple[Array, Array] = np.empty(0), np.empty(0)

    def moves(self, measure: Measure) -> Moves | None:
        """The changes of a measure by assumptions; None where unknown."""
        if self._given is None or not measure.has_interval:
            return None
        if self._key != (key := (measure.quantity, measure.standoff)):
            self._key, self._by_hit = key, (measure.by_hit(self._given), measure.by_hit(self._changed))
        given, changed = (measure.counted(values) for values in self._by_hit)
        by, of_hits, hits = {}, {}, np.empty(0, dtype=np.int64)
        for name, places in self._names.items():
            before, after = (estimate_from(measure, values[places]).value for values in (given, changed))
            if len(places) and math.isfinite(after - before):
                by[name] = after - before
                hits = hit_numbers(self._given)[places]
                if measure.kind != "quantile":
                    of_hits[name] = measure.averaged(changed[places]) - measure.averaged(given[places])
        return Moves(by, hits, of_hits) if by else None


def moved_apart(first: Moves | None, second: Moves | None, confidence: float) -> dict[str, tuple[float, float]]:
    """Change of the difference of two plates by each assumption, and the half width of its interval by the hits.

    A plate without an assumption keeps its value. Both plates take the same hits, where they have them.
    """
    of_plates = [moves or Moves({}, np.empty(0, dtype=np.int64), {}) for moves in (first, second)]
    apart = {}
    for name in dict.fromkeys(name for moves in of_plates for name in moves.by):
        move = of_plates[0].by.get(name, 0.0) - of_plates[1].by.get(name, 0.0)
        signed = [
            sign * moves.of_hits.get(name, np.empty(0)) for sign, moves in zip((1.0, -1.0), of_plates, strict=True)
        ]
        same = len(signed[0]) == len(signed[1]) and np.array_equal(of_plates[0].hits, of_plates[1].hits)
        samples = [signed[0] + signed[1]] if same else signed
        apart[name] = (move, math.hypot(*(_half_width(sample, confidence) for sample in samples)))
    return apart


def _half_width(numbers: Array, confidence: float) -> float:
    """Half width of Student's interval of a mean; 0 without numbers."""
    known = numbers[~np.isnan(numbers)]
    if len(known) < 2:
        return 0.0
    spread = float(np.std(known, ddof=1)) / math.sqrt(len(known))
    return spread * student_quantile(0.5 * (1.0 + confidence), len(known) - 1)
