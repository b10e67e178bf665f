"""Cost of a campaign's hits, announced before the run if it is unusual."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache

from warpimpact.campaign.campaign import Campaign
from warpimpact.scene import Numerics
from warpimpact.solver.prepare import prepare

SLOW, SLOW_BEFORE = 1.0, 5.0
"""Seconds of a core above which the cost is announced: of a hit, and of what comes before the first hit."""
LARGE = 2**30
"""Bytes of the windows of a hit above which they are announced. Each thread has its own."""


class Costly(UserWarning):
    """A computation that takes far longer than usual."""


def cost_warning(campaign: Campaign, device: str, passages: int = 1) -> Callable[[Numerics], None]:
    """Return a function that warns (`Costly`), once for each numerics, of hits that are slow on a CPU. It raises what
    `prepare` does: TooManySteps, MemoryError."""

    @cache
    def warn(numerics: Numerics) -> None:
        if device == "cpu" and (sentence := estimate_cost(campaign, numerics, passages)) is not None:
            warnings.warn(sentence, Costly, stacklevel=2)

    return warn


def estimate_cost(campaign: Campaign, numerics: Numerics, passages: int = 1) -> str | None:
    """A sentence about the cost of hits on a CPU, with numerics that fix the resolution; None where it is low. An
    unhindered first hit of the campaign stands for all."""
    sampler = campaign.sampler()
    prepared = prepare(campaign.scene, sampler.shots(0, 1), numerics)
    seconds, hits = passages * prepared.seconds, len(sampler)
    level = "" if numerics.level is None else f"at level {numerics.level} "
    if seconds < SLOW and prepared.window_bytes < LARGE:
        before, size = (sum(getattr(tile, name) for tile in prepared.tiles) for name in ("seconds", "bytes"))
        return (
            f"{level}the holes of the plates take about {before:.2g} s of a core and {size / 2**30:.2g} GiB before the "
            "first hit; a smaller period of the pattern, and a longer degradation_length, take less"
            if before >= SLOW_BEFORE
            else None
        )
    total = seconds * hits
    time = f"{total:.2g} s" if total < 120.0 else f"{total / 3600.0:.2g} h"
    return (
        f"{level}a hit takes about {seconds:.2g} s of a core, and {hits} hits {time}: at "
        f"least {prepared.steps} steps, and windows of {prepared.window_nodes:.2g} nodes, "
        f"{prepared.window_bytes / 2**30:.2g} GiB; a lower level, and a longer degradation_length, take less"
    )
