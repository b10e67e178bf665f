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
import warp
import xarray

import warpimpact
from warpimpact.campaign.campaign import Campaign
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
        The Dataset of results.py, one entry per shot: a result of its own.

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
            "title": campaign.title,
            "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} warpimpact run",
            "campaign": campaign.text,
            "warpimpact_version": warpimpact.__version__,
            "warp_version": warp.__version__,
            "device": f"{chosen.alias} ({chosen.name})",
            "sampling": campaign.hits.sampling,
            "seed": campaign.hits.seed,
            "replicates": campaign.replicates,
            "standoff_point": campaign.output.standoff_point,
            "open_area": campaign.plate.open_area,
            "areal_density": campaign.plate.areal_density,
            "core": campaign.core.model_dump_json(),
            "impact": _impact(campaign),
            "numerics": _numerics(campaign, shots),
            "numerics_given": json.dumps(dict(campaign.numerics), default=lambda tolerance: tolerance.model_dump()),
            "failed_share": campaign.output.failed_share,
            "compute_time": elapsed,
            "hits_per_second": len(computed) / elapsed,
        }
        | ({} if campaign.hits.count is None else {"count": campaign.hits.count})
        | ({"ligament": ligament} if math.isfinite(ligament) else {})
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


def _symmetry(group: Sequence[Symmetry], computed: int) -> dict[str, Any]:
    """By which symmetries hits were unfolded, and how many were computed."""
    return {"symmetries": ", ".join(map(str, group)), "computed_hits": computed}


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: what decides the bits beside the campaign."""
    chosen = find_device(device)
    return {
        "warpimpact_version": warpimpact.__version__,
        "warp_version": warp.__version__,
        "device": "cpu" if chosen.is_cpu else chosen.name,
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
