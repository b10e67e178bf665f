"""The surface of a core as rings of patches, and the sections behind them for the bending moment."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Core

Array = NDArray[np.float64]

SHORTER_BEHIND = 0.57
"""Length of the rings behind the core's widest station, as a share of the length of those ahead of it. The rings behind
touch when the core swings, and they have the longest levers."""
ZOOMS = 4
"""Rounds of the search for the widest station. Each divides the two best gaps of the round before into a thousand."""
THINNEST_SECTION = 0.5
"""Radius, as a share of the largest, below which a section has no nominal stress. 4M/(πr³) has no bound at a pointed
nose, and beam theory does not hold within a diameter of a load."""


@dataclass(frozen=True, eq=False)
class Rings:
    """Rings of patches from nose to base; arrays of shape [rings], SI (kernels/structs.py, Surface). The same core in
    the same patches has one such object."""

    station: Array
    radius: Array
    area_axial: Array
    area_radial: Array
    half_axial: Array
    half_radial: Array
    turn_axial: Array
    turn_radial: Array


@dataclass(frozen=True)
class Sections:
    """The sections behind the rings; arrays of shape [rings], SI (see kernels/bending.py)."""

    station: Array
    ahead: Array
    stress: Array
    first: Array
    second: Array
    rotary: Array


def azimuths_of(around: int) -> Array:
    """Azimuths [rad] of the patches of even rings, then of odd rings, turned by half a patch; shape [2 around].

    Both sets are their own mirror images, as the core is.
    """
    even = np.arange(around) + 0.5
    return np.asarray(np.concatenate([even, even - 0.5]) * (2.0 * np.pi / around))


def rings_of(core: Core, axial: int, around: int, widest: float = math.inf, *, discs: bool = True) -> Rings:
    """Divide a core's surface into rings of the profile and rings of the discs that close it.

    The profile has `axial` rings per length of the core ahead of the widest station, and shorter rings behind it.
    Rings wider than `widest` [m] radially are divided. Without `discs` the surface is that of the literal scheme: the
    profile alone, in rings of equal length.

    Each patch carries its exact vector area (that of the true surface, not of a flat facet), so the areas of the
    closed surface sum to zero and the work of a straight shot is exact (docs/model.md §6.1).
    """
    if not discs:
        return _rings(core, np.linspace(0.0, core.length, axial + 1).tobytes(), 0, 0, around)
    (edges, rise), across = _stations(core, axial), min(widest, core.length / axial)
    edges = _divided(edges, np.maximum(1, np.ceil(rise / widest - 1e-9)).astype(int))
    nose, base = core.radius(np.array([0.0, core.length]))
    return _rings(core, edges.tobytes(), _discs(nose, across), _discs(base, across), around)


@lru_cache(maxsize=64)
def _rings(core: Core, edges: bytes, nose: int, base: int, around: int) -> Rings:
    """Rings between edges of the profile, and `nose` and `base` rings of the discs there."""
    of_nose, of_base = core.radius(np.array([0.0, core.length]))
    parts = [
        _disc_rings(0.0, of_nose, nose, facing=1.0),
        _profile_rings(core, np.frombuffer(edges)),
        _disc_rings(core.length, of_base, base, facing=-1.0),
    ]
    s, r, axial_area, radial_area, half_s, half_r, turn_s, turn_r = np.concatenate(parts, axis=1)
    centre, sector = core.mass_properties.centre_of_mass, 2.0 * np.pi / around
    chord = 2.0 * np.sin(0.5 * sector)
    return Rings(centre - s, r, axial_area * sector, radial_area * chord, -half_s, half_r, turn_s, turn_r)


@lru_cache(maxsize=16)
def _stations(core: Core, count: int) -> tuple[Array, Array]:
    """Edges of the profile's rings, and the change of radius from each to the next [m].

    The edges are length/count apart ahead of the widest station, and SHORTER_BEHIND times this distance behind it. The
    widest station is an edge. Jumps of the slope are edges, too, if they are fewer than `count`.
    """
    breaks, widest = core.breaks if len(core.breaks) < count else (), _widest_station(core)
    inner = np.unique([*breaks, widest])
    distinct = np.diff(inner, prepend=0.0, append=core.length) > 1e-6 * core.length
    knots = np.array([0.0, *inner[distinct[:-1] & distinct[1:]], core.length])
    apiece = np.where(knots[:-1] < widest - 1e-6 * core.length, 1.0, SHORTER_BEHIND) * core.length / count
    shares = np.maximum(1, np.round(np.diff(knots) / apiece)).astype(int)
    edges = _divided(knots, shares)
    return edges, np.abs(np.diff(core.radius(edges)))


def _divided(edges: Array, parts: NDArray[np.int64]) -> Array:
    """Edges of finer rings: each ring is divided into its number of parts."""
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(np.repeat(edges[:-1], parts) + within * np.repeat(np.diff(edges) / parts, parts), edges[-1])


def _widest_station(core: Core) -> float:
    """First station of the largest radius [m]. It must be an edge, because the loads on a ring across it would partly
    cancel."""
    low, high = 0.0, core.length
    for _ in range(ZOOMS):
        stations = np.linspace(low, high, 1001)
        peak = int(core.radius(stations).argmax())
        low, high = stations[max(peak - 1, 0)], stations[min(peak + 1, len(stations) - 1)]
    candidates = np.array([*core.breaks, stations[peak]])
    return float(candidates[core.radius(candidates).argmax()])


def _profile_rings(core: Core, edges: Array) -> Array:
    """Station, radius, ∫ r dr and ∫ r ds (per radian), half extents and half turns of the normal, of the rings
    between edges, shape [8, rings]."""
    low, high = edges[:-1], edges[1:]
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inside = core.radius(middle[:, None] + half[:, None] * nodes)
    r_low, r_high = core.radius(low), core.radius(high)
    lateral = (inside * weights).sum(axis=1) * half
    at_low, at_high = _normals(core, low, 1e-3 * half), _normals(core, high, -1e-3 * half)
    half_radial = 0.5 * (r_high - r_low)
    area_axial, turns = half_radial * (r_high + r_low), 0.5 * (at_high - at_low)
    return np.stack([middle, core.radius(middle), area_axial, lateral, half, half_radial, *turns])


def _normals(core: Core, stations: Array, step: Array) -> Array:
    """Outward unit normals (axial, radial) of the profile, seen from the side of `step`; shape [2, stations]."""
    here, next_, beyond = (core.radius(stations + k * step) for k in range(3))
    slope = (4.0 * next_ - 3.0 * here - beyond) / (2.0 * step)
    return np.stack([slope, np.ones_like(slope)]) / np.hypot(slope, 1.0)


def _discs(radius: float, widest: float) -> int:
    """Number of rings of a disc whose radial width is at most `widest` [m]."""
    return int(np.ceil(radius / widest)) if radius > 1e-6 * widest else 0  # a smaller disc is a point


def _disc_rings(station: float, radius: float, count: int, *, facing: float) -> Array:
    """The values of `_profile_rings` for a disc in `count` rings that faces along the axis (+1 towards the nose)."""
    edges = np.linspace(0.0, radius, count + 1)
    low, high = edges[:-1], edges[1:]
    rings = np.zeros((8, count))
    rings[0], rings[1] = station, 0.5 * (low + high)
    rings[2], rings[5] = facing * 0.5 * (high**2 - low**2), 0.5 * (high - low)
    return rings


def sections_of(core: Core, rings: Rings) -> Sections:
    """The sections behind the rings of a core."""
    station = core.mass_properties.centre_of_mass - rings.station - rings.half_axial
    return sections_at(core, np.clip(station, 0.0, core.length))


def sections_at(core: Core, station: Array) -> Sections:
    """The sections of a core at distances behind its nose [m]."""
    ahead, radius = core.mass_properties.centre_of_mass - station, core.radius(station)
    thick = radius >= THINNEST_SECTION * core.max_radius
    stress = np.where(thick, 4.0 / np.pi / np.where(thick, radius, 1.0) ** 3, 0.0)
    # ∫ (1, ξ, ξ², r²/4) dm from the nose to the stations, ξ ahead of the centre of mass, per mass.
    edges = np.unique([0.0, *station, *core.breaks, core.length])
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    s = middle[:, None] + half[:, None] * nodes
    square = core.radius(s) ** 2
    slices, places = square * weights * half[:, None], core.mass_properties.centre_of_mass - s
    pieces = np.array([(slices * of).sum(axis=1) for of in (1.0, places, places**2, 0.25 * square)])
    sums = np.cumsum(np.pad(pieces, ((0, 0), (1, 0))), axis=1) / slices.sum()
    mass, first, second, rotary = sums[:, np.searchsorted(edges, station)]
    return Sections(station, ahead, stress, first - ahead * mass, second - ahead * first, rotary)
