"""From a campaign to its Dataset, in memory or as a file. A run into a file survives interrupts and can be resumed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.outlines import in_memory
from warpimpact.results.references import with_references
from warpimpact.results.table import HitTable, joined
from warpimpact.runs.choice import executor_for, opened
from warpimpact.runs.compute import HIT_MAP, numerics_of
from warpimpact.runs.cost import cost_warning
from warpimpact.runs.describe import pilot_in
from warpimpact.runs.executor import Executor, Job, completed, result_of
from warpimpact.runs.jobs import ranges, reference_shots, split, task_size
from warpimpact.runs.parts import claimed, telling
from warpimpact.runs.progress import Follow, followed
from warpimpact.runs.shards import Shards, ShardsOnDisk, extent, manifest
from warpimpact.runs.task import Computation, Task
from warpimpact.runs.watch import End, Watch
from warpimpact.solver.resolution import at_level
from warpimpact.solver.worker import Cancel

if TYPE_CHECKING:
    import xarray


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
        shards = ShardsOnDisk(output, content, total, tell, grows=campaign.stop is None)
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
        watch.found = pilot_in(shards.shard(0))
    else:

        def piloting() -> None:
            level = next(iter(executor.reports()), None)
            if level is not None:
                warn(at_level(level, campaign.numerics))
            follow(replace(watch.progress(0), piloting=True, trying=level))

        watch.found = result_of(executor, computation.pilot, campaign, tick=piloting)
    warn(numerics_of(campaign, watch.found))

    later = None if watch.found is None else replace(watch.found, finer=None, numbers=None)

    def jobs() -> Iterator[tuple[range, Job]]:
        most = lambda: task_size(executor, 0.0 if campaign.stop else watch.rate)  # noqa: E731
        for task in ranges(shards, most):
            shots = sampler.shots(task.start * shards.extent, len(task) * shards.extent)
            findings = watch.found if task.start == 0 else later
            yield task, Job(computation.compute, (campaign, Task(shots, findings)))

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
    found, tables = pilot_in(shards.shard(0)), dict[str, HitTable]()
    for name, reference in campaign.references.items() if campaign.output.solid_reference else ():
        if (of_reference := computation.of_reference(campaign, name)) is not None:
            shots = reference_shots(reference, shards.extent, computation.reference_hits)
            tables[name] = result_of(executor, of_reference.compute, reference, Task(shots, found))
    return tables


def _attributes(table: HitTable, end: End) -> dict[str, Any]:
    """Global attributes of a complete result that replace those of its first shard."""
    return {
        attr.HISTORY: attr.history_line(table.attrs[attr.HISTORY].partition(" warpimpact ")[2]),
        attr.COMPUTE_TIME: end.compute_time,
        attr.HITS_PER_SECOND: end.hits / end.compute_time,
        **end.stop,
    }
