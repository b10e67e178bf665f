"""Hits by finite elements, of a campaign or of a result, written to a result file as others are."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.continuum.simulate import MOST, check_continuum, check_cost, simulate_elements
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.results.references import with_references
from warpimpact.runs.chunks import open_chunks
from warpimpact.runs.compute import dataset_of_shots, manifest
from warpimpact.runs.computer import Computer, computer
from warpimpact.runs.describe import campaign_attributes
from warpimpact.scene import Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver.device import cores, find_device
from warpimpact.solver.worker import Worker


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
    elements, sampler = campaign.continuum, campaign.sampler()
    continuum, numbers = elements.solver, np.array(range(len(sampler)) if hits is None else hits)
    check_continuum(campaign.scene, sampler.shots(0, 1), continuum)
    with computer(device, workers=workers, scheduler=scheduler) as computing:
        content = manifest(campaign, computing.made_by) | {
            "continuum": json.loads(continuum.model_dump_json()),
            "numbers": hits and list(hits),
        }
        together = 1 if computing.made_by[attr.DEVICE] == "cpu" else MOST
        if together == 1:
            some = Shots.joined([sampler.shots(int(k), 1) for k in numbers[:: max(1, len(numbers) // 16)]])
            if announcement := check_cost(campaign.scene, some, continuum, min(cores(), len(numbers))):
                warn(announcement)
        count = -(-len(numbers) // together)
        solid = campaign.references.get("solid") if campaign.output.solid_reference else None
        with open_chunks(output, content, resume=resume, overwrite=overwrite, warn=warn) as chunks:
            if chunks is None:
                return
            done = resumed = sum(min(together, len(numbers) - k * together) for k in chunks.numbers if k < count)

            def tasks() -> Iterator[tuple[int, tuple[Any, ...]]]:
                for number in range(count):
                    if number not in chunks.numbers:
                        yield number, (campaign, numbers[number * together : (number + 1) * together], continuum)
                if solid is not None and count not in chunks.numbers:
                    yield count, (solid, numbers[:1], continuum)

            def tick(shares: list[float]) -> None:
                progress(min(done + int(sum(shares) * together), len(numbers)), resumed, len(numbers))

            tick([])
            for number, dataset in computing.map(compute_elements, tasks(), tick, per_core=True):
                chunks.save(number, dataset)
                done += dataset.sizes["hit"] if number < count else 0
                tick([])
            datasets = [chunk for number in range(count) if (chunk := chunks.load(number)) is not None]
            references = {} if (reference := chunks.load(count)) is None else {"solid": reference}
            seconds = float(sum(dataset.attrs[attr.COMPUTE_TIME] for dataset in datasets))
            settings = {"materials": [entry.name for entry in elements.entries], **content["continuum"]}
            attributes = {
                attr.CONTINUUM: json.dumps(settings),
                attr.NUMERICS: elements.words,
                attr.PRECISION: "single",
                attr.CATALOGUE_NAMES: "\n".join(f"{entry.name}: {entry.evidence}" for entry in elements.entries),
                attr.COMPUTE_TIME: seconds,
                attr.HITS_PER_SECOND: len(numbers) / seconds,
                attr.FINGERPRINT: chunks.fingerprint,
            }
            result, *others = (
                dataset.assign_attrs(attr.with_units(campaign_attributes(of) | attributes))
                for dataset, of in ((joined(datasets), campaign), *((one, solid) for one in references.values()))
                if of is not None
            )
            files.write(with_references(result, dict(zip(references, others, strict=True))), output)


def compute_elements(
    campaign: Campaign,
    numbers: NDArray[np.int64],
    continuum: Continuum,
    *,
    worker: Worker,
    report: Callable[[float], None],
) -> xarray.Dataset:
    """Some hits of a campaign by their numbers, by one core or by a GPU. Reports the share that is done."""
    clock = time.thread_time if find_device(worker.device).is_cpu else time.perf_counter
    shots = Shots.joined([campaign.sampler().shots(int(number), 1) for number in numbers])
    begin = clock()
    outcomes = simulate_elements(
        campaign.scene, shots, continuum, replace(worker, threads=1), lambda done, total: report(done / total)
    )
    return dataset_of_shots(campaign, shots, outcomes, numbers, worker, clock() - begin, double=True)
