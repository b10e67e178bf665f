"""What hits by finite elements would take, or need."""

from __future__ import annotations

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import continuum_table, layer_materials, with_layers
from warpimpact.errors import TooLong
from warpimpact.runs.compute import shots_of
from warpimpact.scene.target import layer_name
from warpimpact.scene.units import duration_text

USUAL_HITS = 12
"""Hits by finite elements that correct a map, where nothing says how many."""


def correction_offer(campaign: Campaign, continuum_hits: int = USUAL_HITS) -> str:
    """A sentence on what a correction by so many hits takes, or needs."""
    try:
        method = continuum_table(campaign).method
    except ValueError:
        return f"{_remedy(campaign)} to correct this map by finite elements."
    shots = shots_of(campaign, np.linspace(0, len(campaign.sampler()) - 1, 8, dtype=np.int64))
    cost = method.estimate_cost(campaign.scene, shots)
    try:
        cost.check(threads=1)
    except (TooLong, MemoryError) as error:
        return f"No correction by finite elements: {error}."
    duration = duration_text(continuum_hits * cost.seconds)
    return f"--elements {continuum_hits} corrects the map, in about {duration} of one CPU core."


def _remedy(campaign: Campaign) -> str:
    """What to do to a campaign that finite elements refuse."""
    if campaign.continuum.materials:  # not as many as layers, or layers without room behind them
        return "Change the table [continuum]"
    names = layer_materials(campaign, with_layers(campaign).layers)
    if None in names:
        return f"Name {layer_name(names.index(None))}.material"
    return "Give continuum.materials with constants of your own"
