"""From a campaign to its Dataset."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any

import numpy as np
import psutil
import warp
import xarray

import warpimpact
from warpimpact.campaign.campaign import Campaign
from warpimpact.discretisation import resolve
from warpimpact.refine import LADDER, Estimates, simulate_to_tolerance
from warpimpact.results import to_dataset
from warpimpact.scene import Shots, Symmetry, make_shots, symmetries_used
from warpimpact.simulate import Outcomes, Progress, find_device, simulate
from warpimpact.unfold import unfolded, unfolded_estimates

BATCH = 2**18
"""Shots per call of `simulate`, so that what the device holds does not grow with the campaign."""


def run(campaign: Campaign, *, device: str = "auto", progress: Progress | None = None) -> xarray.Dataset:
    """Compute every hit of a campaign, or those of the irreducible part of its unit cell and from them the others.

    Args:
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        progress: called with (hits done, hits) as they come.

    Returns:
        The Dataset of results.py, one entry per hit.

    Raises:
        DeviceError: the device is absent.
        MemoryError: the results do not fit into memory; the message is for a person.
    """
    chosen = find_device(device)
    _check_memory(campaign)
    shots = make_shots(campaign.impact, campaign.hits, campaign.plate)
    group = symmetries_used(campaign.impact, campaign.hits, campaign.plate)
    computed = shots[:: len(group)]
    begin = time.perf_counter()
    outcomes, estimates = _in_batches(campaign, computed, str(chosen), progress or (lambda done, total: None))
    elapsed = time.perf_counter() - begin
    period = campaign.plate.sampled_cell
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
            "seed": campaign.hits.seed,
            "standoff_point": campaign.output.standoff_point,
            "open_area": campaign.plate.open_area,
            "areal_density": campaign.plate.areal_density,
            "numerics": _numerics(campaign),
            "compute_time": elapsed,
            "hits_per_second": len(computed) / elapsed,
        }
        | ({} if campaign.hits.count is None else {"count": campaign.hits.count})
        | (_symmetry(group, len(computed)) if campaign.hits.irreducible else {}),
        estimates=None if estimates is None else unfolded_estimates(estimates, group),
    )


def _symmetry(group: Sequence[Symmetry], computed: int) -> dict[str, Any]:
    """By which symmetries hits were unfolded, and how many were computed."""
    return {"symmetries": ", ".join(map(str, group)), "computed_hits": computed}


def _check_memory(campaign: Campaign) -> None:
    """Refuse a campaign whose results cannot be held, before it starts."""
    numbers = len(fields(Shots)) + 8 + 4 * len(campaign.output.standoffs)
    copies = 3  # outcomes by batch, joined, and in the Dataset's units
    needed = copies * numbers * 8 * (campaign.hits.count or 0)
    free = psutil.virtual_memory().available
    if needed > free:
        raise MemoryError(
            f"hits.count: got {campaign.hits.count}, whose results take {needed / 2**30:.3g} GiB, "
            f"but {free / 2**30:.3g} GiB are free; at most {(campaign.hits.count or 0) * free // needed} hits fit"
        )


def _in_batches(campaign: Campaign, shots: Shots, device: str, progress: Progress) -> tuple[Outcomes, Estimates | None]:
    parts = []
    for first in range(0, len(shots), BATCH):
        parts.append(_batch(campaign, shots[first : first + BATCH], device, _after(first, len(shots), progress)))
    outcomes, estimates = zip(*parts, strict=True)
    return _joined(outcomes), None if estimates[0] is None else _joined(estimates)


def _batch(campaign: Campaign, shots: Shots, device: str, progress: Progress) -> tuple[Outcomes, Estimates | None]:
    how: dict[str, Any] = {
        "interaction": campaign.interaction,
        "numerics": campaign.numerics,
        "standoffs": campaign.output.standoffs,
        "standoff_point": campaign.output.standoff_point,
        "device": device,
        "progress": progress,
    }
    if campaign.numerics.tolerance is None:
        return simulate(campaign.core, campaign.plate, shots, **how), None
    return simulate_to_tolerance(campaign.core, campaign.plate, shots, **how)


def _joined(parts: Sequence[Any]) -> Any:
    """One dataclass of arrays from several of the same type."""
    names = [field.name for field in fields(parts[0])]
    return type(parts[0])(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _after(first: int, total: int, progress: Progress) -> Progress:
    """Progress of a batch that comes after the first shots."""
    return lambda done, _: progress(first + done, total)


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
