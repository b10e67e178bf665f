"""From a scene to the arrays that the kernels read: rings of the core, tile of the plate, filter, time step."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import psutil
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import correlate1d, distance_transform_edt
from scipy.optimize import brentq, minimize_scalar

from warpimpact.scene import Core, Impact, Numerics, Pattern, Plate

Array = NDArray[np.float64]

FINER = 5
"""Cells of the tile per cell of the exposure's grid, in each direction: a patch takes the one under its centre."""
BLUR = 3
"""Cells of the tile over which its material is averaged, in each direction: edges pass patches gradually. Odd."""
BLOCKS = 96
"""Most blocks, in each direction, in which a period is searched for room that no core fills."""
SUBSAMPLES = 6
"""Points per cell of the tile and direction behind a material fraction."""
AT_A_TIME = 2**13
"""Cells of the tile that are looked at together."""


@dataclass(frozen=True)
class Fidelity:
    """Numbers behind a named fidelity; lengths scale with the scene (MODEL.md §4's table)."""

    patches_axial: int
    patches_around: int
    cells_per_length: float
    """Cells per degradation length ℓ."""
    travel: float
    """Way per time step at impact velocity, as a share of the thickness of the plate, or of SLENDER times the
    core's length where the plate is thicker than that."""
    double: bool = False

    @property
    def patch_width(self) -> float:
        """Widest patch as the plate sees it, in degradation lengths: wider ones leave gaps in the exposure, and
        weaken the plate under themselves too much. It is that of the paper's core (R = 3.02 mm, ℓ = 0.5 mm), for
        which the patches of two neighbouring rings together go round."""
        return 19.0 / self.patches_around


SLENDER = 1.0 / 7.0
ALONG = 1.6
"""Way of a step in the plane of the plate, in degradation lengths and per unit of `travel`: contact that sweeps
sideways by more than that leaves gaps in the exposure."""

WEAKENING = 2.7
"""ln of what a step may take off the resistance where it acts all the time, per unit of `travel`: exposure counts as
it is in mid-step, and a longer step leaves too little of a plate that weakens at once."""

BEHIND = 0.57
"""Length of the rings behind the core's widest station, in those ahead of it: they touch where the core swings, and
turn it by the longest levers."""

FIDELITIES = {
    "draft": Fidelity(14, 16, 1.0, 0.5),
    "standard": Fidelity(23, 32, 1.5, 0.37),
    "reference": Fidelity(64, 56, 5.0, 0.05),
}
NODAL: dict[str, Any] = {
    "patches_axial": 36,
    "patches_around": 36,
    "grid_spacing": 1.0e-5,
    "time_step": 1.0e-6,
}
"""The paper's own resolution; its time step is the one that meets its rows (MODEL.md §4)."""


@dataclass(frozen=True)
class Resolution:
    """Numerics with every choice made: SI. The time step is fixed, or follows from the way per step."""

    nodal: bool
    time_step: float | None
    travel: float
    """Way per step at impact velocity, as a share of the passage: the thickness of the plate, or `slender` [m] where
    that is less. A step, also a given one, that is longer than the passage jumps over what happens in the plate."""
    slender: float
    way_along: float
    """The most of a step's way that may lie in the plane of the plate [m], if a quarter of it is enough for that."""
    weakening: float
    """The most that contact may take off ln of the resistance in a step, likewise."""
    patches_axial: int
    patches_around: int
    grid_spacing: float
    double: bool
    patch_width: float
    """No ring is wider than this radially [m]."""

    def passage(self, thickness: ArrayLike) -> Array:
        """Way [m] on which the plate acts on a core, for some thicknesses [m], of their shape."""
        return np.minimum(thickness, self.slender)

    def longest_time(self, degradation: Array, interval: float) -> Array:
        """Time [s] in which contact weakens a plate by as much as a step may, for some β, of their shape."""
        return np.asarray(self.weakening / np.maximum(-decay_rate(degradation, interval), SLOWEST_DECAY))

    def step_at(
        self, velocity: ArrayLike, obliquity: ArrayLike, thickness: ArrayLike, longest_time: ArrayLike
    ) -> Array:
        """Time steps [s] at impact velocities [m/s], obliquities [rad], thicknesses of the plate [m] and `longest_time`
        [s], of their shape."""
        passage = self.passage(thickness)
        longest = self.travel * passage
        aslant = self.way_along / np.maximum(np.sin(obliquity), 1e-9)
        way = np.clip(np.minimum(aslant, np.multiply(longest_time, velocity)), 0.25 * longest, longest)
        if self.time_step is not None:
            way = self.time_step * np.asarray(velocity)
        return np.asarray(np.minimum(way, passage) / velocity)

    def step_of(self, impact: Impact, plate: Plate) -> float:
        """Time step [s] of a scene, or where it scatters, of its means."""
        longest_time = self.longest_time(np.array(plate.degradation), plate.degradation_interval)
        return float(self.step_at(impact.velocity, impact.obliquity, plate.thickness, longest_time))


def resolve(numerics: Numerics | Fidelity, core: Core, plate: Plate, scattered: Collection[str] = ()) -> Resolution:
    """Fill in what the numerics leave to fidelity and scheme; a fidelity need not have a name.

    Args:
        scattered: names of the quantities of the scene that differ from shot to shot.
    """
    if isinstance(numerics, Fidelity):
        fidelity, numerics = numerics, Numerics()
    else:
        fidelity = FIDELITIES[numerics.fidelity]
    if numerics.tolerance is not None:
        raise ValueError("a tolerance has no one resolution: refine.simulate_to_tolerance meets it")
    degrades = plate.degradation < 1.0 or "degradation" in scattered
    width = fidelity.patch_width * plate.degradation_length if degrades else math.inf
    defaults: dict[str, Any] = {
        "time_step": None,
        "patches_axial": fidelity.patches_axial,
        "patches_around": max(fidelity.patches_around, 4 * math.ceil(0.25 * math.pi * core.max_radius / width)),
        "grid_spacing": plate.degradation_length / fidelity.cells_per_length,
    }
    if numerics.scheme == "nodal":
        defaults = NODAL
    given = {name: getattr(numerics, name) for name in defaults if getattr(numerics, name) is not None}
    return Resolution(
        nodal=numerics.scheme == "nodal",
        double=fidelity.double if numerics.precision is None else numerics.precision == "double",
        travel=fidelity.travel,
        slender=SLENDER * core.length,
        way_along=ALONG * fidelity.travel * plate.degradation_length,
        weakening=WEAKENING * fidelity.travel,
        patch_width=math.inf if numerics.scheme == "nodal" else width,
        **(defaults | given),
    )


def spelt_out(fidelity: Fidelity, core: Core, plate: Plate, impact: Impact) -> Numerics:
    """Numerics that give, for one impact, what `resolve` would make of the fidelity if it had a name."""
    return Numerics(
        time_step=resolve(fidelity, core, plate).step_of(impact, plate),
        patches_axial=fidelity.patches_axial,
        patches_around=fidelity.patches_around,
        grid_spacing=plate.degradation_length / fidelity.cells_per_length,
        precision="double" if fidelity.double else "single",
    )


@dataclass(frozen=True)
class Rings:
    """Rings of patches from nose to base; arrays of shape [rings], SI (see kernels/core_surface.py)."""

    station: Array
    radius: Array
    area_axial: Array
    area_radial: Array
    half_axial: Array
    half_radial: Array
    turn_axial: Array
    turn_radial: Array


def azimuths_of(around: int) -> Array:
    """Azimuths [rad] of the patches of even rings, then of odd rings, half a patch on; shape [2 around].

    Both sets are their own mirror images, as the core is.
    """
    even = np.arange(around) + 0.5
    return np.asarray(np.concatenate([even, even - 0.5]) * (2.0 * np.pi / around))


def rings_of(core: Core, axial: int, around: int, widest: float = math.inf, *, discs: bool = True) -> Rings:
    """Divide a core's surface into rings of the profile, `axial` of them per its length ahead of the widest station
    and more behind it, and rings of the discs that close it.

    Rings wider than `widest` [m] radially are divided. Without `discs` it is the literal scheme's: the profile
    alone, evenly divided.

    Each patch carries its exact vector area (that of the true surface, not of a flat facet), so the areas of the
    closed surface sum to zero and the work of a straight shot is exact (MODEL.md §6.1).
    """
    if discs:
        nose, base = (float(r) for r in core.radius(np.array([0.0, core.length])))
        across = min(widest, core.length / axial)
        parts = [
            _disc_rings(0.0, nose, across, facing=1.0),
            _profile_rings(core, _divided(core, _stations(core, axial), widest)),
            _disc_rings(core.length, base, across, facing=-1.0),
        ]
    else:
        parts = [_profile_rings(core, np.linspace(0.0, core.length, axial + 1))]
    s, r, axial_area, radial_area, half_s, half_r, turn_s, turn_r = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    sector = 2.0 * np.pi / around
    chord = 2.0 * np.sin(0.5 * sector)
    return Rings(
        station=core.mass_properties.centre_of_mass - s,
        radius=r,
        area_axial=axial_area * sector,
        area_radial=radial_area * chord,
        half_axial=-half_s,
        half_radial=half_r,
        turn_axial=turn_s,
        turn_radial=turn_r,
    )


def _stations(core: Core, count: int) -> Array:
    """Edges of the profile's rings: a length/count apart, BEHIND of that behind the widest station, which is one of
    them, as are the jumps of the slope unless they outnumber the rings."""
    breaks, widest = core.breaks if len(core.breaks) < count else (), _widest_station(core)
    inner = np.unique([*breaks, widest])
    apart = np.diff(inner, prepend=0.0, append=core.length) > 1e-6 * core.length
    knots = np.array([0.0, *inner[apart[:-1] & apart[1:]], core.length])
    apiece = np.where(knots[:-1] < widest - 1e-6 * core.length, 1.0, BEHIND) * core.length / count
    shares = np.maximum(1, np.round(np.diff(knots) / apiece)).astype(int)
    edges = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(knots[:-1], knots[1:], shares, strict=True)]
    return np.append(np.concatenate(edges), core.length)


def _divided(core: Core, edges: Array, widest: float) -> Array:
    """The edges, with more of them where the radius changes by more than `widest` [m] from one to the next."""
    counts = np.maximum(1, np.ceil(np.abs(np.diff(core.radius(edges))) / widest - 1e-9)).astype(int)
    finer = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges[:-1], edges[1:], counts, strict=True)]
    return np.append(np.concatenate(finer), core.length)


def _widest_station(core: Core) -> float:
    """First station of the largest radius [m]: a ring astride it would partly cancel itself."""
    stations = np.linspace(0.0, core.length, 1001)
    peak = int(core.radius(stations).argmax())
    low, high = stations[max(peak - 1, 0)], stations[min(peak + 1, len(stations) - 1)]
    found = minimize_scalar(lambda s: -core.radius(np.array(s)), bounds=(low, high), method="bounded")
    candidates = np.array([*(b for b in core.breaks if low <= b <= high), found.x, stations[peak]])
    return float(candidates[core.radius(candidates).argmax()])


def _profile_rings(core: Core, edges: Array) -> tuple[Array, ...]:
    """Station, radius, ∫ r dr and ∫ r ds (per radian), half extents and half turns of the normal, of the rings
    between edges."""
    low, high = edges[:-1], edges[1:]
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inside = core.radius(middle[:, None] + half[:, None] * nodes)
    r_low, r_high = core.radius(low), core.radius(high)
    lateral = (inside * weights).sum(axis=1) * half
    at_low, at_high = _normals(core, low, 1e-3 * half), _normals(core, high, -1e-3 * half)
    turn_axial, turn_radial = 0.5 * (at_high - at_low)
    half_radial = 0.5 * (r_high - r_low)
    return (
        middle,
        core.radius(middle),
        half_radial * (r_high + r_low),
        lateral,
        half,
        half_radial,
        turn_axial,
        turn_radial,
    )


def _normals(core: Core, stations: Array, step: Array) -> Array:
    """Outward unit normals (axial, radial) of the profile, seen from the side of `step`; shape [2, stations]."""
    here, next_, beyond = (core.radius(stations + k * step) for k in range(3))
    slope = (4.0 * next_ - 3.0 * here - beyond) / (2.0 * step)
    return np.stack([slope, np.ones_like(slope)]) / np.hypot(slope, 1.0)


def _disc_rings(station: float, radius: float, widest: float, *, facing: float) -> tuple[Array, ...]:
    """The same of a disc that faces along the axis (+1 towards the nose)."""
    count = int(np.ceil(radius / widest)) if radius > 1e-6 * widest else 0  # below that it is a point
    edges = np.linspace(0.0, radius, count + 1)
    low, high = edges[:-1], edges[1:]
    nothing = np.zeros(count)
    return (
        np.full(count, station),
        0.5 * (low + high),
        facing * 0.5 * (high**2 - low**2),
        nothing,
        nothing,
        0.5 * (high - low),
        nothing,
        nothing,
    )


@dataclass(frozen=True, eq=False)
class Tile:
    """One period of the pristine plate: material fractions, shape [cells_y, cells_z], cells of dy × dz [m]."""

    material: Array
    dy: float
    dz: float

    @cached_property
    def clearance(self) -> Array:
        """Distance [m] that every cell keeps at least from the material of the whole lattice, shape of `material`."""
        # In blocks of cells, of which any material makes a wall; seen from one period amid eight others: no hole is
        # wider than the period, so the nearest wall is among them.
        rows, columns = self.material.shape
        block = (math.ceil(rows / BLOCKS), math.ceil(columns / BLOCKS))
        starts = [np.arange(0, count, size) for count, size in zip(self.material.shape, block, strict=True)]
        wall = np.maximum.reduceat(np.maximum.reduceat(self.material > 0.0, starts[0], axis=0), starts[1], axis=1)
        if not wall.any():
            return np.full((rows, columns), math.inf)
        widths = (self.dy * rows / len(starts[0]), self.dz * columns / len(starts[1]))
        free = distance_transform_edt(~np.tile(wall, (3, 3)), sampling=widths)
        own = free[len(starts[0]) : 2 * len(starts[0]), len(starts[1]) : 2 * len(starts[1])]
        # Two blocks less: distances are from centre to centre, and the last block of a period may be narrower.
        kept = np.maximum(0.0, own - 2.0 * math.hypot(self.dy * block[0], self.dz * block[1]))
        return np.asarray(np.repeat(np.repeat(kept, block[0], axis=0), block[1], axis=1)[:rows, :columns])


def tile_of(plate: Plate, spacing: float, *, sharp: bool = False) -> Tile:
    """Material fraction about every cell of one period; cell (0, 0) has its corner at the origin.

    Cells are at most `spacing` wide and fit the period; fractions are means over BLUR × BLUR cells. `sharp` takes each
    cell's centre alone, as the literal scheme does.

    Raises:
        MemoryError: the tile does not fit; the message is for a person.
    """
    return _tile(_Itself(plate.pattern), spacing, sharp)


@dataclass(frozen=True, eq=False)
class _Itself:
    """A pattern that is the same only as itself: a mask of the same name may have changed on the disk."""

    pattern: Pattern

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and self.pattern is other.pattern

    def __hash__(self) -> int:
        return id(self.pattern)


@lru_cache(maxsize=4)
def _tile(itself: _Itself, spacing: float, sharp: bool) -> Tile:
    """Kept for the next shots at the same plate."""
    pattern = itself.pattern
    period_y, period_z = pattern.period
    # An even number, so that a row staggered by half a period sees the same cells.
    step = 1 if sharp else 2
    count_y, count_z = (step * max(1, math.ceil(p / (step * spacing) - 1e-9)) for p in (period_y, period_z))
    dy, dz = period_y / count_y, period_z / count_z
    needed, free = 3 * 8 * count_y * count_z, psutil.virtual_memory().available
    if needed > free:
        raise MemoryError(
            f"numerics.grid_spacing: got {spacing:g} m, but the plate's period of {period_y:g} m x {period_z:g} m "
            f"would take {needed / 2**30:.3g} GiB at that spacing, of {free / 2**30:.3g} GiB free"
        )
    samples = 1 if sharp else SUBSAMPLES
    within = (np.arange(samples, dtype=np.float64) + 0.5) / samples - 0.5
    half_diagonal, middle_z = 0.501 * math.hypot(dy, dz), (np.arange(count_z, dtype=np.float64) + 0.5) * dz
    material, rows = np.empty((count_y, count_z)), max(1, AT_A_TIME // count_z)
    for first in range(0, count_y, rows):
        part = material[first : first + rows]
        middle_y = (np.arange(first, first + len(part), dtype=np.float64)[:, None] + 0.5) * dy
        part[:] = ~pattern.is_hole(middle_y, middle_z)
        row, column = np.nonzero(pattern.has_edge(middle_y, middle_z, half_diagonal))
        y, z = middle_y[row, :, None] + within[:, None] * dy, middle_z[column, None, None] + within * dz
        part[row, column] = 1.0 - pattern.is_hole(y, z).mean(axis=(1, 2))
    if not sharp:  # no running sum, whose rounding leaves material in the middle of a hole
        for axis in range(2):
            material = correlate1d(material, np.full(BLUR, 1.0 / BLUR), axis, mode="wrap")
    return Tile(material, dy, dz)


def tent_taps(length: float, cell: float) -> Array:
    """Weights of the discrete filter that, between bilinear scattering and bilinear reading, acts as the tent K of
    half-width ℓ.

    Its half-width is adjusted so that mass and second moment, ℓ²/6, are exact: scattering and reading each add
    cell²/6 on average. With ℓ below √2 cells nothing is left to filter.
    """
    if length <= math.sqrt(2.0) * cell:
        return np.ones(1)

    def taps(half_width: float) -> tuple[Array, Array]:
        reach = int(np.ceil(half_width / cell - 1e-9)) - 1
        offsets = cell * np.arange(-reach, reach + 1, dtype=np.float64)
        weights: Array = np.asarray(1.0 - np.abs(offsets) / half_width)
        return weights / weights.sum(), offsets

    def excess(half_width: float) -> float:
        weights, offsets = taps(half_width)
        return float(weights @ offsets**2 + cell**2 / 3.0 - length**2 / 6.0)

    return taps(brentq(excess, cell, length + cell))[0]


ONSET = 0.05
"""Onset speed of contact in units of what full contact of a wall as deep as the plate does in one step."""
LARGEST_ONSET = 0.02
"""Bound of the onset speed, as a share of the impact velocity."""


def onset_jump(core: Core, thickness: Array, mass: Array, static_stress: Array) -> Array:
    """Onset speed of contact per time step [m/s²] of cores of some masses [kg] in plates of some thicknesses [m] and
    static stresses [Pa], of their shape; positive, also for a plate without resistance."""
    wall = 2.0 * core.max_radius * np.minimum(thickness, core.length)
    return np.maximum(ONSET * static_stress * wall / mass, 1.0)


FASTEST_DECAY = 1.0e30
"""Of the resistance [1/s]: β = 0 takes all of it at the first touch, a rate beyond any exposure, yet finite (0 × it
is 0)."""
SLOWEST_DECAY = 1.0e-30
"""Below which nothing weakens [1/s]."""


def decay_rate(degradation: Array, interval: float) -> Array:
    """ln(β)/Δt_β [1/s] for some β, of their shape."""
    log = np.log(degradation, where=degradation > 0.0, out=np.full_like(degradation, -np.inf))
    return np.maximum(log / interval, -FASTEST_DECAY)
