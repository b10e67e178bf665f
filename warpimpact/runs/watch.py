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
from warpimpact.runs.progress import RunProgress
from warpimpact.runs.shards import Shards
from warpimpact.solver.accuracy import PilotResult
from warpimpact.statistics.intervals import looks

NUMERICS_SHARE = 0.5
"""Share of a half width that the numerics may take before more hits are of no use."""


@dataclass(frozen=True)
class End:
    """How a run ended: numbers of shards and hits, time of computing [s], and the estimate of a stop rule."""

    shards: int
    hits: int
    compute_time: float
    stop: dict[str, Any]


class Watch:
    """Follows a run: finished and failed shots, estimates, and whether the stop rule is met.

    Counts include each shard as it comes, first those that an earlier run has computed. Estimates take the shards in
    the order of their shots, so that a run ends with the same shots however it was computed.
    """

    def __init__(self, campaign: Campaign, shards: Shards, measures: Sequence[str] = ()) -> None:
        self._shards, self._stop = shards, campaign.stop
        tilts = [f"mean(tilt@{last * 1e3:.10g}mm)" for last in campaign.output.standoffs[-1:]]
        asked = [(Measure.parse(text), 0.95) for text in measures or ("mean(residual_velocity)", *tilts)]
        if campaign.stop is not None:
            asked.append((campaign.stop.measure, campaign.stop.confidence))
        self._tallies = [
            Tally(measure, replicates=campaign.replicates, confidence=confidence) for measure, confidence in asked
        ]
        self._looks = {*looks(campaign.hits.sampling, shards.count)} if campaign.stop is not None else set[int]()
        self._shift: float | None = None
        self._early: set[int] = set()
        self._next, self._hits, self._time = 0, 0, 0.0
        self.done, self.resumed, self.failed = 0, 0, 0
        self.end: End | None = None
        self.found: PilotResult | None = None
        for index in sorted(shards.there()):
            self.add(index, shards.shard(index))
        self.resumed = self.done

    def add(self, index: int, shard: HitTable) -> None:
        """Take in a finished shard. A shard that comes before its turn is loaded again when its turn comes."""
        self.done += shard.sizes["hit"]
        self.failed += int(failed(shard).sum())
        self._early.add(index)
        while self.end is None and self._next in self._early:
            self._early.remove(self._next)
            self._advance(shard if self._next == index else self._shards.shard(self._next))

    @property
    def rate(self) -> float:
        """Computed hits per second; 0 before the first shard."""
        return self._hits / self._time if self._time > 0.0 else 0.0

    def _advance(self, shard: HitTable) -> None:
        if self._stop is not None and self._next == 0:  # the first shard has hits at two levels
            self._shift = shift_of(self._stop.measure, finer_pair(shard), self._stop.confidence)
        self._next += 1
        self._hits += shard.sizes["hit"]
        self._time += shard.attrs[attr.COMPUTE_TIME]
        for tally in self._tallies:
            tally.add(shard)
        is_last = self._next == self._shards.count
        stop = self._stopped(self._stop, is_last) if self._stop is not None and self._next in self._looks else {}
        if is_last or stop:
            self.end = End(self._next, self._hits, self._time, stop)

    def _stopped(self, rule: Stop, is_last: bool) -> dict[str, Any]:
        """Attributes that say how the stop rule ends the run after the hits so far; empty if it goes on."""
        estimate, asked, shift = self._tallies[-1].estimate(), rule.measure.shown(rule.half_width), self._shift or 0.0
        met = estimate.half_width + shift <= asked
        left = max(asked - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = self._hits * estimate.half_width**2 <= left**2 * self._shards.total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - NUMERICS_SHARE) * asked
        if not (met or no_use or is_last):
            return {}
        return {
            attr.STOP_QUANTITY: rule.quantity,
            attr.STOP_REASON: "half_width" if met else "numerics" if no_use else "max_count",
            **({} if self._shift is None else {attr.ESTIMATE_NUMERICS: self._shift}),
            attr.ESTIMATE: estimate.value,
            attr.ESTIMATE_INTERVAL: [estimate.low, estimate.high],
            attr.ESTIMATE_UNITS: rule.measure.units,
            attr.CONFIDENCE: rule.confidence,
        }

    def progress(self, underway: int) -> RunProgress:
        """The progress of the run, with shots of unfinished shards."""
        estimates = {
            tally.measure: tally.estimate()
            for tally in self._tallies
            if tally.measure.kind not in ("quantile", "worst_tenth")
        }
        total = self._shards.total
        done = self.done if self.done == total else min(self.done + underway, total - 1)
        return RunProgress(done, total, self.done, self.resumed, self.failed, estimates, found=self.found)
