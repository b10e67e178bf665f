"""The hits that stand for all hits of a campaign in a pilot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.runs.levels import MEASURES, level_for
from warpimpact.scene import Shots
from warpimpact.solver.pilot import pilot_size
from warpimpact.solver.simulate import spread_places

_MOST_OF_LAYERS = 1024
"""Most shots of a pilot at several layers."""


def pilot_shots(campaign: Campaign, most: int) -> tuple[Shots, NDArray[np.int64]]:
    """Some hits of a campaign, and their numbers."""
    places = places_of(campaign, most)
    return shots_at(campaign, places), places


def pilot_most(campaign: Campaign) -> int:
    """Most shots of a campaign's pilot. At several layers, where the level is chosen for measures, it may be all shots
    of a short run, because a few shots say little of the share that ends otherwise."""
    hits, usual = len(campaign.sampler()), campaign.numerics.asked
    fewest = pilot_size(usual, hits)
    return max(fewest, min(hits, _MOST_OF_LAYERS)) if level_for(campaign) == MEASURES else fewest


def places_of(campaign: Campaign, most: int) -> NDArray[np.int64]:
    """Numbers of at most so many hits that stand for all of them.

    They depend on the campaign alone: the first ones of a Sobol or random sampling, or ones at even distances of a grid
    or list.
    """
    hits = len(campaign.sampler())
    count = min(most, hits)
    return np.arange(count) if campaign.hits.sampling in ("sobol", "random") else spread_places(hits, count)


def shots_at(campaign: Campaign, places: NDArray[np.int64]) -> Shots:
    """The shots of these numbers."""
    sampler = campaign.sampler()
    if campaign.hits.sampling in ("sobol", "random"):
        return sampler.shots(0, len(places))
    return Shots.joined([sampler.shots(int(place), 1) for place in places])
