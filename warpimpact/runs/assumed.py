"""Some hits of a campaign computed under other assumptions about what nobody measured. They show how much every number
of a result may be wrong.

The hits are those of a pilot, at the resolution of the run, so that common errors cancel in the difference to the hits
as given.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from warpimpact.campaign.alternatives import alternatives
from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import assumed_table, columns_beside
from warpimpact.results.table import HitTable
from warpimpact.runs.describe import is_double
from warpimpact.runs.pilot_hits import hits_at, places_of, shots_at
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.prepare import prepare

SHARE_OF_RUN = 1.0 / 128.0
"""Hits per alternative over the hits of a run. Some twelve alternatives then cost a tenth of a run, or about 15 % with
alternatives whose plates have finer grids; a table of each plate with holes comes on top."""
FEWEST, MOST = 64, 256
"""Fewest and most hits per alternative, unless the campaign gives their number."""
FEWEST_LIMITS = 8
"""Fewest hits per alternative in a computation of limits, where each hit takes several runs."""
ASSUMED_SECONDS = 2.0
"""Seconds of a core for unhindered passages that all alternatives together may take where their share of the run takes
longer. Fewer hits are computed then, but at least FEWEST_GROUPS. Cores that slide and stop take several times as
long."""
FEWEST_GROUPS = 8
"""Fewest hits or bursts per alternative, images not counted."""

Computed = Callable[[list[tuple[Scene, Shots]]], list[Outcomes]]


def has_assumptions(campaign: Campaign) -> bool:
    """Whether alternatives of a campaign are computed. By default they are where a pilot finds the resolution."""
    asked = campaign.assumptions.compute
    return campaign.numerics.explicit is None if asked is None else asked


def assumed(campaign: Campaign, numerics: Numerics, compute: Computed, *, limits: bool = False) -> HitTable:
    """Hits under assumptions, with the number of each alternative by name, and the share of the cores that would break
    by their strength; an empty table for a campaign without alternatives.

    Args:
        numerics: numerics of the run, which fix a resolution.
        compute: returns the outcomes of scenes with their shots.
        limits: whether `compute` returns limits. Then there are few hits, and alternatives of the stand-offs and of the
            cores' strength are left out.
    """
    begin = time.perf_counter()
    others = [alternative for alternative in alternatives(campaign) if not limits or alternative.moves_limits]
    places = places_of(campaign, _groups(campaign, numerics, len(others), FEWEST_LIMITS if limits else FEWEST))
    shots = shots_at(campaign, places)
    possible = [alternative for alternative in others if alternative.is_possible(shots)]
    if not possible:
        return HitTable.of({}, {}, {})
    # An alternative that turns shots differently breaks the symmetry, so all images are computed.
    scenes = [
        (alternative.scene, alternative.shots(shots if alternative.turned else shots[:: len(campaign.symmetries)]))
        for alternative in possible
    ]
    outcomes = [
        outcomes_of_one if alternative.turned else outcomes_of_one.unfolded(campaign.symmetries)
        for alternative, outcomes_of_one in zip(possible, compute(scenes), strict=True)
    ]
    moving, broken = dict[str, Outcomes](), dict[str, float]()
    for alternative, outcome in zip(possible, outcomes, strict=True):
        if alternative.breaks:
            broken[alternative.name] = float(np.mean(outcome.broken))
        else:
            moving[alternative.name] = outcome
    numbers, columns = hits_at(campaign, places), dict[str, Any]()
    if moving:
        which = np.repeat(np.arange(len(moving)), len(numbers))
        columns = {v.ASSUMED_HIT: np.tile(numbers, len(moving)).astype(np.int32), v.ASSUMPTION: which.astype(np.int8)}
        columns |= columns_beside(Outcomes.joined([*moving.values()]), v.ASSUMED_VARIABLES)
    told = {attr.ASSUMPTIONS: {name: number for number, name in enumerate(moving)}, attr.WOULD_BREAK: broken}
    attributes: dict[str, Any] = {name: json.dumps(value, ensure_ascii=False) for name, value in told.items() if value}
    attributes[attr.ASSUMED_TIME] = time.perf_counter() - begin
    return assumed_table(columns, attributes, double=is_double(campaign))


def _groups(campaign: Campaign, numerics: Numerics, others: int, fewest: int) -> int:
    """Number of groups of images, or of bursts with their images, per alternative. It does not depend on the
    machine."""
    group, total = campaign.group, len(campaign.sampler())
    hits = campaign.assumptions.hits
    if hits is None:
        first = shots_at(campaign, places_of(campaign, 1))
        in_time = int(ASSUMED_SECONDS / (max(others, 1) * prepare(campaign.scene, first, numerics).seconds))
        hits = min(max(min(fewest, in_time), int(SHARE_OF_RUN * total)), MOST)
    return min(max(FEWEST_GROUPS, hits // group), total // group)
