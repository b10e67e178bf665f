"""The progress of a run: counts, running estimates, whether its stop rule is met, and a bar in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tables import Stop
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed, finer_pair
from warpimpact.results.measures import Measure, Tally, shift_of
from warpimpact.runs.chunks import Chunks
from warpimpact.solver.accuracy import PilotResult
from warpimpact.statistics.intervals import Estimate, looks


@dataclass(frozen=True)
class RunProgress:
    """The progress of a run.

    Attributes:
        done, total: numbers of shots; `total` is the most that a stop rule allows.
        saved: shots of whole chunks, which no interrupt loses; `done` also counts those of unfinished chunks.
        resumed: shots that an earlier run had computed.
        failed: shots whose computation failed.
        estimates: running estimates of the main quantities, over the shots from the first on without a gap.
        piloting: whether the pilot is still running. No shot is done then.
        level: level that the pilot computes; None where unknown.
        pilot: None if the campaign fixes the resolution.
    """

    done: int
    total: int
    saved: int = 0
    resumed: int = 0
    failed: int = 0
    estimates: dict[Measure, Estimate] = field(default_factory=dict)
    piloting: bool = False
    level: int | None = None
    pilot: PilotResult | None = None


Follow = Callable[[RunProgress], None]


@contextmanager
def followed(given: Follow | None) -> Iterator[Follow]:
    """The function that shows the progress of a run: the given one, or a bar in a notebook. Elsewhere nothing is
    shown."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if given is not None or type(shell).__name__ != "ZMQInteractiveShell":
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


NUMERICS_SHARE = 0.5
"""Share of a half width that the numerics may take before more hits are of no use."""


class Watch:
    """Follows a run: finished and failed shots, estimates, and whether the stop rule is met.

    Counts include each chunk as it comes, first those that an earlier run has computed. Estimates take the chunks in
    the order of their shots, so that a run ends with the same shots however it was computed.

    Attributes:
        total: the most shots.
        count: the number of chunks, fewer once a stop rule is met.
        ended: whether all chunks that the result needs are there.
        hits, time: number and computing time [s] of the shots from the first on without a gap.
        stop: attributes on how the stop rule ended the run.
    """

    def __init__(self, campaign: Campaign, chunks: Chunks, extent: int, measures: Sequence[str] = ()) -> None:
        self.total = len(campaign.sampler())
        self.count, self.ended, self.hits, self.time = -(-self.total // extent), False, 0, 0.0
        self.stop: dict[str, Any] = {}
        self._chunks, self._rule = chunks, campaign.stop
        tilts = [f"mean(tilt@{last * 1e3:.10g}mm)" for last in campaign.output.standoffs[-1:]]
        shown = [(Measure.parse(text), 0.95) for text in measures or ("mean(residual_velocity)", *tilts)]
        if campaign.stop is not None:
            shown.append((campaign.stop.measure, campaign.stop.confidence))
        self._tallies = [
            Tally(measure, replicates=campaign.replicates, confidence=confidence) for measure, confidence in shown
        ]
        self._looks = {*looks(campaign.hits.sampling, self.count)} if campaign.stop is not None else set[int]()
        self._shift: float | None = None
        self._next = 0
        self._progress = RunProgress(0, self.total, estimates=self._estimates())
        for number in sorted(chunks.numbers):
            self.add(number)
        self._progress = replace(self._progress, resumed=self._progress.done)

    def add(self, number: int, chunk: xarray.Dataset | None = None) -> None:
        """Take in a finished chunk. One that comes before its turn is loaded again when its turn comes."""
        chunk = self._chunks.load(number) if chunk is None else chunk
        assert chunk is not None
        done, failures = self._progress.saved + chunk.sizes["hit"], self._progress.failed + int(failed(chunk).sum())
        self._progress = replace(self._progress, done=done, saved=done, failed=failures)
        before = self._next
        while not self.ended and self._next in self._chunks.numbers:
            following = chunk if self._next == number else self._chunks.load(self._next)
            assert following is not None
            self._advance(following)
        if self._next > before:
            self._progress = replace(self._progress, estimates=self._estimates())

    def _advance(self, chunk: xarray.Dataset) -> None:
        if self._rule is not None and self._next == 0:  # the first chunk has hits at two levels
            self._shift = shift_of(self._rule.measure, finer_pair(chunk), self._rule.confidence)
        self._next += 1
        self.hits += chunk.sizes["hit"]
        self.time += chunk.attrs[attr.COMPUTE_TIME]
        for tally in self._tallies:
            tally.add(chunk)
        is_last = self._next == self.count
        if self._rule is not None and self._next in self._looks:
            self.stop = self._stopped(self._rule, is_last)
        if is_last or self.stop:
            self.count, self.ended = self._next, True

    def _stopped(self, rule: Stop, is_last: bool) -> dict[str, Any]:
        """Attributes that say how the stop rule ends the run after the hits so far; empty if it goes on."""
        estimate, wanted, shift = self._tallies[-1].estimate(), rule.measure.shown(rule.half_width), self._shift or 0.0
        met = estimate.half_width + shift <= wanted
        left = max(wanted - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = self.hits * estimate.half_width**2 <= left**2 * self.total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - NUMERICS_SHARE) * wanted
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

    def _estimates(self) -> dict[Measure, Estimate]:
        cheap = [tally for tally in self._tallies if tally.measure.kind not in ("quantile", "worst_tenth")]
        return {tally.measure: tally.estimate() for tally in cheap}

    def progress(self, pilot: PilotResult | None, underway: int = 0) -> RunProgress:
        """The progress of the run, with shots of unfinished chunks."""
        saved = self._progress.saved
        done = saved if saved == self.total else min(saved + underway, self.total - 1)
        return replace(self._progress, done=done, pilot=pilot)
