"""The search: few hits of each point that the optimiser asks for, and more where the paired difference does not
decide."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import HitJob, hits_asked, levels_asked
from warpimpact.optimisation.feasible import Checked, checked
from warpimpact.optimisation.judged import DesignRecord, excesses, objectives, undecided, weights_of
from warpimpact.optimisation.searcher import Searcher, front_of, hypervolume
from warpimpact.runs.questions import Question
from warpimpact.scene.model import Array

IDLE = 25
"""Generations without a new feasible design after which a search ends."""
SEARCH_FIDELITY = "draft"
"""Fidelity of the pilots of a search, unless the campaign fixes a resolution."""
MARGIN = 0.1
"""Distance of the hypervolume's reference beyond the box of the first generation, as a share of the box."""
NEIGHBOURHOOD = 0.5
"""Distance, as a share of every range, within which designs of the same alternatives share a pilot."""


@dataclass(frozen=True)
class SearchProgress:
    """The progress of a search.

    Attributes:
        done, total: numbers of designs, first of the search, then of those with fresh hits.
        certain: whether `total` will be reached; else it is an upper bound.
        resumed: designs among `done` that an earlier call had computed.
        front: designs on the front.
        hypervolume: volume of the front up to the reference (`MARGIN`), in boxes of the first generation; or NaN.
        what: words for what is being computed.
    """

    done: int
    total: int
    certain: bool
    resumed: int
    front: int
    hypervolume: float
    what: str


Follow = Callable[[SearchProgress], None]


@dataclass(frozen=True)
class Searched:
    """A search that has ended.

    Attributes:
        records: all computed designs, in the order of computing.
        front: numbers of the designs on the front, sorted by the first objective.
        refused: number of designs that broke a constraint and were not computed.
        history: computed designs and hypervolume after every generation, shape [generations, 2].
        reference, scale: worst values of the objectives to minimise in the first generation, and their distance from
            the best, shape [objectives]; empty where no design keeps the bounds.
        pilots: number of pilots.
    """

    records: tuple[DesignRecord, ...]
    front: NDArray[np.int64]
    refused: int
    history: Array
    reference: Array
    scale: Array
    pilots: int


def search(design: Design, follow: Follow = lambda now: None) -> Question[Searched]:
    """Search until the budget of designs is computed, or there are no others.

    Raises:
        CampaignError: no design keeps the constraints; the message names the constraint that rules them out.
    """
    state = _State(design, follow)
    if design.space.size <= design.search.designs:
        every = state.feasible(design.space.points())
        state.total, state.certain = len(every), True
        for first in range(0, len(every), design.search.population):
            yield from state.generation(every[first : first + design.search.population])
    else:
        plan = design.search
        searcher = Searcher(design.space, len(design.objectives), 1 + len(design.bounds), plan.population, plan.seed)
        while asked := searcher.ask():
            points = [design.space.at(coordinates) for coordinates in asked]
            yield from state.generation(points)
            if state.done >= plan.designs or state.idle >= IDLE:
                break
            searcher.tell(*state.told(points))
    if not state.records:
        raise CampaignError(f"{design.name}: {state.why_none()}")
    state.total, state.certain = state.done, True
    state.tell("")
    return state.searched()


@dataclass
class _State:
    """The state of a search.

    Attributes:
        records: computed designs; front: numbers of those on the front.
        drafts: feasible designs that are not computed yet.
        refused: designs that break a constraint.
        total, certain, resumed: as in `SearchProgress`.
        is_resumed: whether all rounds of this generation so far come from the disk.
    """

    design: Design
    follow: Follow
    records: dict[bytes, DesignRecord] = field(default_factory=dict)
    front: list[DesignRecord] = field(default_factory=list)
    drafts: dict[bytes, DesignRecord] = field(default_factory=dict)
    refused: dict[bytes, Checked] = field(default_factory=dict)
    pilots: list[tuple[Array, int, str]] = field(default_factory=list)
    history: list[tuple[int, float]] = field(default_factory=list)
    box: tuple[Array, Array] | None = None
    idle: int = 0
    certain: bool = False
    resumed: int = 0
    is_resumed: bool = False

    def __post_init__(self) -> None:
        self.total = int(min(self.design.search.designs, self.design.space.size))

    @property
    def done(self) -> int:
        return len(self.records)

    def generation(self, points: Sequence[Array]) -> Question[None]:
        """Compute the new feasible points among these."""
        new: dict[bytes, DesignRecord] = {}
        for values in points:
            key = values.tobytes()
            if key in self.records or key in new:
                continue
            if self.done + len(new) == self.design.search.designs:
                break
            if self.feasible([values]):
                new[key] = self.drafts.pop(key)
        self.idle = 0 if new else self.idle + 1
        if new:
            self.is_resumed = bool(self.design.keys)
            yield from self._compute(new)
            self.resumed += len(new) if self.is_resumed else 0
            self._measure()

    def feasible(self, points: Iterable[Array]) -> list[Array]:
        """The points that keep the constraints."""
        keeping = []
        for values in points:
            key = values.tobytes()
            if key not in self.drafts and key not in self.refused:
                self._check(key, values)
            if key in self.drafts:
                keeping.append(values)
        return keeping

    def _check(self, key: bytes, values: Array) -> None:
        tables = self.design.tables(values)
        checked_design = checked(self.design, tables)
        if checked_design.violations or checked_design.campaign is None:
            self.refused[key] = checked_design
            return
        nothing = np.zeros((len(self.design.threats), len(self.design.keys), 0))
        self.drafts[key] = DesignRecord(values, tables, weights_of(checked_design.campaign.target), (), nothing)

    def _compute(self, new: dict[bytes, DesignRecord]) -> Question[None]:
        """Compute hits of designs. Designs that may be on the front get the hits of the next rung."""
        levels = yield from self._levels(list(new.values()))
        for key, of_threats in zip(list(new), levels, strict=True):
            new[key] = replace(new[key], levels=of_threats)
        going, before = list(new), 0
        for hits in self.design.search.rungs if self.design.keys else [self.design.search.hits]:
            with_more = yield from self._more([new[key] for key in going], before, hits)
            new |= zip(going, with_more, strict=True)
            best = [record for record in self.front if record.hits >= hits]
            candidates = [new[key] for key in going]
            keep = undecided(self.design, candidates, [*best, *candidates], hits)
            going, before = [key for key, kept in zip(going, keep, strict=True) if kept], hits
            if not going:
                break
        self._admit(list(new.values()))
        self.records |= new

    def _more(self, records: Sequence[DesignRecord], first: int, stop: int) -> Question[list[DesignRecord]]:
        """The designs with the hits from `first` up to `stop` added."""
        design = self.design
        if not design.keys:
            return [record.more(np.zeros((len(design.threats), 0, stop)), 0.0) for record in records]
        jobs = [
            HitJob(record.tables, threat, first, stop - first, record.levels[threat], design.search.seed)
            for record in records
            for threat in range(len(design.threats))
        ]
        what, each = f"{len(records)} designs at {stop} hits", len(design.threats)

        def tell(done: float, is_resumed: bool) -> None:
            if done >= len(jobs):
                self.is_resumed = self.is_resumed and is_resumed
            self.tell(f"{what}, {done / len(jobs):.0%}")

        said = yield from hits_asked(design, jobs, tell)
        extended = []
        for number, record in enumerate(records):
            hits = said[number * each : (number + 1) * each]
            extended.append(record.more(np.array([part.values for part in hits]), sum(part.seconds for part in hits)))
        return extended

    def _levels(self, records: Sequence[DesignRecord]) -> Question[list[tuple[str, ...]]]:
        """Numerics of designs for every threat, from the pilot of a neighbour or one of their own."""
        places = [self._place(record.values) for record in records]
        if not self.design.keys:
            return [("",) * len(self.design.threats) for _ in records]
        centres: list[tuple[Array, int]] = [(place, threat) for place, threat, _ in self.pilots]
        jobs, count = [], self.design.search.most_hits
        for record, place in zip(records, places, strict=True):
            for threat in range(len(self.design.threats)):
                if not any(of == threat and _apart(place, centre) <= NEIGHBOURHOOD for centre, of in centres):
                    centres.append((place, threat))
                    jobs.append(HitJob(record.tables, threat, 0, count, SEARCH_FIDELITY, self.design.search.seed))
        tell = lambda done, _: self.tell(f"{done:.0f} of {len(jobs)} pilots")  # noqa: E731
        levels = yield from levels_asked(self.design, jobs, tell)
        self.pilots += [(*centre, level) for centre, level in zip(centres[len(self.pilots) :], levels, strict=True)]
        return [tuple(self._nearest(place, threat) for threat in range(len(self.design.threats))) for place in places]

    def _nearest(self, place: Array, threat: int) -> str:
        near = [(_apart(place, centre), level) for centre, of, level in self.pilots if of == threat]
        return min(near, key=lambda pair: pair[0])[1]

    def _place(self, values: Array) -> Array:
        """Coordinates as shares of the ranges. Different choices lie far apart, as do points only one of which uses a
        variable."""
        shares = [
            1e6 * value if variable.labels else (value - variable.low) / ((variable.high - variable.low) or 1.0)
            for variable, value in zip(self.design.space.variables, values, strict=True)
        ]
        return np.asarray(np.nan_to_num(np.array(shares), nan=-1e6))

    def _admit(self, new: Sequence[DesignRecord]) -> None:
        """Add to the front the designs that keep the bounds, have all their hits, and are not dominated."""
        most = self.design.search.most_hits if self.design.keys else self.design.search.hits
        full = [record for record in new if record.hits >= most and not excesses(self.design, record).any()]
        may = [*self.front, *(record for record in full if np.isfinite(objectives(self.design, record)).all())]
        shape = len(may), len(self.design.objectives)
        points = np.array([objectives(self.design, record) for record in may]).reshape(shape)
        self.front = [may[number] for number in front_of(points)]

    def _measure(self) -> None:
        """Record the hypervolume, in the box of the first generation in which some design keeps the bounds."""
        if self.box is None:
            kept = [record for record in self.records.values() if not excesses(self.design, record).any()]
            every = [objectives(self.design, record) for record in kept]
            if finite := [signed for signed in every if np.isfinite(signed).all()]:
                low, high = np.min(finite, axis=0), np.max(finite, axis=0)
                self.box = high, np.where(high > low, high - low, np.maximum(np.abs(high), 1.0))
        self.history.append((self.done, self._volume()))
        self.tell("")

    def _volume(self) -> float:
        if self.box is None or not self.front:
            return 0.0
        reference, scale = self.box
        points = np.array([objectives(self.design, record) for record in self.front])
        return hypervolume((points - reference) / scale, np.full(len(scale), MARGIN))

    def told(self, points: Sequence[Array]) -> tuple[Array, Array]:
        """Objectives and violations of the points of a generation."""
        count, rows = len(self.design.objectives), []
        for values in points:
            key = values.tobytes()
            if (record := self.records.get(key)) is not None:
                rows.append(
                    [*np.nan_to_num(objectives(self.design, record), posinf=1e30), 0.0, *excesses(self.design, record)]
                )
            else:
                broken = self.refused[key].excess
                rows.append([*([0.0] * count), broken, *([0.0] * len(self.design.bounds))])
        told = np.array(rows)
        return told[:, :count], told[:, count:]

    def tell(self, what: str) -> None:
        """Report the progress of the search, and what is being computed."""
        volume = self.history[-1][1] if self.history else math.nan
        told = (self.done, self.total, self.certain, self.resumed, len(self.front), volume)
        self.follow(SearchProgress(*told, what))

    def why_none(self) -> str:
        """A sentence about the constraint that rules out all designs tried."""
        tried = list(self.refused.values())
        broken: dict[str, list[float]] = {}
        for attempt in tried:
            for violation in attempt.violations:
                broken.setdefault(violation.constraint, []).append(violation.share)
        by_all = [name for name, shares in broken.items() if len(shares) == len(tried)]
        name = by_all[0] if by_all else max(broken, key=lambda key: len(broken[key]))
        nearest = min(
            (violation for attempt in tried for violation in attempt.violations if violation.constraint == name),
            key=lambda violation: violation.share,
        )
        others = ", ".join(sorted({*broken} - {name}))
        alone = "" if by_all or not others else f", which {len(broken[name])} of them break, beside {others}"
        return f"constraints: none of {len(tried)} designs keeps {name}{alone}; the nearest has {nearest.text}"

    def searched(self) -> Searched:
        records = list(self.records.values())
        on_front = {id(record) for record in self.front}
        front = [number for number, record in enumerate(records) if id(record) in on_front]
        front.sort(key=lambda number: tuple(objectives(self.design, records[number])))
        reference, scale = self.box or (np.zeros(0), np.zeros(0))
        return Searched(
            records=tuple(records),
            front=np.array(front, dtype=np.int64),
            refused=len(self.refused),
            history=np.array(self.history, dtype=float).reshape(-1, 2),
            reference=reference,
            scale=scale,
            pilots=len(self.pilots),
        )


def _apart(place: Array, other: Array) -> float:
    return float(np.abs(place - other).max(initial=0.0))
