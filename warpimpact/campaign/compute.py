"""From shots of a campaign to a Dataset; every run, local or distributed, goes through here."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import solid_dataset, to_dataset
from warpimpact.scene import Burst, Numerics, Scene, Shots, Symmetry
from warpimpact.scene.scatter import QUANTITIES
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.promise import PILOT, Promise, keep
from warpimpact.solver.refinement import LEVELS, Estimates, simulate_to_tolerance
from warpimpact.solver.resolution import LADDER, Fidelity, resolve
from warpimpact.solver.simulate import Outcomes, build, simulate
from warpimpact.solver.unfold import unfolded, unfolded_estimates

_FEWEST_BURSTS = 8
"""Of a pilot, however many shots they have."""


def compute(
    campaign: Campaign,
    shots: Shots,
    *,
    promise: Promise | None = None,
    solid: Shots | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Compute some shots of a campaign. If it uses symmetry, only the first shot of each group of images is computed.

    Args:
        shots: whole groups of images, as the campaign's sampler gives them.
        promise: the finding of a pilot (`promise_of`); None to compute with the numerics as they are given.
        solid: shots at the solid plate of equal areal density; None for no such shots.
        device, threads, progress: as in `simulate`.

    Returns:
        The Dataset of results/dataset.py, one entry per shot; it is a complete result.

    Raises:
        DeviceError: the device is absent.
    """
    scene, group = campaign.scene, campaign.symmetries
    computed = shots[:: len(group)]
    follow = progress and (lambda done, total: progress(done * len(group), total * len(group)))
    numerics = campaign.numerics if promise is None else promise.fidelity
    _build(scene, computed, numerics, device)
    begin = time.perf_counter()
    outcomes, estimates = _outcomes(scene, computed, numerics, device, threads, follow)
    elapsed = time.perf_counter() - begin
    period, chosen = campaign.hits.covered(campaign.plate), find_device(device)
    ligament = campaign.plate.ligament
    dataset = to_dataset(
        scene,
        shots,
        unfolded(outcomes, group),
        period=period,
        attributes={
            attr.TITLE: campaign.title,
            attr.HISTORY: f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} warpimpact run",
            attr.CAMPAIGN: campaign.text,
            attr.CAMPAIGN_ANGLES: "degree",
            **attr.versions(),
            attr.DEVICE: f"{chosen.alias} ({chosen.name})",
            attr.SAMPLING: campaign.hits.sampling,
            attr.SEED: campaign.hits.seed,
            attr.REPLICATES: campaign.replicates,
            attr.STANDOFF_POINT: campaign.output.standoff_point,
            attr.OPEN_AREA: campaign.plate.open_area,
            attr.AREAL_DENSITY: campaign.target.areal_density,
            attr.CORE: campaign.core.model_dump_json(),
            attr.IMPACT: _impact(campaign),
            attr.MATERIAL: _material(campaign),
            attr.NUMERICS: _numerics(campaign, numerics, shots),
            attr.NUMERICS_GIVEN: json.dumps(dict(campaign.numerics), default=lambda tolerance: tolerance.model_dump()),
            attr.FAILED_SHARE: campaign.output.failed_share,
            attr.COMPUTE_TIME: elapsed,
            attr.HITS_PER_SECOND: len(computed) / elapsed,
        }
        | ({} if campaign.hits.count is None else {attr.COUNT: campaign.hits.count})
        | ({attr.LAYERS: _layers(campaign)} if campaign.layer else {})
        | ({attr.LIGAMENT: ligament} if math.isfinite(ligament) else {})
        | (_symmetry(group, len(computed)) if campaign.hits.irreducible else {})
        | ({} if promise is None else _promised(promise))
        | ({} if campaign.burst is None else _burst(campaign.burst)),
        estimates=None if estimates is None else unfolded_estimates(estimates, group),
    )
    if solid is None:
        return dataset
    solid, reference = _at_solid(campaign, solid), scene.model_copy(update={"target": campaign.target.solid})
    return dataset.merge(solid_dataset(_outcomes(reference, solid, numerics, device, threads)[0]))


def _at_solid(campaign: Campaign, shots: Shots) -> Shots:
    """Shots at the solid plate of equal areal density: it is as heavy as the target of each shot."""
    target, plate = campaign.target, campaign.plate
    own: dict[str, Any] = {name: None for name in shots.columns if name.startswith("layer_")}
    if shots.thickness is None and shots.layer_thickness is None:
        return replace(shots, **own)
    thickness = shots.own("thickness", plate.thickness) * (plate.solid.thickness / plate.thickness)
    for k, layer in enumerate(target.layers):
        share = layer.areal_density / layer.thickness / plate.density
        thickness = thickness + share * shots.own_of_layer("thickness", k, layer.thickness)
    return replace(shots, **own, thickness=np.broadcast_to(thickness, len(shots)).copy())


def promise_of(campaign: Campaign, device: str = "auto") -> Promise | None:
    """The promise that a pilot of the campaign's own hits finds; None if the campaign fixes the resolution itself.

    The pilot takes the first hits of a Sobol or random sampling. It takes hits at even distances from a grid or a list.
    So it depends on the campaign alone. It takes whole bursts, as a later hit meets what the earlier ones left.

    Raises:
        DeviceError: the device is absent.
    """
    if campaign.numerics.explicit is not None:
        return None
    sampler, images, at_a_plate = campaign.sampler(), len(campaign.symmetries), campaign.at_a_plate
    group = images * at_a_plate
    groups = len(sampler) // group
    count = min(max(-(-PILOT // at_a_plate), _FEWEST_BURSTS), groups)
    if campaign.hits.sampling in ("sobol", "random"):
        pilot = sampler.shots(0, count * group)
    else:
        places = np.linspace(0, groups, count, endpoint=False).astype(int)
        pilot = Shots.joined([sampler.shots(int(place) * group, group) for place in places])
    pilot = pilot[::images]
    return keep(campaign.scene, campaign.numerics, pilot, device=device)


def _promised(promise: Promise) -> dict[str, Any]:
    """What is told of a promise."""
    return {
        attr.RESOLUTION: json.dumps(asdict(promise.fidelity)),
        attr.PROMISE_KEPT: int(promise.kept),
        attr.RESIDUAL_VELOCITY_ERROR_P90: promise.residual_velocity_error,
        attr.TILT_ERROR_P90: math.degrees(promise.tilt_error),
    }


def promise_in(dataset: xarray.Dataset) -> Promise | None:
    """The promise that a result was computed with; None if its campaign fixed the resolution."""
    told = dataset.attrs
    if attr.RESOLUTION not in told:
        return None
    return Promise(
        fidelity=Fidelity(**json.loads(told[attr.RESOLUTION])),
        kept=bool(told[attr.PROMISE_KEPT]),
        residual_velocity_error=float(told[attr.RESIDUAL_VELOCITY_ERROR_P90]),
        tilt_error=math.radians(float(told[attr.TILT_ERROR_P90])),
    )


def _build(scene: Scene, shots: Shots, numerics: Numerics | Fidelity, device: str) -> None:
    """Build the kernels first, so that the measured time is that of computing alone."""
    if isinstance(numerics, Numerics) and numerics.tolerance is not None:
        numerics = Numerics(precision=numerics.precision)
    build(scene, shots, numerics=numerics, device=device)


def _outcomes(
    scene: Scene,
    shots: Shots,
    numerics: Numerics | Fidelity,
    device: str,
    threads: int | None,
    progress: Progress | None = None,
) -> tuple[Outcomes, Estimates | None]:
    """Outcomes, and estimates of their errors if the numerics have a tolerance."""
    if isinstance(numerics, Numerics) and numerics.tolerance is not None:
        return simulate_to_tolerance(scene, shots, numerics=numerics, device=device, threads=threads, progress=progress)
    return simulate(scene, shots, numerics=numerics, device=device, threads=threads, progress=progress), None


def _impact(campaign: Campaign) -> str:
    """Impact quantities as JSON, each with its value or its distribution, and the distribution of the core's mass."""
    scatter = {name: given.model_dump() for name, given in campaign.scatter.given.items()}
    return json.dumps(
        dict(campaign.impact) | {name: given for name, given in scatter.items() if QUANTITIES[name].table != "plate"}
    )


def _material(campaign: Campaign) -> str:
    """What the plate resists with, as JSON: of its material, and of the law of its stress."""
    of_plate = campaign.plate.model_dump(exclude={"thickness", "size", "margin", "pattern"})
    return json.dumps(of_plate | campaign.interaction.model_dump())


def _layers(campaign: Campaign) -> str:
    """What stands behind the plate, as JSON: each layer by its number, with what scatters in it."""
    layers = {str(k + 1): json.loads(layer.model_dump_json()) for k, layer in enumerate(campaign.layer)}
    for (name, k), given in campaign.scatter.of_layers.items():
        layers[str(k + 1)][name] = given.model_dump()
    return json.dumps(layers)


def _symmetry(group: Sequence[Symmetry], computed: int) -> dict[str, Any]:
    """Symmetries by which hits were unfolded, and the number of computed hits."""
    return {attr.SYMMETRIES: ", ".join(map(str, group)), attr.IMAGES: len(group), attr.COMPUTED_HITS: computed}


def _burst(burst: Burst) -> dict[str, Any]:
    """How many shots hit a plate, and how they lie."""
    return {attr.BURST: burst.model_dump_json(exclude_none=True), attr.SHOTS_AT_A_PLATE: burst.count}


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: with the campaign, they determine the bits of a result."""
    chosen = find_device(device)
    return {
        **attr.versions(),
        attr.DEVICE: "cpu" if chosen.is_cpu else chosen.name,
    }


def _numerics(campaign: Campaign, numerics: Numerics | Fidelity, shots: Shots) -> str:
    """The numerics in force, every choice made, as one line."""
    tolerance = campaign.numerics.tolerance
    if tolerance is not None:
        finest = LADDER[LEVELS[-1]]
        return (
            f"tolerance of {tolerance.residual_velocity:g} m/s and {np.degrees(tolerance.tilt):g} deg, "
            f"at most {finest.patches_axial} by {finest.patches_around} patches"
        )
    resolution = resolve(numerics, campaign.scene, shots.columns)
    impact = campaign.impact
    return (
        f"{campaign.numerics.fidelity} fidelity, {campaign.numerics.scheme} scheme, "
        f"time_step {resolution.step_in(impact, campaign.target):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {'double' if resolution.double else 'single'}"
    )
