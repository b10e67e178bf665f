"""Objectives and bounds of designs from the numbers of their hits, and which paired differences decide.

Hit k of every design lies at the same place of its irreducible part (common random numbers), and belongs to the
scrambling k modulo SCRAMBLINGS. Means over the hits of different scramblings are independent. A difference of two
designs
is the mean of their differences by scrambling, with Student's interval.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from warpimpact.optimisation.asked import Bound, Objective
from warpimpact.optimisation.design import SCRAMBLINGS, Design
from warpimpact.results import attributes as attr
from warpimpact.results.measures import Measure
from warpimpact.scene import Target
from warpimpact.scene.model import Array
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import Estimate, estimate_of
from warpimpact.statistics.student import student_quantile
from warpimpact.statistics.tails import pseudo_values

DIFFERENCE_CONFIDENCE = 0.95


@dataclass(frozen=True)
class DesignRecord:
    """A target with the numbers of its hits so far.

    Attributes:
        values: values of its variables, shape [variables].
        tables: tables of its campaign.
        weights: masses per area [kg/m²], by the names of the measures (results/measures.py).
        levels: numerics for every threat, as JSON.
        said: columns of `Design.keys` by each threat, shape [threats, columns, hits].
        seconds: processor time of its hits [s].
        means, known: cached results of `means` and `values`, by number of hits; empty in every copy.
    """

    values: Array
    tables: dict[str, Any]
    weights: Mapping[str, float]
    levels: tuple[str, ...]
    said: Array
    seconds: float = 0.0
    means: dict[int, Array] = field(default_factory=dict, init=False, compare=False)
    known: dict[int, Array] = field(default_factory=dict, init=False, compare=False)

    @property
    def hits(self) -> int:
        """Number of hits by each threat."""
        return int(self.said.shape[2])

    def more(self, said: Array, seconds: float) -> DesignRecord:
        """The record with further hits."""
        joined = np.concatenate([self.said, said], axis=2)
        return replace(self, said=joined, seconds=self.seconds + seconds)


def weights_of(target: Target) -> dict[str, float]:
    """Masses per area of a target, by the names of the measures."""
    weights = target.weights
    return {attr.AREAL_DENSITY: target.areal_density, attr.ADD_ON_DENSITY: weights.get("add-on", target.areal_density)}


def means(design: Design, record: DesignRecord, hits: int) -> Array:
    """Objectives and bounds over the first hits, by scrambling, shape [asked, SCRAMBLINGS]."""
    if hits not in record.means:
        rows = [_by_scrambling(numbers_of(design, record, goal, hits)) for goal in design.asked]
        record.means[hits] = np.array(rows)
    return record.means[hits]


def values(design: Design, record: DesignRecord) -> Array:
    """Objectives and bounds over all hits, shape [asked]; NaN where no hit counts."""
    hits = record.hits
    if hits not in record.known:
        record.known[hits] = np.array([_mean(numbers_of(design, record, goal, hits)) for goal in design.asked])
    return record.known[hits]


def numbers_of(design: Design, record: DesignRecord, goal: Objective | Bound, hits: int) -> Array:
    """Numbers of the first hits whose mean is an objective or a bound, shape [hits]: those of the worst threat,
    or averages over threats, as the goal asks."""
    measure = goal.asked
    if measure.kind == "target":
        return np.full(hits, record.weights[measure.name])
    numbers = record.said[:, design.keys.index(measure.column), :hits]
    if not measure.is_binary:
        numbers = np.array([_averaged(measure, of_hits) for of_hits in numbers])
    weights = np.array([threat.weight for threat in design.threats])
    return np.asarray(weights @ numbers / weights.sum()) if goal.threats == "mean" else _worst(goal, numbers)


def _worst(goal: Objective | Bound, numbers: Array) -> Array:
    """The row whose mean is worst, of numbers of shape [rows, hits]."""
    signed = goal.sign * np.array([_mean(row) for row in numbers])
    return np.asarray(numbers[int(np.argmax(np.nan_to_num(signed, nan=np.inf)))])


def _averaged(measure: Measure, numbers: Array) -> Array:
    """Numbers of hits whose mean is a measure, shape [hits]. A quantile is the one of Harrell and Davis, a smooth
    function of the hits, so that a small change of a design changes it little (statistics/tails.py)."""
    if measure.kind == "quantile":
        return pseudo_values(numbers, measure.share)
    return measure.averaged(measure.counted(numbers))


def estimate(design: Design, record: DesignRecord, goal: Objective | Bound) -> Estimate:
    """An objective or a bound with its interval, by all hits."""
    if goal.asked.kind == "target":
        weight = record.weights[goal.asked.name]
        return Estimate(weight, weight, weight, record.hits, 0.0)
    numbers = numbers_of(design, record, goal, record.hits)
    averaged = goal.threats == "mean" and len(design.threats) > 1
    is_share = goal.asked.is_binary and not averaged
    return estimate_of("share" if is_share else "mean", numbers, replicates=SCRAMBLINGS)


def objectives(design: Design, record: DesignRecord) -> Array:
    """Objectives, with signs such that they are to be minimised, shape [objectives]; infinite where no hit counts."""
    signs = np.array([objective.sign for objective in design.objectives])
    signed = signs * values(design, record)[: len(signs)]
    return np.asarray(np.nan_to_num(signed, nan=np.inf, posinf=np.inf, neginf=-np.inf))


def excesses(design: Design, record: DesignRecord) -> Array:
    """Violation of each bound as a share of its limit, shape [bounds]; 0 where the bound is kept to rounding, 1 where
    no hit counts."""
    bounded = values(design, record)[len(design.objectives) :]
    over = [
        bound.sign * (value - bound.limit) / (abs(bound.limit) or 1.0)
        for bound, value in zip(design.bounds, bounded, strict=True)
    ]
    shares = np.nan_to_num(np.array(over), nan=1.0)
    return np.where(shares > ROUNDED, shares, 0.0)


def undecided(
    design: Design, candidates: Sequence[DesignRecord], rivals: Sequence[DesignRecord], hits: int
) -> list[bool]:
    """Whether each candidate may be on the front by the first hits: no bound is certainly broken, and no rival is
    certainly better. A difference within rounding decides nothing."""
    signs = np.array([goal.sign for goal in design.asked])[:, None]
    count = len(design.objectives)
    limits = np.array([bound.sign * bound.limit for bound in design.bounds]).reshape(-1, 1)
    of_rivals = np.array([signs * means(design, rival, hits) for rival in rivals])
    of_rivals = of_rivals.reshape(len(rivals), len(signs), -1)
    still_open = []
    for candidate in candidates:
        signed = signs * means(design, candidate, hits)
        is_broken = (interval(signed[count:] - limits)[0] > ROUNDED * np.abs(limits[:, 0])).any()
        others = of_rivals[[rival is not candidate for rival in rivals]]
        low = interval(signed[None, :count] - others[:, :count])[0]
        rounded = ROUNDED * np.nan_to_num(np.abs(signed[:count])).max(axis=1)
        is_worse = (low >= -rounded).all(axis=1) & (low > rounded).any(axis=1)
        still_open.append(not is_broken and not bool(is_worse.any()))
    return still_open


def interval(numbers: Array) -> tuple[Array, Array]:
    """Student's intervals of means over the last axis; (−inf, inf) where fewer than two numbers count."""
    count = np.sum(~np.isnan(numbers), axis=-1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # numpy warns of means over no number
        mean, spread = np.nanmean(numbers, axis=-1), np.nanstd(numbers, axis=-1)
        by_count = {
            n: student_quantile(0.5 + 0.5 * DIFFERENCE_CONFIDENCE, int(n) - 1) for n in np.unique(count) if n > 1
        }
        factor = np.vectorize(lambda n: by_count.get(n, np.inf), otypes=[float])(count)
        half = np.where(count > 1, factor * spread / np.sqrt(np.maximum(count - 1, 1)), np.inf)
    mean = np.nan_to_num(mean)
    return mean - half, mean + half


def _mean(numbers: Array) -> float:
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def _by_scrambling(numbers: Array) -> Array:
    """Mean over the hits of every scrambling, shape [SCRAMBLINGS]; NaN where no hit of a scrambling counts."""
    missing = -len(numbers) % SCRAMBLINGS
    dealt = np.concatenate([numbers, np.full(missing, np.nan)]).reshape(-1, SCRAMBLINGS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmean(dealt, axis=0))
