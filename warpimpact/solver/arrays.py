"""From a scene and its shots to the plain arrays that the kernels read: the one place where it is resolved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.variant import Variant
from warpimpact.solver.bending import Sections, check_bending, sections_of
from warpimpact.solver.resolution import Resolution, decay_rate, resolve
from warpimpact.solver.rings import Rings, azimuths_of, rings_of
from warpimpact.solver.tile import FINER, FINEST, Tile, tent_taps, tile_of

if TYPE_CHECKING:
    from warpimpact.scene import Core, Numerics, Plate, Scene, Shots
    from warpimpact.solver.resolution import Fidelity

Array = NDArray[np.float64]

ONSET = 0.02
"""Onset speed of contact in units of what full contact of a wall as deep as the plate does in one step."""
LARGEST_ONSET = 0.02
"""Bound of the onset speed, as a share of the impact velocity."""
STEP_ALLOWANCE = 200
"""How many times the way of an unhindered passage a shot may take, at impact velocity, before it is given up."""
UNBREAKABLE = 1.0e30
"""Strength of a core that has none [Pa], beyond any stress."""


@dataclass(frozen=True)
class Grid:
    """A plate as the kernels see it.

    Attributes:
        tile: one period of it.
        period, half_size: extents (y, z) of the period, and half of those of the plate [m]; infinite without a rim.
        spacing: of the window's grid [m].
        taps: the tent's filter from its middle on, and one 0.
    """

    tile: Tile
    period: tuple[float, float]
    half_size: tuple[float, float]
    spacing: float
    taps: Array


@dataclass(frozen=True)
class Arrays:
    """A scene and its shots as the kernels see them: SI and radians.

    Attributes:
        resolution: the numerics with every choice made.
        variant: the build of the kernels that the scene needs.
        core, rings: the core, and its surface.
        azimuths: of the patches of even rings, then of odd rings [rad], shape [2 around].
        sections: of the core behind the rings; None where it does not bend.
        grid: the plate.
        rate_stress: a2 of the law [Pa s²/m²].
        onset: κ of the law.
        by_path: whether exposure counts the path of the core, not the time.
        shots: every member of the kernels' Shots (kernels/shots.py), each of shape [1] or [shots].
        rows: of the trace of each shot; 0 for none.
    """

    resolution: Resolution
    variant: Variant
    core: Core
    rings: Rings
    azimuths: Array
    sections: Sections | None
    grid: Grid
    rate_stress: float
    onset: float
    by_path: bool
    shots: dict[str, Array]
    rows: int


def variant_of(resolution: Resolution, scene: Scene, shots: Shots) -> Variant:
    """The build of the kernels that a scene needs."""
    plate, interaction = scene.target.plate, scene.interaction
    return Variant(
        double=resolution.double,
        nodal=resolution.nodal,
        degrades=plate.degradation < 1.0 or "degradation" in shots.columns,
        rubs=plate.shear_coefficient > 0.0 or "shear_coefficient" in shots.columns,
        rate_dependent=interaction.linear > 0.0 or interaction.quadratic > 0.0,
        rimmed=plate.size is not None,
        bends=scene.record.bending,
    )


def arrays_of(scene: Scene, numerics: Numerics | Fidelity, shots: Shots, *, traced: bool = False) -> Arrays:
    """Resolve a scene for its shots.

    Args:
        traced: leave room for the history of every shot.

    Raises:
        ValueError: the numerics have no bending moment, which the scene records.
        MemoryError: the plate's period does not fit at the grid spacing.
    """
    core, plate = scene.core, scene.target.plate
    check_bending(scene.record, numerics)
    resolution = resolve(numerics, scene, shots.columns)
    nodal, around = resolution.nodal, resolution.patches_around
    rings = rings_of(core, resolution.patches_axial, around, resolution.patch_width, discs=not nodal)
    conditions = _conditions(scene, resolution, shots)
    return Arrays(
        resolution=resolution,
        variant=variant_of(resolution, scene, shots),
        core=core,
        rings=rings,
        azimuths=azimuths_of(around),
        sections=sections_of(core, rings) if scene.record.bending else None,
        grid=_grid(plate, resolution),
        rate_stress=scene.interaction.quadratic * plate.density,
        onset=scene.interaction.onset,
        by_path=plate.degradation_distance is not None,
        shots=conditions,
        rows=_most_steps(resolution, conditions) + 2 if traced else 0,  # the end, and a step that rounding may add
    )


def _grid(plate: Plate, resolution: Resolution) -> Grid:
    nodal = resolution.nodal
    cell = min(resolution.grid_spacing / FINER, plate.degradation_length / FINEST)
    tile = tile_of(plate, resolution.grid_spacing if nodal else cell, sharp=nodal)
    # Nodes of the literal scheme are the tile's cells, which fit the period.
    spacing = min(tile.dy, tile.dz) if nodal else resolution.grid_spacing
    size_y, size_z = plate.size or (math.inf, math.inf)
    return Grid(
        tile=tile,
        period=plate.pattern.period,
        half_size=(0.5 * size_y, 0.5 * size_z),
        spacing=spacing,
        taps=half_taps(0.0 if nodal else plate.degradation_length, spacing),
    )


def half_taps(length: float, spacing: float) -> Array:
    """The filter of a degradation length [m] on a grid as the kernels read it: from its middle on, and one 0."""
    taps = tent_taps(length, spacing)
    return np.append(taps[len(taps) // 2 :], 0.0)


def _conditions(scene: Scene, resolution: Resolution, shots: Shots) -> dict[str, Array]:
    """What every shot is computed with, under the names of the kernels' Shots; of shape [1] where all share it."""
    core, plate, body = scene.core, scene.target.plate, scene.core.mass_properties
    thickness, degradation = shots.own("thickness", plate.thickness), shots.own("degradation", plate.degradation)
    mass, passage = shots.own("mass", body.mass), resolution.passage(thickness)
    scale = mass / body.mass  # of the body as a whole, so of its moments of inertia, too
    a0, a1, _ = scene.interaction.coefficients(shots.own("resistance", plate.resistance), plate.density)
    return shots.columns | {
        "thickness": thickness,
        "mass": mass,
        "inertia_axial": scale * body.inertia_axial,
        "inertia_transverse": scale * body.inertia_transverse,
        "a0": a0,
        "a1": a1,
        "strength": shots.own("strength", UNBREAKABLE if core.strength is None else core.strength),
        "friction": shots.own("shear_coefficient", plate.shear_coefficient),
        "decay_rate": decay_rate(degradation, plate.degradation_unit),
        "degradation": degradation,
        "onset_jump": onset_jump(core, thickness, mass, a0),
        "way": resolution.travel * passage,
        "longest_time": resolution.longest_time(degradation, plate, shots.velocity),
        "longest_step": passage,
        "longest_way": STEP_ALLOWANCE * (thickness + 2.0 * core.bounding_radius),
    }


def _most_steps(resolution: Resolution, conditions: dict[str, Array]) -> int:
    """Steps after which any of the shots is given up."""
    names = ("velocity", "obliquity", "thickness", "longest_time")
    step = resolution.step_at(*(conditions[name] for name in names))
    return math.ceil(float((conditions["longest_way"] / (conditions["velocity"] * step)).max()))


def onset_jump(core: Core, thickness: Array, mass: Array, static_stress: Array) -> Array:
    """Onset speed of contact per time step [m/s²] of cores of some masses [kg] in plates of some thicknesses [m] and
    static stresses [Pa], of their shape; positive, also for a plate without resistance."""
    wall = 2.0 * core.max_radius * np.minimum(thickness, core.length)
    return np.maximum(ONSET * static_stress * wall / mass, 1.0)
