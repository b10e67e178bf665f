"""Hits by finite elements, one job each, of a campaign or of a result, written to a result file as others are."""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.continuum.strikes import MOST, check_continuum, struck
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import stored_columns
from warpimpact.results.layers import in_memory
from warpimpact.results.references import with_references
from warpimpact.runs.describe import computed_by, described_as
from warpimpact.runs.executor import Executor, Job
from warpimpact.runs.questions import Arrays, Round, Store, results_of, stored
from warpimpact.runs.shards import manifest
from warpimpact.scene import Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver.device import find_device
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    import xarray

SECONDS = "seconds"
"""In the result of a job: what it took [s]."""


def continuum_to_file(
    campaign: Campaign,
    output: Path,
    *,
    hits: tuple[int, ...] | None = None,
    device: Executor,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int, int], object] = lambda done, resumed, total: None,
    tell: Callable[[str], object] = warnings.warn,
) -> None:
    """Compute hits of a campaign by finite elements, as its table [continuum] says, into a result file; each job is on
    the disk when it has ended.

    Args:
        hits: by their numbers in the campaign; None is all of them.
        progress: called with the hits that are done, how many of them an earlier call had computed, and all hits.

    Raises:
        ValueError: the continuum does not compute this campaign.
    """
    solver = campaign.continuum.solver
    content = manifest(campaign, device.made_by) | {
        "continuum": json.loads(solver.model_dump_json()),
        "numbers": hits and list(hits),
    }
    check_continuum(campaign.scene, campaign.sampler().shots(0, 1), solver)
    with stored(output, content, "continuum", resume=resume, overwrite=overwrite, tell=tell) as store:
        if store is None:
            return
        dataset = _computed(campaign, hits, device, store, progress)
        dataset.attrs[attr.FINGERPRINT] = store.parts.fingerprint
        files.write(dataset, output)


def _computed(
    campaign: Campaign,
    hits: tuple[int, ...] | None,
    executor: Executor,
    store: Store,
    progress: Callable[[int, int, int], object],
) -> xarray.Dataset:
    """The result of the hits of some numbers; None is all of them."""
    sampler, elements = campaign.sampler(), campaign.continuum
    continuum, numbers = elements.solver, range(len(sampler)) if hits is None else hits
    device = executor.made_by[attr.DEVICE]
    together = 1 if device == "cpu" else MOST
    shots = Shots.joined([sampler.shots(int(number), 1) for number in numbers])
    jobs = [(campaign.scene, shots[k : k + together], continuum) for k in range(0, len(shots), together)]
    solid = campaign.references.get("solid") if campaign.output.solid_reference else None
    if solid is not None:
        jobs.append((solid.scene, solid.sampler().shots(int(numbers[0]), 1), continuum))

    def report(*numbers: float) -> None:
        done, resumed = (min(int(number * together), len(shots)) for number in numbers)
        progress(done, resumed, len(shots))

    batch = Round([Job(_hits, arguments) for arguments in jobs], [_key(*arguments) for arguments in jobs], report)
    results = results_of(batch, executor, store)
    outcomes = [Outcomes(**{name: values for name, values in row.items() if name != SECONDS}) for row in results]
    elapsed = float(sum(float(row[SECONDS][0]) for row in results))
    told = computed_by(campaign, "cpu", len(shots), elapsed)
    told |= {} if device == "cpu" else {attr.DEVICE: device}
    told |= {
        attr.CONTINUUM: json.dumps(
            {"materials": [entry.name for entry in elements.entries], **json.loads(continuum.model_dump_json())}
        ),
        attr.NUMERICS: elements.words,
        attr.PRECISION: "single",
        attr.CATALOGUE_NAMES: "\n".join(f"{entry.name}: {entry.evidence}" for entry in elements.entries),
    }
    references = {}
    if solid is not None:
        table = described_as(solid, jobs[-1][1], outcomes.pop(), told, double=True)
        references["solid"] = in_memory(table.to_xarray())
    table = described_as(campaign, shots, Outcomes.joined(outcomes), told, double=True)
    if hits is not None:
        table = table.assign_coords(stored_columns((v.HIT,), {v.HIT: np.array(numbers, dtype=np.int32)}))
    return with_references(in_memory(table.to_xarray()), references)


def _key(scene: Scene, shots: Shots, continuum: Continuum) -> str:
    """What decides the result of a job."""
    told = scene.model_dump_json() + continuum.model_dump_json()
    columns = "".join(f"{name} {values.tolist()}" for name, values in shots.columns.items())
    return hashlib.sha256((told + columns).encode()).hexdigest()


def _hits(
    scene: Scene, shots: Shots, continuum: Continuum, *, worker: Worker, report: Callable[[float], object]
) -> Arrays:
    """The outcomes of some hits, by one core or by a GPU."""

    def progress(done: int, total: int) -> None:
        report(done / total)

    clock = time.thread_time if find_device(worker.device).is_cpu else time.perf_counter
    begin = clock()
    outcomes = struck(scene, shots, continuum, replace(worker, threads=1), progress)
    return {SECONDS: np.array([clock() - begin]), **vars(outcomes)}
