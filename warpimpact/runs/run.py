"""From a campaign to its Dataset, in memory or as a file. A run into a file survives interrupts and can be resumed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed, finer_pair, images
from warpimpact.results.measures import Measure
from warpimpact.results.outlines import in_memory
from warpimpact.results.table import HitTable, joined
from warpimpact.results.tallies import Tally, shift_of
from warpimpact.runs.assumed import has_assumptions
from warpimpact.runs.choice import executor_for, opened
from warpimpact.runs.compute import HIT_MAP, numerics_of
from warpimpact.runs.executor import Executor, Job, completed, result_of
from warpimpact.runs.foreseen import Cost
from warpimpact.runs.jobs import (
    assumed_job,
    computed_hits,
    pilot_job,
    ranges,
    solid_shots,
    split,
    task_job,
    task_size,
    with_ligament,
)
from warpimpact.runs.levels import OF_THE_NUMERICS
from warpimpact.runs.parts import claimed, telling
from warpimpact.runs.progress import Follow, RunProgress, followed
from warpimpact.runs.shards import Shards, ShardsOnDisk, extent, manifest
from warpimpact.runs.task import Computation, Task
from warpimpact.solver.findings import Found
from warpimpact.solver.resolution import at_level
from warpimpact.solver.worker import Cancel
from warpimpact.statistics.intervals import Dealing, looks

if TYPE_CHECKING:
    import xarray


def run(
    campaign: Campaign | str | Path,
    *,
    device: str = "auto",
    progress: Follow | None = None,
    cancel: Cancel | None = None,
) -> xarray.Dataset:
    """Compute every hit of a campaign, in memory.

    Args:
        campaign: the campaign, or its file.
        device: "auto" (every CUDA device if there is one, else the CPU), "cpu", "cuda:0", "cuda:0,cuda:1", …
        progress: called several times a second; without it a notebook shows a bar.
        cancel: ends the run from another thread.

    Returns:
        The Dataset of results/dataset.py, one entry per hit.

    Raises:
        CampaignError: the file is no campaign, or has a value that is not allowed.
        DeviceError: the device is absent.
        Cancelled: by `cancel`.
    """
    campaign = _read(campaign)
    total = len(campaign.sampler())
    with executor_for(device, cancel=cancel) as executor, followed(progress) as follow:
        shards = Shards(extent(total, campaign.at_a_plate))
        end = _fill(campaign, HIT_MAP, shards, executor, follow)
    table = joined(shards.shard(index) for index in range(end.shards))
    return in_memory(table.assign_attrs(_attributes(table, end)).to_xarray())


def with_assumptions(
    dataset: xarray.Dataset, campaign: Campaign, *, device: str = "auto", cancel: Cancel | None = None
) -> xarray.Dataset:
    """Add the hits under assumptions to a result whose campaign left them out, as `run` would compute them.

    Args:
        device, cancel: as in `run`.
    """
    findings = HIT_MAP.found_in(dataset)
    with executor_for(device, cancel=cancel) as executor:
        table = result_of(executor, assumed_job, HIT_MAP, campaign, None if findings is None else findings.told)
    assumed = in_memory(table.to_xarray())
    return dataset.assign(assumed.variables).assign_attrs(assumed.attrs)


def run_to_file(
    campaign: Campaign | str | Path,
    output: str | Path,
    *,
    device: str | Executor = "auto",
    computation: Computation = HIT_MAP,
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute every hit of a campaign into a file. Computed hits are on the disk at once, in `output`.parts.

    Args:
        campaign: the campaign, or its file.
        output: the netCDF file. It appears when it is complete.
        device: as in `run`, or an executor.
        progress: as in `run`.
        computation: what is computed of every hit.
        resume: continue what is in `output`.parts; begin if there is nothing.
        overwrite: replace an existing file, and begin anew in place of an unfinished run.
        tell: called with a sentence for each damaged part, which is computed again.

    Raises:
        CampaignError: as in `run`.
        OutputError: a file cannot be written, must not be overwritten or belongs to another campaign, or another run is
            at work on it.
        DeviceError: the device is absent.
        Interrupted: the user interrupted the run; what is saved can be resumed.
    """
    campaign, output = _read(campaign), Path(output)
    with claimed(output), opened(device) as computing:
        content = manifest(campaign, {**computing.made_by, **computation.content})
        total = len(campaign.sampler())
        shards = ShardsOnDisk(output, content, total, tell, grows=campaign.stop is None)
        if not shards.parts.begin(resume=resume, overwrite=overwrite):
            return
        with telling(shards.kept):
            with followed(progress) as follow:
                end = _fill(campaign, computation, shards, computing, follow)
            shards.finish(end.shards, lambda first: _attributes(first, end))


def _read(campaign: Campaign | str | Path) -> Campaign:
    return campaign if isinstance(campaign, Campaign) else Campaign.from_toml(campaign)


@dataclass(frozen=True)
class _End:
    """How a run ended: numbers of shards and hits, time of computing [s], and the estimate of a stop rule."""

    shards: int
    hits: int
    compute_time: float
    stop: dict[str, Any]


def _fill(campaign: Campaign, computation: Computation, shards: Shards, executor: Executor, follow: Follow) -> _End:
    """Compute the missing shards until none is missing or the stop rule is met."""
    sampler = campaign.sampler()
    watch = _Watch(campaign, len(sampler), shards, computation.measures)
    there = sorted(shards.there())
    for index in there:
        watch.add(index, shards.shard(index))
    watch.resumed, cost = watch.done, Cost(campaign, executor.made_by[attr.DEVICE], computation.passages)
    if watch.end is None:
        campaign = result_of(executor, with_ligament, campaign)
    if 0 in there:  # shard 0 holds the pilot's findings, and its hits at a finer level
        watch.found = computation.found_in(shards.shard(0))
    else:

        def piloting() -> None:
            level = next(iter(executor.reports()), None)
            if level is not None:
                cost.tell(at_level(level, campaign.numerics))
            follow(replace(watch.progress(0), piloting=True, trying=level))

        watch.found = result_of(executor, pilot_job, computation, campaign, tick=piloting)
    cost.tell(numerics_of(campaign, watch.found))

    asks = 0 not in there and has_assumptions(campaign)
    found_alone = None if watch.found is None else watch.found.told

    def jobs() -> Iterator[tuple[range | None, Job]]:
        if asks:
            yield None, Job(assumed_job, (computation, campaign, found_alone))
        most = lambda: task_size(executor, 0.0 if campaign.stop else watch.rate)  # noqa: E731
        for task in ranges(shards, len(sampler), most):
            shots = sampler.shots(task.start * shards.extent, len(task) * shards.extent)
            first = shots[: shards.extent] if task.start == 0 else None
            solid = None if first is None else solid_shots(campaign, first, computation.most_solid)
            findings = watch.found if task.start == 0 else found_alone
            yield task, Job(task_job, (computation, campaign, Task(shots, solid, findings)))

    def take(index: int, shard: HitTable) -> None:
        shards.save(index, shard)
        watch.add(index, shard)

    with closing(completed(executor, jobs(), lambda: follow(watch.progress(sum(executor.reports()))))) as tables:
        first = assumed = None  # the first shard takes up the assumed hits, and is kept until they are there
        while watch.end is None:
            task, table = next(tables)
            if task is None:
                assumed = table
            else:
                for index, shard in split(table, task, shards.extent):
                    if index == 0 and asks:
                        first = shard
                    else:
                        take(index, shard)
            if first is not None and assumed is not None:
                take(0, first.beside(assumed))
                first = None
    follow(watch.progress(0))
    return watch.end


class _Watch:
    """Follows a run: finished and failed shots, estimates, and whether the stop rule is met.

    Except for the counts, shards are looked at in the order of their shots, in whatever order they come. So a run ends
    with the same shots however it was computed.
    """

    def __init__(self, campaign: Campaign, total: int, shards: Shards, measures: Sequence[str] = ()) -> None:
        self._total, self._shards, self._load = total, -(-total // shards.extent), shards.shard
        self._rule = campaign.stop
        tilts = [f"mean(tilt@{last * 1e3:.10g}mm)" for last in campaign.output.standoffs[-1:]]
        measures = measures or ("mean(residual_velocity)", *tilts)
        dealt: Dealing = {"replicates": campaign.replicates, "images": len(campaign.symmetries) * campaign.at_a_plate}
        self._tallies = [Tally(Measure.parse(measure), **dealt) for measure in measures]
        if self._rule is not None:
            rule = self._rule
            self._stop = Tally(rule.measure, **dealt, confidence=rule.confidence)
            self._looks = looks(campaign.hits.sampling, self._shards)
            self._look = next(self._looks)
        self._shift: float | None = None
        self._early: set[int] = set()
        self._next, self._hits, self._time = 0, 0, 0.0
        self.done, self.resumed, self.failed = 0, 0, 0
        self.end: _End | None = None
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
        stop: dict[str, Any] = {}
        if self._rule is not None:
            self._stop.add(shard)
            if self._next == 1:
                self._shift = shift_of(self._rule.measure, finer_pair(shard), self._rule.confidence)
            stop = self._looked_at()
        if self._next == self._shards or stop:
            self.end = _End(self._next, self._hits, self._time, stop)

    def _looked_at(self) -> dict[str, Any]:
        """Attributes that say how the stop rule ended the run; empty while it has not."""
        rule = self._rule
        assert rule is not None
        if self._next != self._look:
            return {}
        self._look = next(self._looks, self._shards)
        estimate, asked, shift = self._stop.estimate(), rule.measure.shown(rule.half_width), self._shift or 0.0
        met = estimate.half_width + shift <= asked
        left = max(asked - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = self._hits * estimate.half_width**2 <= left**2 * self._total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - OF_THE_NUMERICS) * asked
        if not met and not no_use and self._next != self._shards:
            return {}
        return {
            attr.STOP_QUANTITY: rule.quantity,
            attr.STOP_REASON: "half_width" if met else "numerics" if no_use else "max_count",
            **({} if self._shift is None else {attr.ESTIMATE_NUMERICS: shift}),
            attr.ESTIMATE: estimate.value,
            attr.ESTIMATE_INTERVAL: [estimate.low, estimate.high],
            attr.ESTIMATE_UNITS: rule.measure.units,
            attr.CONFIDENCE: rule.confidence,
        }

    def progress(self, underway: int) -> RunProgress:
        """The progress of the run, with shots of unfinished shards."""
        tallies = [*self._tallies, self._stop] if self._rule is not None else self._tallies
        estimates = {
            tally.measure: tally.estimate()
            for tally in tallies
            if tally.measure.kind not in ("quantile", "worst_tenth")
        }
        done = self.done if self.done == self._total else min(self.done + underway, self._total - 1)
        return RunProgress(done, self._total, self.done, self.resumed, self.failed, estimates, found=self.found)


def _attributes(table: HitTable, end: _End) -> dict[str, Any]:
    """Global attributes of a complete result that replace those of its first shard."""
    return {
        attr.HISTORY: attr.history_line(table.attrs[attr.HISTORY].partition(" warpimpact ")[2]),
        attr.COMPUTE_TIME: end.compute_time,
        attr.HITS_PER_SECOND: end.hits / images(table) / end.compute_time,
        **computed_hits(table, end.hits),
        **end.stop,
    }
