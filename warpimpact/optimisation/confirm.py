"""Confirmation of the front with fresh hits: a search selects lucky hits, so its own numbers are biased."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import HitJob, Told, campaign_of, hits_asked, levels_asked
from warpimpact.optimisation.judged import (
    DesignRecord,
    excesses,
    interval,
    means,
    objectives,
    weights_of,
)
from warpimpact.optimisation.search import Searched
from warpimpact.optimisation.searcher import front_of
from warpimpact.runs.questions import Question
from warpimpact.scene.model import Array
from warpimpact.statistics.comparisons import ROUNDED

Part = TypeVar("Part")

CONFIRM_FIDELITY = "standard"
"""Fidelity of the pilots of the designs of the front, unless the campaign fixes a resolution."""
SOLID_HITS = 64
"""Number of hits of a solid plate, which differ in scattered quantities only."""
SAME_WEIGHT = 0.01
"""Relative difference below which two areal densities are the same weight."""


@dataclass(frozen=True)
class Confirmed:
    """The front by fresh hits.

    Attributes:
        numbers: numbers of its designs in the search.
        records: its designs with fresh hits.
        places: y and z of the hits of each design [m], shape [front, 2, hits].
        solids: solid plates of equal areal density.
        kept: whether each design is still on the front and within the bounds by fresh hits.
        groups: for each design, the number of the first design than which it is not certainly better.
        references: targets to compare with.
    """

    numbers: NDArray[np.int64]
    records: tuple[DesignRecord, ...]
    places: Array
    solids: tuple[DesignRecord, ...]
    kept: NDArray[np.bool_]
    groups: NDArray[np.int64]
    references: tuple[DesignRecord, ...]


Follow = Callable[[int, int, str], object]
"""Called with the number of targets done, the number of all targets, and what is computed of them."""


def confirm(design: Design, searched: Searched, follow: Follow) -> Question[Confirmed]:
    """Compute the front, its solid plates and the references with fresh hits at the standard fidelity."""
    numbers = spread(searched.front, design.search.confirmed)
    chosen = [searched.records[int(number)] for number in numbers]
    others = [_reference(design, place) for place in range(len(design.references))]
    records, places = yield from _fresh(design, [*chosen, *others], follow)
    front = records[: len(chosen)]
    solids = yield from _solids(design, front, follow)
    return Confirmed(
        numbers=numbers,
        records=tuple(front),
        places=places[: len(chosen)],
        solids=tuple(solids),
        kept=_kept(design, front),
        groups=groups(design, front),
        references=tuple(records[len(chosen) :]),
    )


def spread(front: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most `most` designs at even distances along a front, including both ends."""
    if len(front) <= most:
        return front
    places = np.unique(np.round(np.linspace(0, len(front) - 1, most)).astype(np.int64))
    return np.asarray(front[places])


def fresh_seed(design: Design) -> int:
    """Seed of hits that the search has not computed."""
    return int(np.random.SeedSequence(design.search.seed, spawn_key=(24,)).generate_state(1)[0] >> 1)


def _reference(design: Design, place: int) -> DesignRecord:
    """The record of a reference target, without hits."""
    given = design.references[place]
    tables: dict[str, Any] = dict(design.base) | {"plate": dict(given.plate)}
    if given.layer is not None:
        tables["layer"] = [dict(layer) for layer in given.layer]
    try:
        campaign = campaign_of(design, tables, design.threats[0])
    except CampaignError as error:
        text = str(error).removeprefix(f"{design.name}: ")
        raise CampaignError(f'{design.name}: references[{place}] "{given.name}": {text}') from None
    return DesignRecord(np.zeros(0), tables, weights_of(campaign.target), (), np.zeros((0, 0, 0)))


def check_references(design: Design) -> None:
    """Refuse a reference that is no campaign before anything is computed.

    Raises:
        CampaignError: the message names the reference.
    """
    for place in range(len(design.references)):
        _reference(design, place)


def _telling(follow: Follow, targets: int, jobs: int, what: str) -> Told:
    """Return a function that converts finished jobs to finished targets for `follow`. All targets have as many jobs."""
    return lambda done, _: follow(int(targets * done / jobs), targets, what)


def _batched(parts: Sequence[Part], count: int) -> list[tuple[Part, ...]]:
    return [tuple(parts[first : first + count]) for first in range(0, len(parts), count)]


def _fresh(
    design: Design, targets: Sequence[DesignRecord], follow: Follow
) -> Question[tuple[list[DesignRecord], Array]]:
    """Targets with fresh hits, and the places of the hits."""
    seed, count = fresh_seed(design), design.search.confirm_hits if design.keys else 1
    threats = range(len(design.threats))
    asked = [
        HitJob(target.tables, threat, 0, count, CONFIRM_FIDELITY, seed) for target in targets for threat in threats
    ]
    if not design.keys:
        empty = np.zeros((len(threats), 0, count))
        without_hits = [replace(target, levels=("",) * len(threats), said=empty) for target in targets]
        return without_hits, np.zeros((len(targets), 2, 0))
    whose = "the front and references" if design.references else "the front"
    piloting = _telling(follow, len(targets), len(asked), f"pilots for fresh hits of {whose}")
    levels = yield from levels_asked(design, asked, piloting)
    of_targets = _batched(levels, len(threats))
    jobs = [
        HitJob(target.tables, threat, 0, count, of_target[threat], seed)
        for target, of_target in zip(targets, of_targets, strict=True)
        for threat in threats
    ]
    said = yield from hits_asked(design, jobs, _telling(follow, len(targets), len(jobs), f"fresh hits of {whose}"))
    records = [
        replace(target, levels=levels_of_target, said=np.array([part.values for part in parts]))
        for target, levels_of_target, parts in zip(targets, of_targets, _batched(said, len(threats)), strict=True)
    ]
    of_first = said[:: len(threats)]
    return records, np.array([first.places for first in of_first])


def _solids(design: Design, front: Sequence[DesignRecord], follow: Follow) -> Question[list[DesignRecord]]:
    """The solid plate with the areal density of each design of the front."""
    if not design.keys or not front:
        return list(front)
    jobs = [
        HitJob(record.tables, threat, 0, SOLID_HITS, level, fresh_seed(design), solid=True)
        for record in front
        for threat, level in enumerate(record.levels)
    ]
    telling = _telling(follow, len(front), len(jobs), "solid plates of the same weight")
    said = yield from hits_asked(design, jobs, telling)
    parts = _batched(said, len(design.threats))
    return [
        replace(record, said=np.array([part.values for part in of_record]))
        for record, of_record in zip(front, parts, strict=True)
    ]


def _kept(design: Design, front: Sequence[DesignRecord]) -> NDArray[np.bool_]:
    """Whether each design is within the bounds, and not dominated by another design within the bounds."""
    kept = np.array([not excesses(design, record).any() for record in front], dtype=bool)
    within = np.flatnonzero(kept)
    points = np.array([objectives(design, front[int(number)]) for number in within])
    kept[:] = False
    kept[within[front_of(points)]] = True
    return kept


def groups(design: Design, front: Sequence[DesignRecord]) -> NDArray[np.int64]:
    """For each design, the number of the first design of the front than which it is not certainly better."""
    leaders_of = np.arange(len(front))
    for number, record in enumerate(front):
        leaders = [lead for lead in range(number) if leaders_of[lead] == lead]
        leaders_of[number] = next((lead for lead in leaders if not is_better(design, record, front[lead])), number)
    return leaders_of


def is_better(design: Design, record: DesignRecord, other: DesignRecord) -> bool:
    """Whether one design is better than another in some objective at 95 %, by the same hits of both."""
    count = len(design.objectives)
    signs = np.array([asked.sign for asked in design.objectives])[:, None]
    theirs = means(design, other, other.hits)[:count]
    low = interval(signs * (theirs - means(design, record, record.hits)[:count]))[0]
    same = [SAME_WEIGHT if asked.asked.kind == "target" else ROUNDED for asked in design.objectives]
    return bool((low > np.array(same) * np.nan_to_num(np.abs(theirs)).max(axis=1)).any())
