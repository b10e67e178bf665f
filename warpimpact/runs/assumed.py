"""Some hits of a campaign with what nobody measured chosen otherwise: how far every number of a result may be off.

The hits are those of a pilot, at the resolution of the run, so that what they have in common drops out of the
difference to the hits as given.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.alternatives import Alternative, alternatives
from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import assumed_columns, assumed_table
from warpimpact.results.table import HitTable
from warpimpact.runs.describe import is_double
from warpimpact.runs.pilot_hits import places_of, shots_at
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.prepare import prepare

SHARE = 1.0 / 128.0
"""Hits of an alternative over those of a run: some twelve alternatives cost a run a tenth, those whose plates have
finer grids included about 15 %."""
FEWEST, MOST = 64, 256
"""Hits of an alternative unless the campaign tells how many."""
FEWEST_LIMITS = 8
"""The same of limits at least, each of which takes several runs."""
SECONDS = 2.0
"""Of a core, for passages that nothing hinders, that all alternatives may take where that is more than their share of
the run: of what takes long fewer hits are taken, but FEWEST_GROUPS. Cores that slide and stop take several times as
long."""
FEWEST_GROUPS = 8
"""Hits or bursts of an alternative that are no images of each other, at least."""

Computed = Callable[[list[tuple[Scene, Shots]]], list[Outcomes]]


def has_assumptions(campaign: Campaign) -> bool:
    """Whether alternatives of a campaign are computed: unless it tells, where a pilot finds the resolution."""
    asked = campaign.assumptions.compute
    return campaign.numerics.explicit is None if asked is None else asked


def assumed(campaign: Campaign, numerics: Numerics, compute: Computed, *, limits: bool = False) -> HitTable:
    """Hits under assumptions, with their attributes; empty of a campaign that has no alternative.

    Args:
        numerics: of the run, which fix a resolution.
        compute: the outcomes of the shots of scenes.
        limits: whether it computes limits: few, which depend on no stand-off, and not which cores would break.
    """
    begin = time.perf_counter()
    images, group = len(campaign.symmetries), len(campaign.symmetries) * campaign.at_a_plate
    others = [alternative for alternative in alternatives(campaign) if not limits or alternative.moves_limits]
    places = places_of(campaign, _groups(campaign, numerics, len(others), FEWEST_LIMITS if limits else FEWEST))
    shots = shots_at(campaign, places)
    possible = [alternative for alternative in others if alternative.is_possible(shots)]
    if not possible:
        return HitTable.of({}, {}, {})
    # What turns a shot leaves no image of it.
    scenes = [
        (alternative.scene, alternative.shots(shots if alternative.turned else shots[::images]))
        for alternative in possible
    ]
    outcomes = [
        found if alternative.turned else found.unfolded(campaign.symmetries)
        for alternative, found in zip(possible, compute(scenes), strict=True)
    ]
    numbers = (places[:, None] * group + np.arange(group)).reshape(-1)
    columns = _columns(possible, outcomes, numbers)
    attributes = _attributes(possible, outcomes) | {attr.ASSUMED_TIME: time.perf_counter() - begin}
    return assumed_table(columns, attributes, double=is_double(campaign))


def _groups(campaign: Campaign, numerics: Numerics, others: int, fewest: int) -> int:
    """How many hits or bursts that are no images of each other each alternative has. The speed of the machine does not
    count."""
    group, total = len(campaign.symmetries) * campaign.at_a_plate, len(campaign.sampler())
    hits = campaign.assumptions.hits
    if hits is None:
        first = shots_at(campaign, places_of(campaign, 1))
        in_time = int(SECONDS / (max(others, 1) * prepare(campaign.scene, first, numerics).seconds))
        hits = min(max(min(fewest, in_time), int(SHARE * total)), MOST)
    return min(max(FEWEST_GROUPS, hits // group), total // group)


def _columns(possible: list[Alternative], outcomes: list[Outcomes], numbers: NDArray[np.int64]) -> dict[str, Any]:
    moving = [outcome for alternative, outcome in zip(possible, outcomes, strict=True) if not alternative.breaks]
    if not moving:
        return {}
    which = np.repeat(np.arange(len(moving)), len(numbers))
    return assumed_columns(Outcomes.joined(moving), np.tile(numbers, len(moving)), which)


def _attributes(possible: list[Alternative], outcomes: list[Outcomes]) -> dict[str, Any]:
    """Numbers of the alternatives by name, and the share of cores that would break by their strength."""
    names = [alternative.name for alternative in possible if not alternative.breaks]
    broken = {
        alternative.name: float(np.mean(outcome.broken))
        for alternative, outcome in zip(possible, outcomes, strict=True)
        if alternative.breaks
    }
    told = {attr.ASSUMPTIONS: {name: number for number, name in enumerate(names)}, attr.WOULD_BREAK: broken}
    return {name: json.dumps(value, ensure_ascii=False) for name, value in told.items() if value}
