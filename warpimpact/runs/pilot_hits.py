"""The hits that stand for all hits of a campaign in a pilot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.scene import Shots
from warpimpact.solver.simulate import spread_places


def pilot_shots(campaign: Campaign, most: int) -> tuple[Shots, NDArray[np.int64]]:
    """Some hits of a campaign, and their numbers."""
    places = places_of(campaign, most)
    return shots_at(campaign, places), places


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
