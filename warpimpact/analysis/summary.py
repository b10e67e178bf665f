"""The few numbers a person wants first: how the shots ended, and what comes through the plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.results import status_codes


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation over the ``count`` hits that have a quantity; NaN when there are none."""

    count: int
    mean: float
    standard_deviation: float


@dataclass(frozen=True)
class Summary:
    """Outcome counts by status, and the spread of what left the rear face.

    Velocities are in m/s, angles in degrees; ``tilt`` is keyed by the stand-off [m].
    """

    counts: dict[str, int]
    residual_velocity: Spread
    deflection: Spread
    tilt: dict[float, Spread]


def passed(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each core passed the plate, shape (hit,): it perforated the plate or missed its material."""
    codes = status_codes(dataset)
    return np.isin(dataset["status"].values, [codes["perforated"], codes["missed"]])


def summary(dataset: xarray.Dataset) -> Summary:
    """Summarise a hit map; velocity, deflection and tilt count only the cores that passed the plate."""
    status = dataset["status"].values
    behind = dataset.isel(hit=passed(dataset))
    return Summary(
        counts={name: int(np.sum(status == code)) for name, code in status_codes(dataset).items()},
        residual_velocity=_spread(behind["residual_velocity"].values),
        deflection=_spread(behind["deflection"].values),
        tilt={float(tilt["standoff"]): _spread(tilt.values) for tilt in behind["tilt"].T},
    )


def _spread(values: NDArray[np.float64]) -> Spread:
    """Spread of the values that exist; the standard deviation is that of the hits themselves (ddof = 0)."""
    existing = values[np.isfinite(values)]
    if existing.size == 0:
        return Spread(0, np.nan, np.nan)
    return Spread(existing.size, float(existing.mean()), float(existing.std()))


def summary_text(dataset: xarray.Dataset) -> str:
    """The summary as a short table; statuses that did not occur are left out."""
    result = summary(dataset)
    hits = dataset.sizes["hit"]
    rows = [_count_row(meaning, count, hits) for meaning, count in result.counts.items() if count]
    rows += [
        _spread_row("residual velocity", result.residual_velocity, "m/s"),
        _spread_row("deflection", result.deflection, "°"),
    ]
    rows += [_spread_row(f"tilt at {standoff * 1e3:g} mm", tilt, "°") for standoff, tilt in result.tilt.items()]
    return "\n".join(rows)


def symmetry_text(dataset: xarray.Dataset) -> str:
    """How many hits of a map with `hits.irreducible` were computed, and where the others come from."""
    computed, hits = dataset.attrs["computed_hits"], dataset.sizes["hit"]
    if computed == hits:
        return f"all {hits} hits computed: plate and shot have no symmetry in common"
    return f"{computed} of {hits} hits computed, the others are their images by {dataset.attrs['symmetries']}"


def _count_row(meaning: str, count: int, hits: int) -> str:
    return f"{meaning.replace('_', ' '):<20}{count:>8d}   {count / hits:.1%}"


def _spread_row(name: str, spread: Spread, unit: str) -> str:
    if spread.count == 0:
        return f"{name:<20}{'-':>8}   no core behind the plate"
    return f"{name:<20}{spread.mean:>8.1f} ± {spread.standard_deviation:.1f} {unit}"
