"""From shots of a campaign to a Dataset: how every hit ends, or its limit. These are the tasks of a run."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import resistance_by_thickness
from warpimpact.campaign.text import CampaignError
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import to_dataset
from warpimpact.runs.chunks import digest
from warpimpact.scene import Numerics, Shots
from warpimpact.solver.accuracy import PILOT_LIMITS, PilotResult, pilot_size
from warpimpact.solver.device import find_device
from warpimpact.solver.limit import LimitSpec, limits, pilot_of_limits, short_steps, thickest
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import TooManySteps
from warpimpact.solver.simulate import marched, pilot_of, spread_places
from warpimpact.solver.worker import Worker

Report = Callable[[int], None]
FEWEST, MOST, CHUNKS = 2**11, 2**16, 32
"""Fewest and most shots per chunk, and the number of chunks within these bounds. A chunk costs some 30 ms."""


def extent(count: int) -> int:
    """Shots per chunk of a campaign of `count` shots: a power of two. It depends on the campaign alone."""
    return min(MOST, max(FEWEST, 1 << (count // CHUNKS).bit_length()))


def manifest(campaign: Campaign, made_by: dict[str, str], limit: LimitSpec | None = None) -> dict[str, Any]:
    """What determines every bit of a result: the campaign with the contents of its files, the limit that is searched,
    versions and kind of device."""
    content = json.loads(json.dumps(campaign.model_dump(), default=digest))
    searched = {}
    if limit is not None:
        of_layer = f" of layer {limit.layer}" if limit.layer else ""
        curve = ", with the resistance of each thickness" if limit.by_thickness else ""
        searched["limit"] = f"{limit.quantity}{of_layer} within {limit.tolerance:g}, at most {limit.highest:g}{curve}"
    sizes = {"replicates": campaign.replicates, "extent": extent(len(campaign.sampler()))}
    return {"campaign": content, **sizes, **made_by, **searched}


@contextmanager
def model_errors() -> Iterator[None]:
    """Raise as CampaignError what the model cannot compute."""
    try:
        yield
    except TooManySteps:
        raise
    except ValueError as error:
        raise error if isinstance(error, CampaignError) else CampaignError(str(error)) from None


def compute_hits(
    campaign: Campaign,
    numerics: Numerics,
    shots: Shots,
    first: int,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """How shots of a campaign end; `first` is the number of the first one. Reports how many are done."""
    begin = time.perf_counter()
    with model_errors():
        memory = Memory(prepare(campaign.scene, shots, numerics), find_device(worker.device), worker.cancel)
    building = memory.build()
    outcomes = marched(memory, worker, lambda done, total: report(done))
    elapsed = time.perf_counter() - begin - building
    return dataset_of_shots(campaign, shots, outcomes, np.arange(first, first + len(shots)), worker, elapsed)


def compute_limits(
    limit: LimitSpec,
    campaign: Campaign,
    numerics: Numerics,
    shots: Shots,
    first: int,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """The limits of shots of a campaign, with the shots as they just perforate."""
    begin = time.perf_counter()
    with model_errors():
        searched = limits(campaign.scene, shots, limit, numerics, worker, lambda done, total: report(done))
    elapsed = time.perf_counter() - begin
    tried = searched.shots.velocity
    if limit.quantity == "thickness":
        tried = searched.shots.layer_value(campaign.target, "thickness", limit.layer)
    at_limit = limit.with_trial(campaign.target, shots, tried)
    outcomes, numbers = searched.recorded(limit.quantity), np.arange(first, first + len(shots))
    return dataset_of_shots(campaign, at_limit, outcomes, numbers, worker, elapsed)


def dataset_of_shots(
    campaign: Campaign,
    shots: Shots,
    outcomes: Outcomes,
    numbers: NDArray[np.int64],
    worker: Worker,
    seconds: float,
    *,
    double: bool = False,
) -> xarray.Dataset:
    """The Dataset of computed shots of a campaign, with attributes on who computed them in how many seconds."""
    device = find_device(worker.device)
    return to_dataset(
        campaign.scene,
        shots,
        outcomes,
        period=campaign.sampler().cell,
        numbers=numbers,
        double=double or campaign.numerics.precision == "double",
        left_out=() if campaign.output.exit_state else v.EXIT_VARIABLES,
        attributes={
            **attr.versions(),
            **attr.machine(),
            attr.DEVICE: f"{device.alias} ({device.name})",
            attr.COMPUTE_TIME: seconds,
        },
    )


def find_resolution(
    campaign: Campaign, limit: LimitSpec | None, *, worker: Worker, report: Report = lambda level: None
) -> PilotResult | None:
    """The result of a pilot with hits of the campaign; None if the campaign fixes the resolution.

    Reports every level that it computes.
    """
    numerics = campaign.numerics
    if numerics.explicit is not None:
        return None
    with model_errors():
        if limit is None:
            shots, numbers = pilot_shots(campaign, pilot_size(numerics.required))
            pilot = pilot_of(campaign.scene, shots, numerics, worker, report)
        else:
            shots, numbers = pilot_shots(campaign, pilot_size(numerics.required, PILOT_LIMITS))
            pilot = pilot_of_limits(campaign.scene, shots, limit, numerics, worker, report)
    return replace(pilot, numbers=numbers)


def pilot_shots(campaign: Campaign, most: int) -> tuple[Shots, NDArray[np.int64]]:
    """At most so many hits that stand for all hits of a campaign, and their numbers.

    They depend on the campaign alone: the first ones of a Sobol or random sampling, or ones at even distances of a grid
    or list.
    """
    sampler = campaign.sampler()
    count = min(most, len(sampler))
    if campaign.hits.sampling in ("sobol", "random"):
        return sampler.shots(0, count), np.arange(count)
    places = spread_places(len(sampler), count)
    return Shots.joined([sampler.shots(int(place), 1) for place in places]), places


def numerics_of(campaign: Campaign, pilot: PilotResult | None, limit: LimitSpec | None = None) -> Numerics:
    """The numerics of the hits: those of the campaign, or what its pilot found; shorter steps for limits."""
    numerics = campaign.numerics if pilot is None else pilot.numerics
    return numerics if limit is None else short_steps(numerics)


def limit_of_reference(limit: LimitSpec, campaign: Campaign, name: str) -> LimitSpec | None:
    """The limit that is searched for a reference of the campaign; None if it has none.

    The thickness of a layer in front of the base is none of the base alone.
    """
    if name == "base_alone":
        has_limit = limit.quantity == "velocity" or limit.layer == len(campaign.layer)
        return replace(limit, layer=0) if has_limit else None
    if limit.quantity == "velocity":
        return limit
    solid = campaign.references[name]
    highest = thickest(solid.scene, limit.layer)
    return replace(limit, highest=highest, by_thickness=resistance_by_thickness(solid, limit.layer, highest))


def reference_shots(reference: Campaign, most: int) -> Shots:
    """The first shots of a reference. One stands for all where the first ones differ only in their places, and all
    layers are solid and unbounded."""
    shots = reference.sampler().shots(0, extent(len(reference.sampler())))
    elsewhere = (v.HIT_Y, v.HIT_Z, "offset_y", "offset_z")
    conditions = [values for name, values in shots.columns.items() if name not in elsewhere]
    unbounded = all(layer == layer.solid and layer.size is None for layer in reference.target.layers)
    alike = unbounded and not any(np.nan_to_num(np.ptp(values, axis=0)).any() for values in conditions)
    return shots[: 1 if alike else max(1, most)]
