"""What the hits of a campaign will cost, before they are computed: told where it is far more than usual."""

from __future__ import annotations

import warnings

from warpimpact.campaign.campaign import Campaign
from warpimpact.scene import Numerics
from warpimpact.solver.prepare import prepare

SLOW = 1.0
"""Seconds of a core that a hit takes, from which on that is told."""


class Costly(UserWarning):
    """A computation that takes far longer than usual."""


class Cost:
    """Warns (`Costly`) of hits that take more than SLOW on a CPU, once at each resolution.

    Args:
        device: kind of it.
    """

    def __init__(self, campaign: Campaign, device: str) -> None:
        self._campaign, self._told, self._by_cpu = campaign, list[Numerics](), device == "cpu"

    def tell(self, numerics: Numerics) -> None:
        """Warn of what hits take with numerics that fix the resolution: the first hit of the campaign, if nothing
        hinders it, stands for all.

        Raises:
            TooManySteps, MemoryError: as in `prepare`.
        """
        if not self._by_cpu or numerics in self._told:
            return
        self._told.append(numerics)
        sentence = cost_of(self._campaign, numerics)
        if sentence is not None:
            warnings.warn(sentence, Costly, stacklevel=2)


def cost_of(campaign: Campaign, numerics: Numerics) -> str | None:
    """A sentence about what hits take; None where that is little."""
    sampler, images = campaign.sampler(), len(campaign.symmetries)
    shots = sampler.shots(0, images * campaign.at_a_plate)[::images]
    prepared = prepare(campaign.scene, shots, numerics)
    seconds, hits = prepared.seconds, len(sampler) // images
    if seconds < SLOW:
        return None
    level = "" if numerics.level is None else f"at level {numerics.level} "
    return (
        f"{level}a hit takes about {seconds:.2g} s of a core, and {hits} hits {_long(seconds * hits)}: at "
        f"least {prepared.steps} steps, and windows of {prepared.window_nodes:.2g} nodes, "
        f"{prepared.window_bytes / 2**30:.2g} GiB; a lower level, and a longer degradation_length or "
        "degradation_depth, take less"
    )


def _long(seconds: float) -> str:
    """A time that a person grasps."""
    return f"{seconds:.2g} s" if seconds < 120.0 else f"{seconds / 3600.0:.2g} h"
