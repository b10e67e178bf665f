"""From a scene, its shots and numerics to the plain arrays that the kernels read: the one place where all choices are
made, for those who build, march or describe."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.variant import Variant
from warpimpact.scene import exclusions as asked
from warpimpact.scene.quantities import BY_LAYER
from warpimpact.solver.bending import Sections, sections_of
from warpimpact.solver.blocks import block_window, first_window
from warpimpact.solver.depth import WHOLE, Planes, is_deep, laminates_of, planes_of, thicknesses_of
from warpimpact.solver.materials import Materials, materials_of
from warpimpact.solver.resolution import Resolution, resolve, weakens
from warpimpact.solver.rings import Rings, azimuths_of, rings_of
from warpimpact.solver.tile import FINER, FINEST, Tile, tent_taps, tile_of

if TYPE_CHECKING:
    from warpimpact.scene import Core, Numerics, Plate, Scene, Shots

Array = NDArray[np.float64]

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
        planes: of the window's grid through the thickness.
    """

    tile: Tile
    period: tuple[float, float]
    half_size: tuple[float, float]
    spacing: float
    taps: Array
    planes: Planes = WHOLE

    @property
    def reach(self) -> int:
        """Reach of the filter [nodes], at least 1."""
        return max(1, len(self.taps) - 2)


@dataclass(frozen=True)
class Prepared:
    """A scene and its shots as the kernels see them: SI and radians.

    Attributes:
        scene, shots: what was prepared.
        resolution: its numerics with every choice made.
        variant: the build of the kernels that the scene needs.
        core, rings: the core, and its surface.
        azimuths: of the patches of even rings, then of odd rings [rad], shape [2 around].
        sections: of the core behind the rings; None where it does not bend.
        grids: the plate, and the layers behind it.
        materials: of the plate, and of the layers behind it.
        laminates: for every layer, the first one of those with which it shares the memory of contact.
        onset: κ of the law.
        conditions: every member of the kernels' Shots (kernels/shots.py), each of shape [1] or [shots].
        cells: nodes of a first window, in each direction.
        layer_standoffs: distances behind the rear face of every layer [m].
        ahead: of the centre of mass, the point that passes stand-offs [m].
        rows: of the trace of each shot; 0 for none.
    """

    scene: Scene
    shots: Shots
    resolution: Resolution
    variant: Variant
    core: Core
    rings: Rings
    azimuths: Array
    sections: Sections | None
    grids: list[Grid]
    materials: list[Materials]
    laminates: list[int]
    onset: float
    conditions: dict[str, Array]
    cells: int
    layer_standoffs: Array
    ahead: float
    rows: int = 0

    @property
    def grid(self) -> Grid:
        """The plate."""
        return self.grids[0]


def prepare(scene: Scene, shots: Shots, numerics: Numerics) -> Prepared:
    """Make every choice for some shots.

    Args:
        numerics: those of a resolution; for an accuracy a pilot finds it first.

    Raises:
        ValueError: the numerics fix no resolution; they cannot compute the bending moment that the scene records,
            several shots at one plate or layers; or the block layout does not compute the scene.
        MemoryError: the plate's period does not fit at the grid spacing.
    """
    core, target, record = scene.core, scene.target, scene.record
    if numerics.explicit is None:
        raise ValueError("got numerics with an accuracy, but this needs a resolution: give a level or single settings")
    weakening = weakens(target, shots)
    resolution = resolve(scene, numerics, weakening)
    nodal, around = resolution.nodal, resolution.patches_around
    materials = materials_of(scene, shots)
    laminates = laminates_of(target, materials)
    thicknesses = thicknesses_of(laminates, materials)
    deep = is_deep(target, thicknesses)
    asked.check_together(
        {
            asked.NODAL: nodal,
            asked.BLOCK: resolution.block,
            asked.DOUBLE: resolution.double,
            asked.BENDING: record.bending,
            asked.LAYERS: len(target.layers) > 1,
            asked.BURST: shots.at_a_plate > 1,
            asked.DEEP: deep,
        }
    )
    rings = rings_of(core, resolution.patches_axial, around, resolution.patch_width, discs=not nodal)
    conditions = _conditions(scene, resolution, shots, materials)
    variant = _variant(resolution, scene, shots, degrades=any(weakening), deep=deep)
    grids = [
        _grid(plate, resolution, plate.degradation_length / target.layers[0].degradation_length, planes)
        for plate, planes in zip(target.layers, planes_of(target, thicknesses, resolution), strict=True)
    ]
    thickness = thicknesses[0] or float(materials[0].thickness.max())
    cells = first_window(core, shots, thickness, grids[0].spacing, grids[0].reach, nodal=nodal)
    if resolution.block:
        variant = replace(variant, window=block_window(cells))
    return Prepared(
        scene=scene,
        shots=shots,
        resolution=resolution,
        variant=variant,
        core=core,
        rings=rings,
        azimuths=azimuths_of(around),
        sections=sections_of(core, rings) if record.bending else None,
        grids=grids,
        materials=materials,
        laminates=laminates,
        onset=scene.interaction.onset,
        conditions=conditions,
        cells=cells,
        layer_standoffs=np.array(record.layer_standoffs, dtype=np.float64),
        ahead=record.ahead(core),
    )


def _variant(resolution: Resolution, scene: Scene, shots: Shots, *, degrades: bool, deep: bool) -> Variant:
    """The build of the kernels that a scene needs."""
    plates, interaction = scene.target.layers, scene.interaction
    return Variant(
        double=resolution.double,
        nodal=resolution.nodal,
        degrades=degrades,
        rubs=any(one.shear_coefficient > 0.0 or shots.differs("shear_coefficient", k) for k, one in enumerate(plates)),
        rate_dependent=interaction.linear > 0.0 or interaction.quadratic > 0.0,
        rimmed=any(plate.size is not None for plate in plates),
        bends=scene.record.bending,
        layered=len(plates) > 1,
        deep=deep,
        burst=degrades and shots.at_a_plate > 1,
    )


def _grid(plate: Plate, resolution: Resolution, wider: float, planes: Planes) -> Grid:
    """The grid of a layer, whose cells are so many times as wide as those of the plate."""
    nodal, spacing = resolution.nodal, wider * resolution.grid_spacing
    tile = tile_of(plate, spacing if nodal else min(spacing / FINER, plate.degradation_length / FINEST), sharp=nodal)
    if nodal:  # its nodes are the tile's cells, which fit the period
        spacing = min(tile.dy, tile.dz)
    size_y, size_z = plate.size or (math.inf, math.inf)
    return Grid(
        tile=tile,
        period=plate.pattern.period,
        half_size=(0.5 * size_y, 0.5 * size_z),
        spacing=spacing,
        taps=half_taps(0.0 if nodal else plate.degradation_length, spacing),
        planes=planes,
    )


def half_taps(length: float, spacing: float) -> Array:
    """The filter of a degradation length [m] on a grid as the kernels read it: from its middle on, and one 0."""
    taps = tent_taps(length, spacing)
    return np.append(taps[len(taps) // 2 :], 0.0)


def _conditions(scene: Scene, resolution: Resolution, shots: Shots, materials: list[Materials]) -> dict[str, Array]:
    """What every shot is computed with, under the names of the kernels' Shots; of shape [1] where all share it.

    The layer that needs the shortest step sets the step.
    """
    core, target, body = scene.core, scene.target, scene.core.mass_properties
    mass, depth = shots.own("mass", body.mass), materials[-1].front + materials[-1].thickness
    passage = _least(
        resolution.passage(material.thickness, layer, weakens=material.weakens)
        for material, layer in zip(materials, target.layers, strict=True)
    )
    times = (
        resolution.longest_time(material.degradation, layer, shots.velocity, mass, material.a0)
        for material, layer in zip(materials, target.layers, strict=True)
    )
    scale = mass / body.mass  # of the body as a whole, so of its moments of inertia, too
    gaps = sum(target.gaps)
    return {name: values for name, values in shots.columns.items() if name not in BY_LAYER} | {
        "mass": mass,
        "inertia_axial": scale * body.inertia_axial,
        "inertia_transverse": scale * body.inertia_transverse,
        "strength": shots.own("strength", UNBREAKABLE if core.strength is None else core.strength),
        "way": resolution.travel * passage,
        "longest_time": _least(times),
        "longest_step": passage,
        "longest_way": STEP_ALLOWANCE * (depth - gaps + 2.0 * len(materials) * core.bounding_radius) + gaps,
    }


def _least(values: Iterable[Array]) -> Array:
    return np.asarray(reduce(np.minimum, values))
