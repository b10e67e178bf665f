"""How far a run is, for those who follow it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from warpimpact.results.measures import Measure
from warpimpact.statistics.intervals import Estimate


@dataclass(frozen=True)
class Standing:
    """How far a run is.

    Attributes:
        done, total: shots; `total` is the most that a stop rule allows.
        saved: shots of whole shards, which no interrupt loses; `done` counts those of unfinished ones too.
        resumed: shots that an earlier run had done.
        failed: shots whose computation failed.
        estimates: running estimates of the main quantities, over the shots from the first on without a gap.
        promise: the finding of the pilot; None if the campaign fixes the resolution.
    """

    done: int
    total: int
    saved: int
    resumed: int
    failed: int
    estimates: dict[Measure, Estimate]
    promise: Any = None


Follow = Callable[[Standing], None]
