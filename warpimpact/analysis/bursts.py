"""Effects of earlier hits on the same plate: by the order of the hits, and by the distance to the nearest earlier one.

The hits of a burst are not independent. Intervals count bursts (statistics/clusters.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.analysis.estimates import means_of, slices
from warpimpact.analysis.numbers import interval_text, plus_minus
from warpimpact.results import variables as v
from warpimpact.results.dataset import shots_at_a_plate
from warpimpact.results.measures import Measure
from warpimpact.results.per_hit import Array
from warpimpact.results.tallies import dealing
from warpimpact.statistics.clusters import cluster_estimate, cluster_numbers
from warpimpact.statistics.comparisons import confidence_of_each
from warpimpact.statistics.intervals import Estimate, Estimating, estimate_of
from warpimpact.view.view import Column, Section, Table, number

if TYPE_CHECKING:
    from warpimpact.results.table import Result

BINS = 12
"""Number of bins of distance, with equal numbers of hits each; fewer if the hits lie at fewer distances."""


@dataclass(frozen=True)
class Group:
    """Hits of bursts with the same order, or at similar distances.

    Attributes:
        name: such as "2" for the second hits, or "1.2 to 2.5" for hits at these distances [mm].
        distance: smallest, mean and largest distance from the nearest earlier hit on the plate [m]; NaN for first hits.
        estimates: mean or share of every measure.
        differences: estimates minus those of the first hits, in intervals that hold together for all bins of distance.
    """

    name: str
    distance: tuple[float, float, float]
    estimates: dict[Measure, Estimate]
    differences: dict[Measure, Estimate]

    @property
    def count(self) -> int:
        """Number of hits that count for the share that perforated: all but failed ones."""
        return max(estimate.count for estimate in self.estimates.values())


@dataclass(frozen=True)
class Bursts:
    """How much later hits of bursts differ from first ones.

    Attributes:
        measures: measures of every group.
        orders: first hits, second hits, …
        distances: later hits by the distance to the nearest earlier one, increasing.
    """

    measures: tuple[Measure, ...]
    orders: list[Group]
    distances: list[Group]

    def noticed_within(self, measure: Measure) -> float:
        """Distance [m] from which a hit no longer notices the nearest earlier one: the far end of the last bin in which
        the interval of the difference from the first hits does not contain 0.

        0 if there is no such bin, infinite if it is the last one. With more bursts smaller differences can be seen.
        """
        noticed = [group for group in self.distances if _is_apart(group.differences[measure])]
        if not noticed:
            return 0.0
        return math.inf if noticed[-1] is self.distances[-1] else noticed[-1].distance[2]


def bursts(dataset: Result) -> Bursts:
    """Analyse a result of bursts. Of an open file one number per hit is in memory."""
    members = shots_at_a_plate(dataset)
    velocity, *tilts = means_of((v.RESIDUAL_VELOCITY, v.TILT), dataset[v.STANDOFF].values.tolist())
    measures = (velocity, *tilts[-1:], Measure.parse("P(perforated)"))
    needed = dataset[[v.STATUS, v.RESIDUAL_VELOCITY, v.TILT, v.NEAREST_EARLIER_HIT]]
    parts = [
        (part[v.NEAREST_EARLIER_HIT].values, *(measure.values(part) for measure in measures)) for part in slices(needed)
    ]
    nearest, *columns = (np.concatenate(column).reshape(-1, members) for column in zip(*parts, strict=True))
    values, replicates = dict(zip(measures, columns, strict=True)), dealing(dataset)["replicates"]
    order = np.broadcast_to(np.arange(members), nearest.shape)
    later = _bins(nearest[:, 1:])

    def group(name: str, which: np.ndarray) -> Group:
        distances = nearest[which & ~np.isnan(nearest)]
        ends = (distances.min(), distances.mean(), distances.max()) if len(distances) else (math.nan,) * 3
        chosen = {measure: np.where(which, column, np.nan) for measure, column in values.items()}
        alone = {measure: np.where(order == 0, column, np.nan) for measure, column in values.items()}
        together: Estimating = {"replicates": replicates, "confidence": confidence_of_each(0.95, len(later))}
        return Group(
            name,
            (float(ends[0]), float(ends[1]), float(ends[2])),
            {
                measure: cluster_estimate(chosen[measure], binary=measure.is_binary, replicates=replicates)
                for measure in measures
            },
            {
                measure: estimate_of(
                    "mean", cluster_numbers(chosen[measure]) - cluster_numbers(alone[measure]), **together
                )
                for measure in measures
            },
        )

    return Bursts(
        measures,
        [group(str(k + 1), order == k) for k in range(members)],
        [group(_range(low, high), (nearest >= low) & (nearest <= high)) for low, high in later],
    )


def _bins(distances: Array) -> list[tuple[float, float]]:
    """Ends of the bins, both included. If there are few distances, each is a bin."""
    distinct = np.unique(np.round(distances, 9))
    if len(distinct) <= BINS:
        return [(float(at) - 1e-9, float(at) + 1e-9) for at in distinct]
    parts = np.array_split(np.sort(distances.ravel()), BINS)
    return [(float(part[0]), float(part[-1])) for part in parts]


def _range(low: float, high: float) -> str:
    low, high = max(0.0, low) * 1e3, high * 1e3
    return f"{low:.1f} to {high:.1f}" if high - low > 0.01 else f"{high:.1f}"


def _is_apart(difference: Estimate) -> bool:
    return difference.low > 0.0 or difference.high < 0.0


PASSED_ALONE = "velocity and tilt are those of the cores that passed"


def orders_view(result: Bursts) -> Section:
    """The table of hits by their order."""
    return Section([_table(result.measures, "hit of a burst", result.orders), f"({PASSED_ALONE})"])


def bursts_view(result: Bursts) -> list[Section]:
    """Both tables, and the distances from which a hit no longer notices an earlier one."""
    by_distance = _table(result.measures, "nearest earlier hit [mm]", result.distances)
    return [orders_view(result), Section([by_distance, *_reaches(result)])]


def _table(measures: Sequence[Measure], title: str, groups: Sequence[Group]) -> Table:
    return Table(
        [Column(title), number("hits", digits="d"), *(Column(measure.axis) for measure in measures)],
        [
            (group.name, group.count, *(_cell(measure, group.estimates[measure]) for measure in measures))
            for group in groups
        ],
    )


def _cell(measure: Measure, estimate: Estimate) -> str:
    if not estimate.count:
        return "-"
    if measure.is_binary:
        return f"{estimate.value:.4f} ({interval_text(estimate.low, estimate.high, '{:.4f}'.format)})"
    return plus_minus(estimate, ".2f", ".2f")


def _reaches(result: Bursts) -> Iterator[str]:
    for measure in result.measures:
        within = result.noticed_within(measure)
        if within == 0.0:
            reach = "differs from that of first hits at no distance"
        elif math.isinf(within):
            reach = "differs from that of first hits up to the largest distances"
        else:
            reach = f"differs from that of first hits up to {within * 1e3:.1f} mm"
        yield f"{measure.axis.partition(' [')[0]}: {reach} from the nearest earlier hit"
    yield "(intervals of the differences hold together at 95 %; more bursts show smaller differences)"
