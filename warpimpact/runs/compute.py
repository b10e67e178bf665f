"""From shots of a campaign to a Dataset: how every hit ends, or its limit. These are the tasks of a run."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import (
    catalogue_names,
    limit_velocity_deviation,
    limit_velocity_factors,
    outside_tested_range,
    resistance_by_thickness,
    scene_words,
)
from warpimpact.campaign.inputs import ELEMENT_TABLES, inputs_of
from warpimpact.campaign.text import as_campaign_error
from warpimpact.errors import CampaignError
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.dataset import stored_columns, to_dataset
from warpimpact.scene import Shots, exclusions
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.accuracy import PILOT_LIMITS, UNITS, pilot_of, pilot_size, spread_places
from warpimpact.solver.device import Worker, find_device
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import PASSAGES, LimitSpec, check_arrests, limits, pilot_of_limits, short_steps
from warpimpact.solver.method import Method
from warpimpact.solver.prepare import prepare

Report = Callable[[int], None]
FEWEST, MOST, CHUNKS, LOOKS = 2**11, 2**16, 8, 32
"""Fewest and most hits of a block, and the number of blocks within these bounds, without and with a stop rule, which
looks after a block."""
CHUNK_SECONDS = 1.0
"""Longest time that a core may take for a chunk, as `Computation.cost` foresees it, within a factor of two. A chunk
costs 10 to 15 ms beside its hits."""
GPU_CHUNK = 2**17
"""Hits per chunk on a GPU, which fewer would not fill."""
PILOT_ATTRIBUTES = (attr.RESOLUTION, attr.TOLERANCE_MET, attr.ACCURACY, *UNITS, *(f"{name}_units" for name in UNITS))
"""Attributes that a pilot gives a result."""


def block_size(campaign: Campaign) -> int:
    """Hits between two looks of a stop rule, which are the most in a chunk on a CPU, and those of a reference."""
    hits = len(campaign.sampler()) // (CHUNKS if campaign.stop is None else LOOKS)
    return min(MOST, max(FEWEST, 1 << hits.bit_length()))


def chunk_size(campaign: Campaign, method: Method, device: str, *, limited: bool = False) -> int:
    """Hits per chunk at a resolution on this kind of device: a power of two that divides a block.

    It depends on the campaign alone, so that a run can be resumed on another machine.
    """
    if device != "cpu":
        return GPU_CHUNK
    with as_campaign_error():
        seconds = method.prepare(campaign.scene, campaign.sampler().shots(0, 1), Worker(device)).cost.seconds
    hits = CHUNK_SECONDS / (seconds * (PASSAGES if limited else 1))
    return min(block_size(campaign), 1 << max(0, int(hits).bit_length() - 1))


def manifest(campaign: Campaign, limit: LimitSpec | None = None) -> dict[str, Any]:
    """What determines every bit of a map, beside versions and kind of device: the campaign with the contents of its
    files, but for how finite elements compute it, and the limit that is searched."""
    searched = {} if limit is None else {"limit": asdict(limit)}
    return {
        "campaign": {name: value for name, value in inputs_of(campaign).items() if name not in ELEMENT_TABLES},
        "replicates": campaign.hits.scramblings,
        "chunk": (block_size(campaign), CHUNK_SECONDS),
        **searched,
    }


def compute_hits(
    campaign: Campaign,
    numbers: NDArray[np.int64],
    method: Method,
    limit: LimitSpec | None = None,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """How hits of a campaign end by a method, or their limits by the fast law with the shots as they just pass.

    Args:
        numbers: of the hits in the campaign, ascending.
        method: with a resolution, so that all hits have the same.
        report: called with the number of hits that are done.
    """
    alone = worker.threads == 1 and find_device(worker.device).is_cpu
    clock = time.thread_time if alone else time.perf_counter
    scene, shots, begin = campaign.scene, shots_of(campaign, numbers), clock()

    def progress(done: int, total: int) -> None:
        report(done)

    with as_campaign_error():
        if limit is None:
            computation = method.prepare(scene, shots, worker)
            prepared = clock()
            computation.build()
            begin += clock() - prepared  # compiling counts in no time of a hit
            outcomes, double = computation.compute(progress), computation.is_double
        else:
            assert isinstance(method, FastLaw)
            ended = limits(scene, shots, limit, method, worker, progress)
            shots, outcomes, double = ended.shots, ended.recorded(limit.quantity), method.precision == "double"
    return dataset_of_shots(campaign, shots, outcomes, numbers, worker, clock() - begin, double=double)


def shots_of(campaign: Campaign, numbers: NDArray[np.int64]) -> Shots:
    """Shots of a campaign by their numbers, ascending."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    first, *later = (campaign.sampler().shots(int(run[0]), len(run)) for run in runs)
    return Shots.joined([first, *later]) if later else first


def some_shots(campaign: Campaign, most: int) -> tuple[NDArray[np.int64], Shots]:
    """The first shots of a campaign with their numbers; of a grid or a list, shots at even distances."""
    sampler = campaign.sampler()
    count = min(most, len(sampler))
    is_even = campaign.hits.sampling in ("sobol", "random")
    numbers = np.arange(count) if is_even else spread_places(len(sampler), count)
    return numbers, sampler.shots(0, int(numbers.max()) + 1)[numbers]


def dataset_of_shots(
    campaign: Campaign,
    shots: Shots,
    outcomes: Outcomes,
    numbers: NDArray[np.int64],
    worker: Worker,
    seconds: float,
    *,
    double: bool,
) -> xarray.Dataset:
    """The Dataset of computed shots of a campaign, with attributes on who computed them in how many seconds."""
    device = find_device(worker.device)
    return to_dataset(
        campaign.scene,
        shots,
        outcomes,
        period=campaign.sampler().cell,
        numbers=numbers,
        double=double,
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
) -> xarray.Dataset:
    """What a pilot says: resolution and errors as attributes, hits at a finer level as variables. It is empty if the
    campaign fixes the resolution. Reports every level that it computes."""
    numerics = campaign.numerics
    if numerics.explicit is not None:
        return xarray.Dataset()
    most = pilot_size(numerics.required, *(() if limit is None else (PILOT_LIMITS,)))
    numbers, shots = some_shots(campaign, most)
    with as_campaign_error():
        if limit is None:
            pilot = pilot_of(campaign.scene, shots, numerics, worker, report)
        else:
            pilot = pilot_of_limits(campaign.scene, shots, limit, numerics, worker, report)
    bounds = dict(numerics.required_at(len(campaign.target.layers)))
    attributes = {
        attr.RESOLUTION: numerics.at_level(pilot.level).model_dump_json(),
        attr.TOLERANCE_MET: int(pilot.kept),
        attr.ACCURACY: json.dumps({name: of for name, of in bounds.items() if of is not None and math.isfinite(of)}),
        **pilot.errors,
    }
    finer: dict[str, Any] = {v.HIT: numbers.astype("int32"), v.STANDOFF: np.array(campaign.output.standoffs)}
    finer |= {} if pilot.finer is None else vars(pilot.finer)
    single = () if numerics.precision == "double" else v.computed_variables()
    columns = stored_columns((name for name in (v.HIT, v.STANDOFF, *v.LEVEL_VARIABLES) if name in finer), finer, single)
    return xarray.Dataset(columns, attrs=attr.with_units(attributes))


def numerics_of(campaign: Campaign, pilot: xarray.Dataset, *, limited: bool) -> FastLaw:
    """The numerics of the hits: those of the campaign, or what its pilot found; shorter steps for limits. `pilot` is of
    `find_resolution`, or a result with its attributes."""
    stored = pilot.attrs.get(attr.RESOLUTION)
    numerics = campaign.numerics if stored is None else FastLaw.model_validate_json(stored)
    return short_steps(numerics) if limited else numerics


def limit_of(
    campaign: Campaign, quantity: str = "velocity", tolerance: float | None = None, layer: int = 0
) -> LimitSpec:
    """The limit of a campaign, which `run_to_file` then searches.

    Args:
        quantity: "velocity" or "thickness".
        tolerance: of the limit [m/s] or [m], or the default one.
        layer: number of the layer whose thickness is searched; 0 is the plate.

    Raises:
        CampaignError: the campaign has no limits, or this search cannot find them.
    """
    with as_campaign_error():
        stop = {exclusions.STOP: campaign.stop is not None}
        exclusions.check_together({exclusions.LIMIT_COMMAND: True} | stop)
        check_arrests(campaign.scene, campaign.sampler().shots(0, 1))
    plates = campaign.target.layers
    if quantity == "thickness" and layer >= len(plates):
        raise CampaignError(f"got layer {layer}, but the target has layers 0 (the plate) to {len(plates) - 1}")
    return limit_spec(campaign, quantity, layer, tolerance)


def limit_spec(campaign: Campaign, quantity: str, layer: int = 0, tolerance: float | None = None) -> LimitSpec:
    """The limit of a campaign, of its velocity or of the thickness of a layer, whose Y follows the catalogue."""
    spec = LimitSpec.of(campaign.scene, quantity, layer, tolerance)
    if quantity == "velocity":
        return spec
    return replace(spec, by_thickness=resistance_by_thickness(campaign, layer, spec.highest))


def limit_of_reference(limit: LimitSpec | None, campaign: Campaign, name: str) -> LimitSpec | None:
    """The limit that is searched for a reference of the campaign; None if it has none: the thickness of a layer in
    front of the base is none of the base alone."""
    if limit is None or limit.quantity == "velocity":
        return limit
    if name == "base_alone":
        return replace(limit, layer=0) if limit.layer == len(campaign.layer) else None
    return limit_spec(campaign.references[name], limit.quantity, limit.layer, limit.tolerance)


def reference_shots(reference: Campaign, most: int) -> Shots:
    """The first shots of a reference. One stands for all where the first ones differ only in their places, and all
    layers are solid and unbounded."""
    shots = reference.sampler().shots(0, min(most, block_size(reference)))
    places = (v.HIT_Y, v.HIT_Z, "offset_y", "offset_z")
    alike = all(layer == layer.solid and layer.size is None for layer in reference.target.layers) and not any(
        np.nan_to_num(np.ptp(values, axis=0)).any() for name, values in shots.columns.items() if name not in places
    )
    return shots[:1] if alike else shots


def described(
    dataset: xarray.Dataset, campaign: Campaign, pilot: xarray.Dataset, limit: LimitSpec | None = None
) -> xarray.Dataset:
    """The first hits of a result with the attributes of the whole; `pilot` as in `numerics_of`."""
    numerics, used = campaign.numerics, numerics_of(campaign, pilot, limited=limit is not None)
    prepared = prepare(campaign.scene, campaign.sampler().shots(0, 1), used)
    resolution = prepared.resolution
    requested = "given resolution" if numerics.level is None else f"level {numerics.level}"
    if numerics.explicit is None:
        of_answer = limit is None and numerics.required_at(len(campaign.target.layers)).bounds_answer
        requested = "tolerance of the answer" if of_answer else f"{numerics.fidelity} fidelity"
        requested = requested if numerics.accuracy is None else "accuracy in numbers"
    precision = "double" if resolution.double else "single"
    attributes = {
        attr.NUMERICS: f"{requested}, {numerics.scheme} scheme, "
        f"time_step {float(prepared.conditions['time_step'].min()):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {precision}",
        attr.NUMERICS_GIVEN: json.dumps(dict(numerics), default=lambda accuracy: accuracy.model_dump()),
        attr.PRECISION: precision,
        attr.OUTSIDE_TESTED_RANGE: json.dumps(outside_tested_range(campaign), ensure_ascii=False),
        **({} if limit is None else _limit_attributes(campaign, limit)),
    }
    of_pilot = {name: pilot.attrs[name] for name in PILOT_ATTRIBUTES if name in pilot.attrs}
    return with_campaign(dataset, campaign, attributes).assign_attrs(of_pilot)


def _limit_attributes(campaign: Campaign, limit: LimitSpec) -> dict[str, Any]:
    """Attributes on the limits that were searched."""
    attributes = {
        attr.HISTORY: attr.history_line(f"limit --quantity {limit.quantity}"),
        attr.LIMIT: limit.quantity,
        attr.LIMIT_LAYER: limit.layer,
        attr.LIMIT_TOLERANCE: limit.tolerance,
        attr.LIMIT_HIGHEST: limit.highest,
    }
    if limit.quantity == "thickness":  # from it follows the areal density of the target
        layer = campaign.target.layers[limit.layer]
        attributes[attr.LIMIT_DENSITY] = layer.areal_density / layer.thickness
        attributes[attr.LIMIT_ELSEWHERE] = campaign.target.areal_density - layer.areal_density
        return attributes
    if (factors := limit_velocity_factors(campaign)) is not None:
        attributes[attr.LIMIT_FACTORS] = list(factors)
    if (deviation := limit_velocity_deviation(campaign)) is not None:
        attributes[attr.LIMIT_DEVIATION] = deviation
    return attributes


def with_campaign(dataset: xarray.Dataset, campaign: Campaign, attributes: dict[str, Any]) -> xarray.Dataset:
    """A result with attributes and those of its campaign, and with distributions of what scatters."""
    plate = campaign.plate
    of_campaign = {
        attr.TITLE: campaign.title,
        attr.HISTORY: attr.history_line("run"),
        attr.CAMPAIGN: campaign.text,
        attr.INPUTS: json.dumps(inputs_of(campaign)),
        attr.SCENE: scene_words(campaign),
        attr.CATALOGUE_NAMES: "\n".join(catalogue_names(campaign)) or None,
        attr.SAMPLING: campaign.hits.sampling,
        attr.SEED: campaign.hits.seed,
        attr.COUNT: campaign.hits.count,
        attr.REPLICATES: campaign.hits.scramblings,
        attr.SYMMETRIES: "; ".join(map(str, campaign.symmetries)) if campaign.hits.irreducible else None,
        attr.STANDOFF_POINT: campaign.output.standoff_point,
        attr.OPEN_AREA: plate.open_area,
        attr.LIGAMENT: plate.ligament if math.isfinite(plate.ligament) else None,
        attr.AREAL_DENSITY: campaign.target.areal_density,
        attr.ADD_ON_DENSITY: campaign.target.weights["add-on"] if campaign.layer else None,
        attr.FAILED_SHARE: campaign.output.failed_share,
    }
    known = {name: value for name, value in of_campaign.items() if value is not None}
    result = dataset.assign_attrs(attr.with_units(known | attributes))
    for (name, layer), of in campaign.scatter.given.items():
        column = f"layer_{name}" if layer else QUANTITIES[name].column or name
        fields = of.model_dump(exclude={"distribution"}).items()
        words = ", ".join(f"{key} = {f'{value:g}' if isinstance(value, float) else value}" for key, value in fields)
        place = f"layer {layer}: " if layer else ""
        before = result[column].attrs.get("distribution")
        text = f"{place}{of.distribution}, {words} (SI, radians)"
        result[column].attrs["distribution"] = f"{before}; {text}" if before else text
    return result
