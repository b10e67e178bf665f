"""Input of the bending moment: the sections of a core and the mass ahead of each (kernels/bending.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Core

if TYPE_CHECKING:
    from warpimpact.solver.rings import Array, Rings

THINNEST = 0.5
"""Sections thinner than this share of the largest radius have no nominal stress. 4M/(πr³) has no bound at a pointed
nose, and beam theory does not hold within a diameter of a load."""


@dataclass(frozen=True)
class Sections:
    """The sections behind the rings; arrays of shape [rings], SI (see kernels/bending.py)."""

    station: Array
    ahead: Array
    stress: Array
    first: Array
    second: Array
    rotary: Array


def bending_columns(found: Any, failed: NDArray[np.bool_], *, breaks: bool) -> dict[str, Array]:
    """Largest bending moment and stress of every shot, and their sections; a section is NaN where its value is 0.

    Args:
        found: the kernels' Bending of every shot, shape [shots].
        failed: shots whose computation failed, which get NaN.
        breaks: whether the cores have a strength; then also whether, when and where they broke.
    """
    columns = {
        "largest_bending_moment": found["moment"],
        "bending_section": np.where(found["moment"] > 0.0, found["moment_station"], np.nan),
        "bending_stress": found["stress"],
        "bending_stress_section": np.where(found["stress"] > 0.0, found["stress_station"], np.nan),
    }
    if breaks:
        broken = found["broken"] > 0
        columns |= {"broken": found["broken"], "broken_section": np.where(broken, found["broken_station"], np.nan)}
        columns |= {name: np.where(broken, found[name], np.nan) for name in ("broken_time", "broken_x")}
    return {name: np.where(failed, np.nan, values).astype(np.float64) for name, values in columns.items()}


def sections_of(core: Core, rings: Rings) -> Sections:
    """The sections behind the rings of a core."""
    centre = core.mass_properties.centre_of_mass
    station = np.clip(centre - rings.station - rings.half_axial, 0.0, core.length)
    ahead, radius = centre - station, core.radius(station)
    thick = radius >= THINNEST * core.max_radius
    stress = np.where(thick, 4.0 / np.pi / np.where(thick, radius, 1.0) ** 3, 0.0)
    mass, first, second, rotary = _integrals(core, station)
    return Sections(station, ahead, stress, first - ahead * mass, second - ahead * first, rotary)


def _integrals(core: Core, stations: Array) -> Array:
    """∫ (1, ξ, ξ², r²/4) dm from the nose to stations, ξ ahead of the centre of mass, per mass; shape [4, stations]."""
    edges = np.unique([0.0, *stations, *core.breaks, core.length])
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    s = middle[:, None] + half[:, None] * nodes
    square = core.radius(s) ** 2
    slices, ahead = square * weights * half[:, None], core.mass_properties.centre_of_mass - s
    pieces = np.array([(slices * of).sum(axis=1) for of in (1.0, ahead, ahead**2, 0.25 * square)])
    sums = np.cumsum(np.pad(pieces, ((0, 0), (1, 0))), axis=1) / slices.sum()
    return np.asarray(sums[:, np.searchsorted(edges, stations)])
