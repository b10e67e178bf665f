"""The one place where shots of a campaign become a Dataset, on whatever machine."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
import warp
import xarray

import warpimpact
from warpimpact.campaign.campaign import Campaign
from warpimpact.discretisation import resolve
from warpimpact.refine import LADDER, simulate_to_tolerance
from warpimpact.results import to_dataset
from warpimpact.scene import Shots, Symmetry
from warpimpact.simulate import Progress, find_device, simulate
from warpimpact.unfold import unfolded, unfolded_estimates


def compute(
    campaign: Campaign,
    shots: Shots,
    *,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Compute some shots of a campaign; where it asks for symmetry, the first of each hit's images for all of them.

    Args:
        shots: whole groups of images, as the campaign's sampler gives them.
        device, threads, progress: as in `simulate`.

    Returns:
        The Dataset of results.py, one entry per shot: a result of its own.

    Raises:
        DeviceError: the device is absent.
        UnsupportedError: the kernels cannot compute these shots yet.
    """
    group = campaign.symmetries
    computed = shots[:: len(group)]
    how: dict[str, Any] = {
        "interaction": campaign.interaction,
        "numerics": campaign.numerics,
        "standoffs": campaign.output.standoffs,
        "standoff_point": campaign.output.standoff_point,
        "device": device,
        "threads": threads,
        "progress": progress and (lambda done, total: progress(done * len(group), total * len(group))),
    }
    begin = time.perf_counter()
    if campaign.numerics.tolerance is None:
        outcomes, estimates = simulate(campaign.core, campaign.plate, computed, **how), None
    else:
        outcomes, estimates = simulate_to_tolerance(campaign.core, campaign.plate, computed, **how)
    elapsed = time.perf_counter() - begin
    period, chosen = campaign.hits.covered(campaign.plate), find_device(device)
    return to_dataset(
        shots,
        unfolded(outcomes, group),
        standoffs=np.array(campaign.output.standoffs),
        outlines=campaign.plate.pattern.outlines(*((-0.5 * side, 0.5 * side) for side in period)),
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
            "numerics": _numerics(campaign),
            "failed_share": campaign.output.failed_share,
            "compute_time": elapsed,
            "hits_per_second": len(computed) / elapsed,
        }
        | ({} if campaign.hits.count is None else {"count": campaign.hits.count})
        | ({"ligament": campaign.plate.ligament} if math.isfinite(campaign.plate.ligament) else {})
        | (_symmetry(group, len(computed)) if campaign.hits.irreducible else {}),
        estimates=None if estimates is None else unfolded_estimates(estimates, group),
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


def _numerics(campaign: Campaign) -> str:
    """The numerics in force, every choice made, as one line."""
    tolerance = campaign.numerics.tolerance
    if tolerance is not None:
        return (
            f"tolerance of {tolerance.residual_velocity:g} m/s and {np.degrees(tolerance.tilt):g} deg, "
            f"at most {LADDER[-1].patches_axial} by {LADDER[-1].patches_around} patches"
        )
    resolution = resolve(campaign.numerics, campaign.core, campaign.plate)
    return (
        f"{campaign.numerics.fidelity} fidelity, {campaign.numerics.scheme} scheme, "
        f"time_step {resolution.step_at(campaign.impact.velocity, campaign.impact.obliquity):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {'double' if resolution.double else 'single'}"
    )
