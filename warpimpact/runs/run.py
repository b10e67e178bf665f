"""From a campaign to its Dataset, in memory or as a file. A run into a file survives interrupts and can be resumed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import numbered
from warpimpact.results.layers import in_memory
from warpimpact.results.references import with_references
from warpimpact.results.table import HitTable, joined
from warpimpact.runs.compute import HIT_MAP, Computation, numerics_of
from warpimpact.runs.describe import pilot_in
from warpimpact.runs.executor import Executor, Job, completed, executor_for, opened, result_of
from warpimpact.runs.parts import claimed, telling
from warpimpact.runs.progress import End, Follow, Watch, followed
from warpimpact.runs.shards import Shards, ShardsOnDisk, extent, manifest
from warpimpact.scene import Numerics, Shots
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import at_level
from warpimpact.solver.worker import Cancel

if TYPE_CHECKING:
    import xarray

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


CUDA_SHOTS = 2**17
"""Shots per task on a GPU. Fewer shots would not fill it."""
CPU_SHOTS, CPU_SECONDS = 2**14, 0.5
"""Most shots of a task on the CPU of this machine, and the time that it shall take, beside which its set-up on one core
is short. A task is at least one shard; another process computes one shard per task."""


def task_size(executor: Executor, rate: float) -> int:
    """Shots per task, at a rate of shots per second; 0 stands for one shard."""
    if executor.made_by[attr.DEVICE] != "cpu":
        return CUDA_SHOTS
    return 0 if executor.is_remote else min(CPU_SHOTS, int(CPU_SECONDS * rate))


def reference_shots(campaign: Campaign, among: int, most: int) -> Shots:
    """The first shots of a reference. One stands for all where the first ones differ only in their places, and all
    layers are solid and unbounded."""
    shots = campaign.sampler().shots(0, among)
    elsewhere = (v.HIT_Y, v.HIT_Z, "offset_y", "offset_z")
    conditions = [values for name, values in shots.columns.items() if name not in elsewhere]
    unbounded = all(layer == layer.solid and layer.size is None for layer in campaign.target.layers)
    alike = unbounded and not any(np.nan_to_num(np.ptp(values, axis=0)).any() for values in conditions)
    return shots[: 1 if alike else max(1, most)]


def ranges(shards: Shards, shots: Callable[[], int]) -> Iterator[range]:
    """Ranges of missing shards. Each has about as many shots as `shots` returns when the range begins."""
    there, first = frozenset(shards.there()), 0
    while first < shards.count:
        most, stop = max(1, shots() // shards.extent), first
        while stop < min(first + most, shards.count) and stop not in there:
            stop += 1
        if stop > first:
            yield range(first, stop)
        first = max(stop, first + 1)


def split(table: HitTable, task: range, size: int) -> Iterator[tuple[int, HitTable]]:
    """The shards of a task, each with its share of the time. Only the first shard of a campaign keeps the variables of
    the whole campaign."""
    hits, of_the_campaign = table.sizes["hit"], [name for names in v.GROUPS.values() for name in names]
    for place, index in enumerate(task):
        shard = numbered(table.isel(hit=slice(place * size, (place + 1) * size)), first=index * size)
        if index:
            shard = shard.drop_vars(of_the_campaign)
        time = table.attrs[attr.COMPUTE_TIME] * shard.sizes["hit"] / hits
        yield index, shard.assign_attrs({attr.COMPUTE_TIME: time})


def run(
    campaign: Campaign | str | Path,
    *,
    references: bool = False,
    device: str = "auto",
    progress: Follow | None = None,
    cancel: Cancel | None = None,
) -> xarray.Dataset:
    """Compute every hit of a campaign, in memory. `run(campaign.solid())` computes its solid reference.

    Args:
        campaign: the campaign, or its file.
        references: compute some hits of its references, too, with which `inspect` and `compare` then compare it.
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
        shards = Shards(total, extent(total))
        end = _fill(campaign, HIT_MAP, shards, executor, follow)
        tables = _references(campaign, HIT_MAP, shards, executor) if references else {}
    table = joined(shards.shard(index) for index in range(end.shards))
    result = in_memory(table.assign_attrs(_attributes(table, end)).to_xarray())
    return with_references(result, {name: in_memory(one.to_xarray()) for name, one in tables.items()})


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
        output: the netCDF file. It appears when it is complete.
        campaign, device, progress: as in `run`; or an executor for the device.
        computation: what is computed of every hit.
        resume: continue what is in `output`.parts; begin if there is nothing.
        overwrite: replace an existing file, and begin anew in place of an unfinished run.
        tell: called with a sentence for each damaged part, which is computed again.

    Raises:
        OutputError: a file cannot be written, must not be overwritten or belongs to another campaign, or another run is
            at work on it.
        CampaignError, DeviceError: as in `run`.
        Interrupted: the user interrupted the run; what is saved can be resumed.
    """
    campaign, output = _read(campaign), Path(output)
    with claimed(output), opened(device) as computing:
        content = manifest(campaign, {**computing.made_by, **computation.content})
        total = len(campaign.sampler())
        shards = ShardsOnDisk(output, content, total, tell)
        if not shards.parts.begin(resume=resume, overwrite=overwrite):
            return
        with telling(shards.kept):
            with followed(progress) as follow:
                end = _fill(campaign, computation, shards, computing, follow)
                references = _references(campaign, computation, shards, computing)
            shards.finish(end.shards, lambda first: _attributes(first, end), references)


def _read(campaign: Campaign | str | Path) -> Campaign:
    return campaign if isinstance(campaign, Campaign) else Campaign.from_toml(campaign)


def _fill(campaign: Campaign, computation: Computation, shards: Shards, executor: Executor, follow: Follow) -> End:
    """Compute the missing shards until none is missing or the stop rule is met."""
    sampler = campaign.sampler()
    watch = Watch(campaign, shards, computation.measures)
    is_new, warn = 0 not in shards.there(), cost_warning(campaign, executor.made_by[attr.DEVICE], computation.passages)
    if not is_new:  # shard 0 holds the pilot's findings, and its hits at a finer level
        watch.pilot = pilot_in(shards.shard(0))
    else:

        def piloting() -> None:
            level = next(iter(executor.reports()), None)
            if level is not None:
                warn(at_level(level, campaign.numerics))
            follow(replace(watch.progress(0), piloting=True, trying=level))

        watch.pilot = result_of(executor, computation.pilot, campaign, tick=piloting)
    warn(numerics_of(campaign, watch.pilot))

    later = None if watch.pilot is None else replace(watch.pilot, finer=None, numbers=None)

    def jobs() -> Iterator[tuple[range, Job]]:
        most = lambda: task_size(executor, 0.0 if campaign.stop else watch.rate)  # noqa: E731
        for task in ranges(shards, most):
            shots = sampler.shots(task.start * shards.extent, len(task) * shards.extent)
            yield task, Job(computation.compute, (campaign, shots, watch.pilot if task.start == 0 else later))

    with closing(completed(executor, jobs(), lambda: follow(watch.progress(sum(executor.reports()))))) as tables:
        while watch.end is None:
            task, table = next(tables)
            for index, shard in split(table, task, shards.extent):
                shards.save(index, shard)
                watch.add(index, shard)
    follow(watch.progress(0))
    return watch.end


def _references(
    campaign: Campaign, computation: Computation, shards: Shards, executor: Executor
) -> dict[str, HitTable]:
    """Some hits of the references of a campaign, by their names, at the resolution that its pilot found."""
    pilot, tables = pilot_in(shards.shard(0)), dict[str, HitTable]()
    for name, reference in campaign.references.items() if campaign.output.solid_reference else ():
        if (of_reference := computation.of_reference(campaign, name)) is not None:
            shots = reference_shots(reference, shards.extent, computation.reference_hits)
            tables[name] = result_of(executor, of_reference.compute, reference, shots, pilot)
    return tables


def _attributes(table: HitTable, end: End) -> dict[str, Any]:
    """Global attributes of a complete result that replace those of its first shard."""
    return {
        attr.HISTORY: attr.history_line(table.attrs[attr.HISTORY].partition(" warpimpact ")[2]),
        attr.COMPUTE_TIME: end.compute_time,
        attr.HITS_PER_SECOND: end.hits / end.compute_time,
        **end.stop,
    }
