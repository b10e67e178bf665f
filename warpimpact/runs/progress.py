"""The progress of a run: counts, estimates, whether its stop rule is met, and how it is shown."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from warpimpact.campaign.campaign import Campaign, Stop
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed, finer_pair
from warpimpact.results.measures import Measure, Tally, shift_of
from warpimpact.results.table import HitTable
from warpimpact.runs.shards import Shards
from warpimpact.solver.accuracy import PilotResult
from warpimpact.statistics.intervals import Estimate, looks


@dataclass(frozen=True)
class RunProgress:
    """The progress of a run.

    Attributes:
        done, total: numbers of shots; `total` is the most that a stop rule allows.
        saved: shots of whole shards, which no interrupt loses; `done` also counts those of unfinished shards.
        resumed: shots that an earlier run had computed.
        failed: shots whose computation failed.
        estimates: running estimates of the main quantities, over the shots from the first on without a gap.
        piloting: whether the pilot is still running. No shot is done then.
        trying: level that the pilot computes; None where unknown.
        pilot: None if the campaign fixes the resolution.
    """

    done: int
    total: int
    saved: int
    resumed: int
    failed: int
    estimates: dict[Measure, Estimate]
    piloting: bool = False
    trying: int | None = None
    pilot: PilotResult | None = None


Follow = Callable[[RunProgress], None]


@contextmanager
def followed(given: Follow | None) -> Iterator[Follow]:
    """The function that shows the progress of a run: the given one, or a bar in a notebook. Elsewhere nothing is
    shown."""
    if given is not None or not _in_a_notebook():
        yield given or (lambda now: None)
        return
    from tqdm.auto import tqdm

    with tqdm(unit="hit") as bar:

        def show(now: RunProgress) -> None:
            bar.total = now.total
            text = "a pilot looks for the resolution" if now.piloting else f"{now.failed} failed" if now.failed else ""
            bar.set_postfix_str(text, refresh=False)
            bar.update(now.done - bar.n)

        yield show
        bar.refresh()


def _in_a_notebook() -> bool:
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


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
        self.pilot: PilotResult | None = None
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
        return RunProgress(done, total, self.done, self.resumed, self.failed, estimates, pilot=self.pilot)
