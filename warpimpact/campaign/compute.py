"""The one place where shots of a campaign become a Dataset, on whatever machine."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import solid_dataset, to_dataset
from warpimpact.scene import Numerics, Scene, Shots, Symmetry
from warpimpact.scene.scatter import QUANTITIES
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.refinement import LADDER, Estimates, simulate_to_tolerance
from warpimpact.solver.resolution import resolve
from warpimpact.solver.simulate import Outcomes, build, simulate
from warpimpact.solver.unfold import unfolded, unfolded_estimates


def compute(
    campaign: Campaign,
    shots: Shots,
    *,
    solid: Shots | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Compute some shots of a campaign; where it asks for symmetry, the first of each hit's images for all of them.

    Args:
        shots: whole groups of images, as the campaign's sampler gives them.
        solid: shots at the solid plate of equal areal density, too; None are none.
        device, threads, progress: as in `simulate`.

    Returns:
        The Dataset of results/dataset.py, one entry per shot: a result of its own.

    Raises:
        DeviceError: the device is absent.
    """
    scene, group = campaign.scene, campaign.symmetries
    computed = shots[:: len(group)]
    follow = progress and (lambda done, total: progress(done * len(group), total * len(group)))
    _build(campaign, computed, device)
    begin = time.perf_counter()
    outcomes, estimates = _outcomes(scene, computed, campaign.numerics, device, threads, follow)
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
            attr.AREAL_DENSITY: campaign.plate.areal_density,
            attr.CORE: campaign.core.model_dump_json(),
            attr.IMPACT: _impact(campaign),
            attr.MATERIAL: _material(campaign),
            attr.NUMERICS: _numerics(campaign, shots),
            attr.NUMERICS_GIVEN: json.dumps(dict(campaign.numerics), default=lambda tolerance: tolerance.model_dump()),
            attr.FAILED_SHARE: campaign.output.failed_share,
            attr.COMPUTE_TIME: elapsed,
            attr.HITS_PER_SECOND: len(computed) / elapsed,
        }
        | ({} if campaign.hits.count is None else {attr.COUNT: campaign.hits.count})
        | ({attr.LIGAMENT: ligament} if math.isfinite(ligament) else {})
        | (_symmetry(group, len(computed)) if campaign.hits.irreducible else {}),
        estimates=None if estimates is None else unfolded_estimates(estimates, group),
    )
    if solid is None:
        return dataset
    thinner = campaign.plate.solid
    if solid.thickness is not None:
        solid = replace(solid, thickness=solid.thickness * (thinner.thickness / campaign.plate.thickness))
    reference = scene.model_copy(update={"target": thinner})
    return dataset.merge(solid_dataset(_outcomes(reference, solid, campaign.numerics, device, threads)[0]))


def _build(campaign: Campaign, shots: Shots, device: str) -> None:
    """Have the kernels ready, so that the time of computing is that alone."""
    numerics = campaign.numerics
    if numerics.tolerance is not None:
        numerics = Numerics(precision=numerics.precision)
    build(campaign.scene, shots, numerics=numerics, device=device)


def _outcomes(
    scene: Scene,
    shots: Shots,
    numerics: Numerics,
    device: str,
    threads: int | None,
    progress: Progress | None = None,
) -> tuple[Outcomes, Estimates | None]:
    """Outcomes, with estimates of their errors where the numerics have a tolerance."""
    if numerics.tolerance is None:
        return simulate(scene, shots, numerics=numerics, device=device, threads=threads, progress=progress), None
    return simulate_to_tolerance(scene, shots, numerics=numerics, device=device, threads=threads, progress=progress)


def _impact(campaign: Campaign) -> str:
    """How the core arrives, as JSON: of each quantity its value or its distribution, that of its mass included."""
    scatter = {name: given.model_dump() for name, given in campaign.scatter.given.items()}
    return json.dumps(
        dict(campaign.impact) | {name: given for name, given in scatter.items() if QUANTITIES[name].table != "plate"}
    )


def _material(campaign: Campaign) -> str:
    """What the plate resists with, as JSON: of its material, and of the law of its stress."""
    of_plate = campaign.plate.model_dump(exclude={"thickness", "size", "margin", "pattern"})
    return json.dumps(of_plate | campaign.interaction.model_dump())


def _symmetry(group: Sequence[Symmetry], computed: int) -> dict[str, Any]:
    """By which symmetries hits were unfolded, and how many were computed."""
    return {attr.SYMMETRIES: ", ".join(map(str, group)), attr.IMAGES: len(group), attr.COMPUTED_HITS: computed}


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: what decides the bits beside the campaign."""
    chosen = find_device(device)
    return {
        **attr.versions(),
        attr.DEVICE: "cpu" if chosen.is_cpu else chosen.name,
    }


def _numerics(campaign: Campaign, shots: Shots) -> str:
    """The numerics in force, every choice made, as one line."""
    tolerance = campaign.numerics.tolerance
    if tolerance is not None:
        return (
            f"tolerance of {tolerance.residual_velocity:g} m/s and {np.degrees(tolerance.tilt):g} deg, "
            f"at most {LADDER[-1].patches_axial} by {LADDER[-1].patches_around} patches"
        )
    resolution = resolve(campaign.numerics, campaign.scene, shots.columns)
    impact = campaign.impact
    return (
        f"{campaign.numerics.fidelity} fidelity, {campaign.numerics.scheme} scheme, "
        f"time_step {resolution.step_of(impact, campaign.plate):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {'double' if resolution.double else 'single'}"
    )
