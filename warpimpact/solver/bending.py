"""Input of the bending moment: the sections of a core and the mass ahead of each (kernels/bending.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

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
