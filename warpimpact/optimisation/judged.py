"""What the hits of designs say of objectives and bounds, and which paired differences decide.

Hit k of every design lies at the same place of its irreducible part (common random numbers), and belongs to the
scrambling k modulo their number. Means over the hits of a scrambling are independent of those of another. A difference
of two designs is the mean of their differences by scrambling, with Student's interval.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.optimisation.asked import Bound, Objective
from warpimpact.optimisation.design import Design
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import Estimate, estimate_of
from warpimpact.statistics.student import student_quantile

Array = NDArray[np.float64]

CONFIDENCE = 0.95
SCRAMBLINGS = 16


@dataclass(frozen=True)
class Record:
    """A design, and what its hits have said so far.

    Attributes:
        values: of its variables, shape [variables].
        tables: of its campaign.
        areal_density: [kg/m²].
        levels: numerics for every threat, as JSON.
        said: of every threat and effect, shape [threats, effects, hits].
        seconds: processor time that its hits took.
        means, known: what `means` and `values` found, by the number of hits.
    """

    values: Array
    tables: dict[str, Any]
    areal_density: float
    levels: tuple[str, ...]
    said: Array
    seconds: float = 0.0
    means: dict[int, Array] = field(default_factory=dict, compare=False)
    known: dict[int, Array] = field(default_factory=dict, compare=False)

    @property
    def hits(self) -> int:
        """Hits by each threat."""
        return int(self.said.shape[2])

    def more(self, said: Array, seconds: float) -> Record:
        """With further hits."""
        joined = np.concatenate([self.said, said], axis=2)
        return replace(self, said=joined, seconds=self.seconds + seconds, means={}, known={})


def means(design: Design, record: Record, hits: int) -> Array:
    """Objectives and bounds over the first hits by scrambling, shape [asked, SCRAMBLINGS]."""
    if hits not in record.means:
        rows = [_by_scrambling(numbers_of(design, record, one, hits)) for one in design.asked]
        record.means[hits] = np.array(rows)
    return record.means[hits]


def values(design: Design, record: Record, hits: int | None = None) -> Array:
    """Objectives and bounds over the first hits, shape [asked]; NaN where no hit counts."""
    hits = record.hits if hits is None else hits
    if hits not in record.known:
        record.known[hits] = np.array([_mean(numbers_of(design, record, one, hits)) for one in design.asked])
    return record.known[hits]


def numbers_of(design: Design, record: Record, one: Objective | Bound, hits: int) -> Array:
    """Numbers of the hits whose mean is an objective or a bound, shape [hits]."""
    measure = one.asked
    if measure.kind == "target":
        return np.full(hits, record.areal_density)
    said = record.said[:, design.keys.index(measure.column), :hits]
    if not measure.is_binary:
        said = np.array([measure.averaged(measure.counted(of_one)) for of_one in said])
    if one.threats == "mean":
        weights = np.array([threat.weight for threat in design.threats])
        return np.asarray(weights @ said / weights.sum())
    of_threats = one.sign * np.array([_mean(of_one) for of_one in said])
    return np.asarray(said[int(np.argmax(np.nan_to_num(of_threats, nan=np.inf)))])


def estimate(design: Design, record: Record, one: Objective | Bound) -> Estimate:
    """An objective or a bound with its interval, by all hits."""
    numbers = numbers_of(design, record, one, record.hits)
    if one.asked.kind == "target":
        return Estimate(record.areal_density, record.areal_density, record.areal_density, record.hits, 0.0)
    return estimate_of("share" if one.asked.is_binary else "mean", numbers, replicates=SCRAMBLINGS)


def objectives(design: Design, record: Record, hits: int | None = None) -> Array:
    """What is to be minimised, shape [objectives]; infinite where no hit counts."""
    signs = np.array([one.sign for one in design.objectives])
    found = signs * values(design, record, hits)[: len(signs)]
    return np.asarray(np.nan_to_num(found, nan=np.inf, posinf=np.inf, neginf=-np.inf))


def excesses(design: Design, record: Record, hits: int | None = None) -> Array:
    """By how much each bound is violated, as a share of its limit; 0 where it is kept to rounding, shape [bounds]."""
    found = values(design, record, hits)[len(design.objectives) :]
    over = [
        bound.sign * (value - bound.limit) / (abs(bound.limit) or 1.0)
        for bound, value in zip(design.bounds, found, strict=True)
    ]
    shares = np.nan_to_num(np.array(over), nan=1.0)
    return np.where(shares > ROUNDED, shares, 0.0)


def undecided(design: Design, candidates: Sequence[Record], rivals: Sequence[Record], hits: int) -> list[bool]:
    """Whether each candidate may be on the front, by the first hits: it certainly breaks no bound, and no rival is
    certainly better; rounding decides nothing."""
    signs = np.array([one.sign for one in design.asked])[:, None]
    count = len(design.objectives)
    limits = np.array([one.sign * one.limit for one in design.bounds]).reshape(-1, 1)
    theirs = np.array([signs * means(design, one, hits) for one in rivals]).reshape(len(rivals), len(signs), -1)
    found = []
    for one in candidates:
        own = signs * means(design, one, hits)
        broken = (interval(own[count:] - limits)[0] > ROUNDED * np.abs(limits[:, 0])).any()
        others = theirs[[rival is not one for rival in rivals]]
        low = interval(own[None, :count] - others[:, :count])[0]
        rounded = ROUNDED * np.nan_to_num(np.abs(own[:count])).max(axis=1)
        worse = (low >= -rounded).all(axis=1) & (low > rounded).any(axis=1)
        found.append(not broken and not bool(worse.any()))
    return found


def interval(numbers: Array, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
    """Student's interval of means over the last axis; (−inf, inf) where fewer than two numbers count."""
    count = np.sum(~np.isnan(numbers), axis=-1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of no number
        mean, spread = np.nanmean(numbers, axis=-1), np.nanstd(numbers, axis=-1)
        by_count = {n: student_quantile(0.5 + 0.5 * confidence, int(n) - 1) for n in np.unique(count) if n > 1}
        factor = np.vectorize(lambda n: by_count.get(n, np.inf), otypes=[float])(count)
        half = np.where(count > 1, factor * spread / np.sqrt(np.maximum(count - 1, 1)), np.inf)
    mean = np.nan_to_num(mean)
    return mean - half, mean + half


def _mean(numbers: Array) -> float:
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def _by_scrambling(numbers: Array) -> Array:
    """Means of the hits of every scrambling, NaN of one without any, shape [SCRAMBLINGS]."""
    short = -len(numbers) % SCRAMBLINGS
    dealt = np.concatenate([numbers, np.full(short, np.nan)]).reshape(-1, SCRAMBLINGS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmean(dealt, axis=0))
