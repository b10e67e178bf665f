"""From a campaign to its Dataset, in memory or as a file. A run into a file survives interrupts and can be resumed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.records.registry import LIMITS
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.results.references import with_references
from warpimpact.runs.chunks import Chunks, open_chunks
from warpimpact.runs.compute import (
    compute_hits,
    compute_limits,
    extent,
    find_resolution,
    limit_of_reference,
    manifest,
    model_errors,
    numerics_of,
    reference_shots,
)
from warpimpact.runs.computer import Computer, computer
from warpimpact.runs.describe import described, pilot_in
from warpimpact.runs.progress import Follow, RunProgress, Watch, followed
from warpimpact.scene import Numerics
from warpimpact.solver.accuracy import PilotResult
from warpimpact.solver.limit import PASSAGES, LimitSpec
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import at_level
from warpimpact.solver.worker import NEVER, Cancel

SLOW, SLOW_BEFORE = 1.0, 5.0
"""Seconds of a core above which the cost is announced: of a hit, and of what comes before the first hit."""
LARGE = 2**30
"""Bytes of the windows of a hit above which they are announced. Each thread has its own."""
CUDA_SHOTS = 2**17
"""Shots per task on a GPU. Fewer shots would not fill it."""
CPU_SHOTS, CPU_SECONDS = 2**14, 0.5
"""Most shots of a task on the CPU of this machine, and the time that it shall take, beside which its set-up on one core
is short. A task is at least one chunk; another process computes one chunk per task."""
REFERENCE_HITS, REFERENCE_LIMITS = 2**12, 256
"""Most hits, and most limits, of a reference."""


class Costly(UserWarning):
    """A computation that takes far longer than usual."""


def run(
    campaign: Campaign | str | Path,
    *,
    references: bool = False,
    device: str = "auto",
    progress: Follow | None = None,
    cancel: Cancel = NEVER,
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
    progress: Follow | None = None,
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
    path, size, sampler = None if output is None else Path(output), extent(len(campaign.sampler())), campaign.sampler()
    compute = compute_hits if limit is None else partial(compute_limits, limit)
    with (
        computer(device, workers=workers, scheduler=scheduler, cancel=cancel, warn=warn) as computing,
        open_chunks(
            path, manifest(campaign, computing.made_by, limit), resume=resume, overwrite=overwrite, warn=warn
        ) as chunks,
        followed(progress) as follow,
    ):
        if chunks is None:
            return None
        watch = Watch(campaign, chunks, size, () if limit is None else (f"mean({LIMITS[limit.quantity].value})",))
        check_cost = cost_warning(campaign, computing.made_by[attr.DEVICE], 1 if limit is None else PASSAGES)

        def piloting(levels: list[int]) -> None:
            for level in levels:
                check_cost(at_level(level, campaign.numerics))
            follow(RunProgress(0, len(sampler), piloting=True, level=next(iter(levels), None)))

        if (first := chunks.load(0)) is not None:
            pilot = pilot_in(first)
        else:
            pilot = computing.call(find_resolution, campaign, limit, tick=piloting)
        numerics = numerics_of(campaign, pilot)
        check_cost(numerics)

        def tasks() -> Iterator[tuple[range, tuple[Any, ...]]]:
            for task in _ranges(chunks, watch, lambda: _task_size(computing, campaign, watch) // size):
                yield task, (campaign, numerics, sampler.shots(task.start * size, len(task) * size), task.start * size)

        follow(watch.progress(pilot))
        results = computing.map(compute, tasks(), lambda done: follow(watch.progress(pilot, sum(done))))
        with closing(results):
            while not watch.ended:
                task, dataset = next(results)
                for number, chunk in _split(dataset, task, size):
                    if number == 0:
                        chunk = described(chunk, campaign, numerics_of(campaign, pilot, limit), pilot, limit)
                    chunks.save(number, chunk)
                    watch.add(number, chunk)
                follow(watch.progress(pilot))
        if references is None:
            references = path is not None and campaign.output.solid_reference
        of_references = _references(campaign, limit, pilot, computing) if references else {}
        return _finished(chunks, watch, of_references, path)


def _ranges(chunks: Chunks, watch: Watch, most: Callable[[], int]) -> Iterator[range]:
    """Ranges of missing chunks. Each has about as many as `most` returns when the range begins."""
    there, first = chunks.numbers, 0
    while first < watch.count:
        stop, last = first, min(first + max(1, most()), watch.count)
        while stop < last and stop not in there:
            stop += 1
        if stop > first:
            yield range(first, stop)
        first = max(stop, first + 1)


def _task_size(computing: Computer, campaign: Campaign, watch: Watch) -> int:
    """Shots per task, at the rate so far; 0 stands for one chunk."""
    if computing.made_by[attr.DEVICE] != "cpu":
        return CUDA_SHOTS
    if computing.is_remote or campaign.stop is not None or not watch.time:
        return 0
    return min(CPU_SHOTS, int(CPU_SECONDS * watch.hits / watch.time))


def _split(dataset: xarray.Dataset, task: range, size: int) -> Iterator[tuple[int, xarray.Dataset]]:
    """The chunks of a task, each with its share of the time."""
    for place, number in enumerate(task):
        chunk = dataset.isel(hit=slice(place * size, (place + 1) * size))
        share = chunk.sizes["hit"] / dataset.sizes["hit"]
        yield number, chunk.assign_attrs({attr.COMPUTE_TIME: dataset.attrs[attr.COMPUTE_TIME] * share})


def _references(
    campaign: Campaign, limit: LimitSpec | None, pilot: PilotResult | None, computing: Computer
) -> dict[str, xarray.Dataset]:
    """Some hits of the references of a campaign, by their names, at the resolution of the campaign."""
    pilot = None if pilot is None else replace(pilot, finer=None, numbers=None)
    datasets = dict[str, xarray.Dataset]()
    for name, reference in campaign.references.items():
        compute, searched, most = compute_hits, limit, REFERENCE_HITS
        if limit is not None:
            if (searched := limit_of_reference(limit, campaign, name)) is None:
                continue
            compute, most = partial(compute_limits, searched), REFERENCE_LIMITS
        shots = reference_shots(reference, most)
        dataset = computing.call(compute, reference, numerics_of(reference, pilot), shots, 0)
        datasets[name] = described(dataset, reference, numerics_of(reference, pilot, searched), pilot, searched)
    return datasets


def _finished(
    chunks: Chunks, watch: Watch, references: dict[str, xarray.Dataset], path: Path | None
) -> xarray.Dataset | None:
    """Join the chunks into the result: a file, or in memory."""
    every = (chunk for number in range(watch.count) if (chunk := chunks.load(number)) is not None)
    attributes = attr.with_units({attr.COMPUTE_TIME: watch.time, attr.HITS_PER_SECOND: watch.hits / watch.time})
    attributes |= watch.stop
    if path is not None:
        attributes[attr.FINGERPRINT] = chunks.fingerprint
        files.call_in_thread(files.write_joined, every, path, attributes=attributes, references=references)
        return None
    return with_references(joined(every).assign_attrs(attributes), references)


def cost_warning(campaign: Campaign, device: str, passages: int = 1) -> Callable[[Numerics], None]:
    """Return a function that warns (`Costly`), once for each numerics, of hits that are slow on a CPU. It raises what
    `prepare` does: TooManySteps, MemoryError."""

    @cache
    def check(numerics: Numerics) -> None:
        if device == "cpu" and (sentence := estimate_cost(campaign, numerics, passages)) is not None:
            warnings.warn(sentence, Costly, stacklevel=2)

    return check


def estimate_cost(campaign: Campaign, numerics: Numerics, passages: int = 1) -> str | None:
    """A sentence about the cost of hits on a CPU, with numerics that fix the resolution; None where it is low. An
    unhindered first hit of the campaign stands for all."""
    sampler = campaign.sampler()
    with model_errors():
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
