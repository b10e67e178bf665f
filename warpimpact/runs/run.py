"""From a campaign to its Dataset, in memory or as a file, by the fast law or by finite elements.

A run into a file survives interrupts and can be resumed.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tables import Stop
from warpimpact.continuum.many_hits import MOST
from warpimpact.measures.hits import failed
from warpimpact.measures.measure import Measure, estimate_from, shift_of
from warpimpact.measures.references import FINER, finer_pair, with_references
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.chunks import Chunks, open_chunks
from warpimpact.runs.compute import (
    block_size,
    chunk_size,
    compute_hits,
    described,
    find_resolution,
    limit_of_reference,
    manifest,
    numerics_of,
    reference_shots,
    shots_of,
    with_campaign,
)
from warpimpact.runs.computer import Computer, computer
from warpimpact.solver.device import NEVER, Cancel, cores
from warpimpact.solver.limit import LimitSpec
from warpimpact.statistics.intervals import Array, Estimate, SamplingDesign, looks

REFERENCE_HITS, REFERENCE_LIMITS = 2**12, 256
"""Most hits, and most limits, of a reference."""
PILOT_CHUNK = -1
"""Number of the chunk with what the pilot found."""
NUMERICS_SHARE = 0.5
"""Share of a half width that the numerics may take before more hits are of no use."""


@dataclass(frozen=True)
class RunProgress:
    """The progress of a run.

    Attributes:
        done, total: numbers of shots; `total` is the most that a stop rule allows.
        saved: shots of whole chunks, which no interrupt loses; `done` also counts those of unfinished chunks.
        resumed: shots that an earlier run had computed.
        failed: shots whose computation failed.
        estimates: estimate of the quantity of a stop rule, when it looked last.
        piloting: whether the pilot is still running. No shot is done then.
        level: level that the pilot computes; None where unknown.
    """

    done: int
    total: int
    saved: int = 0
    resumed: int = 0
    failed: int = 0
    estimates: dict[Measure, Estimate] = field(default_factory=dict)
    piloting: bool = False
    level: int | None = None


ProgressCallback = Callable[[RunProgress], object]


def run(
    campaign: Campaign | str | Path,
    *,
    references: bool = False,
    device: str = "auto",
    progress: ProgressCallback = lambda now: None,
    cancel: Cancel = NEVER,
) -> xarray.Dataset:
    """Compute every hit of a campaign, in memory: a Dataset with one entry per hit (results/dataset.py).

    `run(campaign.solid())` computes its solid reference.

    Args:
        campaign: the campaign, or its file.
        references: compute some hits of its references, too, with which `inspect` and `compare` then compare it.
        device: "auto" (every CUDA device if there is one, else the CPU), "cpu", "cuda:0", "cuda:0,cuda:1", …
        progress: called several times a second.
        cancel: ends the run from another thread.

    Raises:
        CampaignError: the file is no campaign, or has a value that is not allowed.
        DeviceError: the device is absent.
        Cancelled: by `cancel`.
    """
    result = run_to_file(campaign, None, device=device, references=references, progress=progress, cancel=cancel)
    assert result is not None
    return result


def run_to_file(
    campaign: Campaign | str | Path,
    output: str | Path | None,
    *,
    device: str | Computer = "auto",
    workers: int | None = None,
    scheduler: str | None = None,
    limit: LimitSpec | None = None,
    references: bool | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: ProgressCallback = lambda now: None,
    cancel: Cancel = NEVER,
    warn: Callable[[str], object] = warnings.warn,
) -> xarray.Dataset | None:
    """Compute every hit of a campaign into a file. Computed hits are soon on the disk, in `output`.parts.

    Args:
        output: the netCDF file, which appears when it is complete. None returns the result instead.
        campaign, progress, cancel: as in `run`.
        device: as in `run`; or an open computer, for several runs.
        workers, scheduler: number of processes of this machine, or address of a Dask scheduler, to compute.
        limit: the limit that is searched for every hit; without it, the end of every hit is computed.
        references: as in `run`; by default as the campaign has it.
        resume: continue what is in `output`.parts; begin if there is nothing.
        overwrite: replace an existing file, and begin anew in place of an unfinished run.
        warn: called with a sentence for damaged chunks, which are computed again.

    Raises:
        OutputError: a file cannot be written, must not be overwritten or belongs to another campaign, or another run is
            at work on it.
        CampaignError, DeviceError, Cancelled: as in `run`.
        ClusterError: the workers cannot be used.
        Interrupted: the user interrupted the run; what is saved can be resumed.
    """
    campaign = campaign if isinstance(campaign, Campaign) else Campaign.from_toml(campaign)
    path, sampler = None if output is None else Path(output), campaign.sampler()
    with (
        computer(device, workers=workers, scheduler=scheduler, cancel=cancel, warn=warn) as computing,
        open_chunks(
            path, manifest(campaign, computing.made_by, limit), resume=resume, overwrite=overwrite, warn=warn
        ) as chunks,
    ):
        if chunks is None:
            return None

        def piloting(levels: list[int]) -> None:
            progress(RunProgress(0, len(sampler), piloting=True, level=next(iter(levels), None)))

        if (pilot := chunks.load(PILOT_CHUNK)) is None:
            pilot = computing.call(find_resolution, campaign, limit, tick=piloting)
            if pilot.attrs:
                chunks.save(PILOT_CHUNK, pilot)
        numerics = numerics_of(campaign, pilot, limited=limit is not None)
        size = chunk_size(campaign, numerics, computing.made_by[attr.DEVICE], limited=limit is not None)
        watch = RunMonitor(campaign, chunks, size)

        def tasks() -> Iterator[tuple[int, tuple[Any, ...]]]:
            for number in range(watch.count):
                if number not in watch.seconds and not watch.stop:
                    hits = np.arange(number * size, min((number + 1) * size, len(sampler)))
                    yield number, (campaign, hits, numerics, limit)

        progress(watch.progress())
        with closing(computing.map(compute_hits, tasks(), lambda done: progress(watch.progress(sum(done))))) as results:
            for number, chunk in results:
                if number == 0:
                    chunk = described(chunk, campaign, pilot, limit)
                elif path is not None and campaign.stop is None:  # what has no hits is in the first
                    chunk = chunk.drop_vars([name for name, of in chunk.variables.items() if "hit" not in of.dims])
                chunks.save(number, chunk)
                watch.add(number, chunk)
                progress(watch.progress())
                if watch.stop:
                    break
        wanted = path is not None and campaign.output.solid_reference if references is None else references
        of_references = _references(campaign, limit, pilot, computing) if wanted else {}
        if v.STATUS in pilot:
            of_references[FINER] = pilot
        every = (chunk for number in range(watch.count) if (chunk := chunks.load(number)) is not None)
        seconds = sum(watch.seconds[number] for number in range(watch.count))
        rate = {attr.COMPUTE_TIME: seconds, attr.HITS_PER_SECOND: watch.hits(watch.count) / seconds}
        attributes = attr.with_units(rate) | watch.stop
        if path is None:
            return with_references(files.with_meanings(joined(every).assign_attrs(attributes)), of_references)
        attributes[attr.FINGERPRINT] = chunks.fingerprint
        files.write(every, path, attributes=attributes, references=of_references)
    return None


class RunMonitor:
    """Follows a run: finished and failed shots, computing time, and whether its stop rule is met.

    The rule takes the chunks in the order of their shots, so that a run ends with the same shots however it was
    computed.

    Args:
        size: number of shots of a chunk.

    Attributes:
        count: the number of chunks, fewer once the stop rule is met.
        seconds: computing times of the finished chunks, by their numbers.
        stop: attributes on how the stop rule ended the run; empty as long as it goes on.
    """

    def __init__(self, campaign: Campaign, chunks: Chunks, size: int) -> None:
        self._total, self._size = len(campaign.sampler()), size
        self.count, self.seconds, self.stop = -(-self._total // self._size), dict[int, float](), dict[str, Any]()
        self._chunks, self._next, self._failed = chunks, 0, 0
        self._rule, self._replicates, self._values = campaign.stop, campaign.hits.scramblings, list[Array]()
        self._estimates = dict[Measure, Estimate]()
        self._shift: float | None = None
        step = max(1, block_size(campaign) // size)
        self._looks = {min(step * look, self.count) for look in looks(campaign.hits.sampling, -(-self.count // step))}
        for number in sorted(chunks.numbers - {PILOT_CHUNK}):
            if (chunk := chunks.load(number)) is not None:
                self.add(number, chunk)
        self._resumed = self._saved

    def hits(self, chunks: int) -> int:
        """Number of shots of the first chunks."""
        return min(chunks * self._size, self._total)

    def add(self, number: int, chunk: xarray.Dataset) -> None:
        """Take in a finished chunk, which is saved."""
        self.seconds[number] = chunk.attrs[attr.COMPUTE_TIME]
        self._failed += int(failed(chunk).sum())
        while self._rule is not None and not self.stop and self._next in self.seconds:
            following = self._chunks.load(self._next)
            assert following is not None
            if self._next == 0:  # the pilot's hits are in the first chunk
                pilot = self._chunks.load(PILOT_CHUNK)
                levels = None if pilot is None else finer_pair(with_references(following, {FINER: pilot}))
                shift = shift_of(self._rule.measure, levels, self._rule.confidence)
                self._shift = None if levels is None and np.isnan(shift) else shift
            self._values.append(self._rule.measure.values(following))
            self._next += 1
            if self._next in self._looks:
                self._look(self._rule)

    def _look(self, rule: Stop) -> None:
        """Find whether the rule ends the run after the hits so far."""
        design: SamplingDesign = {"replicates": self._replicates, "confidence": rule.confidence}
        estimate = estimate_from(rule.measure, np.concatenate(self._values), **design)
        wanted, shift = rule.measure.shown(rule.half_width), self._shift or 0.0
        met, left = estimate.half_width + shift <= wanted, max(wanted - shift, 0.0)
        # The half width is about proportional to 1/√hits.
        in_reach = self.hits(self._next) * estimate.half_width**2 <= left**2 * self._total
        no_use = not met and not in_reach and estimate.half_width <= (1.0 - NUMERICS_SHARE) * wanted
        self._estimates = {rule.measure: estimate}
        if met or no_use or self._next == self.count:
            self.count = self._next
            self.stop = {
                attr.STOP_QUANTITY: rule.quantity,
                attr.STOP_REASON: "half_width" if met else "numerics" if no_use else "max_count",
                **({} if self._shift is None else {attr.ESTIMATE_NUMERICS: self._shift}),
                attr.ESTIMATE: estimate.value,
                attr.ESTIMATE_INTERVAL: [estimate.low, estimate.high],
                attr.ESTIMATE_UNITS: rule.measure.display.stored,
                attr.CONFIDENCE: rule.confidence,
            }

    @property
    def _saved(self) -> int:
        return sum(self.hits(number + 1) - self.hits(number) for number in self.seconds)

    def progress(self, underway: int = 0) -> RunProgress:
        """The progress of the run, with shots of unfinished chunks."""
        saved, total = self._saved, self._total
        done = saved if saved == total else min(saved + underway, total - 1)
        return RunProgress(done, total, saved, self._resumed, self._failed, self._estimates)


def _references(
    campaign: Campaign, limit: LimitSpec | None, pilot: xarray.Dataset, computing: Computer
) -> dict[str, xarray.Dataset]:
    """Some hits of the references of a campaign, by their names, at the resolution of the campaign."""
    datasets = dict[str, xarray.Dataset]()
    for name, reference in campaign.references.items():
        searched = limit_of_reference(limit, campaign, name)
        if limit is None or searched is not None:
            shots = reference_shots(reference, REFERENCE_HITS if limit is None else REFERENCE_LIMITS)
            numerics = numerics_of(reference, pilot, limited=limit is not None)
            dataset = computing.call(compute_hits, reference, np.arange(len(shots)), numerics, searched)
            datasets[name] = described(dataset, reference, pilot, searched)
    return datasets


def continuum_to_file(
    campaign: Campaign,
    output: Path,
    *,
    hits: tuple[int, ...] | None = None,
    device: str | Computer = "auto",
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int, int], object] = lambda done, resumed, total: None,
    warn: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute hits of a campaign by finite elements, as its table [continuum] says, into a result file. Each chunk is
    on the disk when it has ended: one hit on a CPU, where every core computes one.

    Args:
        hits: by their numbers in the campaign; None is all of them.
        progress: called with the hits that are done, how many of them an earlier call had computed, and all hits.
        device, workers, scheduler, resume, overwrite, warn: as in `run_to_file`.

    Raises:
        ValueError: the continuum does not compute this campaign.
    """
    elements, sampler, method = campaign.continuum, campaign.sampler(), campaign.continuum.method
    numbers = np.array(range(len(sampler)) if hits is None else hits)
    method.check(campaign.scene)
    with computer(device, workers=workers, scheduler=scheduler) as computing:
        content = manifest(campaign, computing.made_by) | {"continuum": elements.as_text, "numbers": hits}
        together = MOST
        if computing.made_by[attr.DEVICE] == "cpu":
            together, some = 1, shots_of(campaign, numbers[:: max(1, len(numbers) // 16)])
            if announcement := method.estimate_cost(campaign.scene, some).check(min(cores(), len(numbers))):
                warn(announcement)
        parts = [numbers[first : first + together] for first in range(0, len(numbers), together)]
        tasks = {number: (campaign, part, method) for number, part in enumerate(parts)}
        solid = campaign.references.get("solid") if campaign.output.solid_reference else None
        if solid is not None:
            tasks[len(parts)] = solid, numbers[:1], method
        with open_chunks(output, content, resume=resume, overwrite=overwrite, warn=warn) as chunks:
            if chunks is None:
                return
            resumed = sum(len(part) for number, part in enumerate(parts) if number in chunks.numbers)

            def tick(underway: list[int]) -> None:
                done = sum(len(part) for number, part in enumerate(parts) if number in chunks.numbers)
                progress(min(done + sum(underway), len(numbers)), resumed, len(numbers))

            tick([])
            missing = [task for task in tasks.items() if task[0] not in chunks.numbers]
            for number, dataset in computing.map(compute_hits, missing, tick, per_core=True):
                chunks.save(number, dataset)
                tick([])
            datasets = [chunk for number in tasks if (chunk := chunks.load(number)) is not None]
            seconds = float(sum(dataset.attrs[attr.COMPUTE_TIME] for dataset in datasets[: len(parts)]))
            attributes = {
                attr.CONTINUUM: elements.as_text,
                attr.NUMERICS: elements.words(len(campaign.target.layers)),
                attr.PRECISION: "single",
                attr.CATALOGUE_NAMES: "\n".join(f"{entry.name}: {entry.evidence}" for entry in elements.entries),
                attr.COMPUTE_TIME: seconds,
                attr.HITS_PER_SECOND: len(numbers) / seconds,
                attr.FINGERPRINT: chunks.fingerprint,
            }
            if touching := campaign.target.touching_layers(elements.layers):
                attributes[attr.TOUCHING_LAYERS] = touching
            references = {} if solid is None else {"solid": with_campaign(datasets[-1], solid, attributes)}
            result = with_campaign(joined(datasets[: len(parts)]), campaign, attributes)
            files.write(with_references(result, references), output)
