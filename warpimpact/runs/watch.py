"""What a run has computed so far: counts, estimates, and whether its stop rule is met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.stop import Stop
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed, finer_pair
from warpimpact.results.measures import Measure
from warpimpact.results.table import HitTable
from warpimpact.results.tallies import Tally, shift_of
from warpimpact.runs.levels import OF_THE_NUMERICS
from warpimpact.runs.progress import RunProgress
from warpimpact.runs.shards import Shards
from warpimpact.solver.findings import Found
from warpimpact.statistics.intervals import Dealing, looks


@dataclass(frozen=True)
class End:
    """How a run ended: numbers of shards and hits, time of computing [s], and the estimate of a stop rule."""

    shards: int
    hits: int
    compute_time: float
    stop: dict[str, Any]


class Watch:
    """Follows a run: finished and failed shots, estimates, and whether the stop rule is met.

    Counts include each shard as it comes. Estimates take the shards in the order of their shots, so that a run ends
    with the same shots however it was computed.
    """

    def __init__(self, campaign: Campaign, total: int, shards: Shards, measures: Sequence[str] = ()) -> None:
        self._total, self._shards, self._load = total, -(-total // shards.extent), shards.shard
        tilts = [f"mean(tilt@{last * 1e3:.10g}mm)" for last in campaign.output.standoffs[-1:]]
        dealt: Dealing = {"replicates": campaign.replicates, "images": campaign.group}
        self._tallies = [
            Tally(Measure.parse(measure), **dealt) for measure in measures or ("mean(residual_velocity)", *tilts)
        ]
        self._rule: _Rule | None = None
        if campaign.stop is not None:
            self._rule = _Rule(campaign.stop, total, self._shards, campaign.hits.sampling, dealt)
            self._tallies.append(self._rule.tally)
        self._early: set[int] = set()
        self._next, self._hits, self._time = 0, 0, 0.0
        self.done, self.resumed, self.failed = 0, 0, 0
        self.end: End | None = None
        self.found: Found | None = None

    def add(self, index: int, shard: HitTable) -> None:
        """Take in a finished shard. A shard that comes before its turn is loaded again when its turn comes."""
        self.done += shard.sizes["hit"]
        self.failed += int(failed(shard).sum())
        self._early.add(index)
        while self.end is None and self._next in self._early:
            self._early.remove(self._next)
            self._advance(shard if self._next == index else self._load(self._next))

    @property
    def rate(self) -> float:
        """Computed hits per second; 0 before the first shard."""
        return self._hits / self._time if self._time > 0.0 else 0.0

    def _advance(self, shard: HitTable) -> None:
        self._next += 1
        self._hits += shard.sizes["hit"]
        self._time += shard.attrs[attr.COMPUTE_TIME]
        for tally in self._tallies:
            tally.add(shard)
        if self._rule is not None and self._next == 1:
            self._rule.learn_shift(shard)
        stop = {} if self._rule is None else self._rule.look(self._next, self._hits)
        if self._next == self._shards or stop:
            self.end = End(self._next, self._hits, self._time, stop)

    def progress(self, underway: int) -> RunProgress:
        """The progress of the run, with shots of unfinished shards."""
        estimates = {
            tally.measure: tally.estimate()
            for tally in self._tallies
            if tally.measure.kind not in ("quantile", "worst_tenth")
        }
        done = self.done if self.done == self._total else min(self.done + underway, self._total - 1)
        return RunProgress(done, self._total, self.done, self.resumed, self.failed, estimates, found=self.found)


class _Rule:
    """Says after which shard a run ends by its stop rule.

    Args:
        total, shards: numbers of hits and of shards that end the run in any case.
    """

    def __init__(self, stop: Stop, total: int, shards: int, sampling: str, dealt: Dealing) -> None:
        self._stop, self._measure, self._total, self._shards = stop, stop.measure, total, shards
        self.tally = Tally(self._measure, **dealt, confidence=stop.confidence)
        self._looks = looks(sampling, shards)
        self._look = next(self._looks)
        self._shift: float | None = None

    def learn_shift(self, first: HitTable) -> None:
        """Learn the shift of the measure by the numerics from the first shard, which holds hits at two levels."""
        self._shift = shift_of(self._measure, finer_pair(first), self._stop.confidence)

    def look(self, shards: int, hits: int) -> dict[str, Any]:
        """Attributes that say how the rule ends the run after these numbers of shards and hits; empty if it goes on."""
        if shards != self._look:
            return {}
        self._look = next(self._looks, self._shards)
        estimate, asked, shift = self.tally.estimate(), self._measure.shown(self._stop.half_width), self._shift or 0.0
        met = estimate.half_width + shift <= asked
        left = max(asked - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = hits * estimate.half_width**2 <= left**2 * self._total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - OF_THE_NUMERICS) * asked
        if not met and not no_use and shards != self._shards:
            return {}
        return {
            attr.STOP_QUANTITY: self._stop.quantity,
            attr.STOP_REASON: "half_width" if met else "numerics" if no_use else "max_count",
            **({} if self._shift is None else {attr.ESTIMATE_NUMERICS: self._shift}),
            attr.ESTIMATE: estimate.value,
            attr.ESTIMATE_INTERVAL: [estimate.low, estimate.high],
            attr.ESTIMATE_UNITS: self._measure.units,
            attr.CONFIDENCE: self._stop.confidence,
        }
