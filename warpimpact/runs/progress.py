"""How far a run is, for those who follow it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from warpimpact.results.measures import Measure
from warpimpact.solver.pilot import Found
from warpimpact.statistics.intervals import Estimate


@dataclass(frozen=True)
class RunProgress:
    """How far a run is.

    Attributes:
        done, total: shots; `total` is the most that a stop rule allows.
        saved: shots of whole shards, which no interrupt loses; `done` counts those of unfinished ones too.
        resumed: shots that an earlier run had done.
        failed: shots whose computation failed.
        estimates: running estimates of the main quantities, over the shots from the first on without a gap.
        piloting: whether a pilot is at work still; no shot is done then.
        trying: the level that it computes; None where that is not known.
        found: what it found; None if the campaign fixes the resolution.
    """

    done: int
    total: int
    saved: int
    resumed: int
    failed: int
    estimates: dict[Measure, Estimate]
    piloting: bool = False
    trying: int | None = None
    found: Found | None = None


Follow = Callable[[RunProgress], None]
