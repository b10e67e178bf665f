"""From a scene and its shots to the plain arrays that the kernels read: the one place where it is resolved."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.variant import Variant
from warpimpact.scene.quantities import BY_LAYER
from warpimpact.solver.bending import Sections, check_bending, sections_of
from warpimpact.solver.blocks import SIMPLE_ONLY, check_layout, in_blocks
from warpimpact.solver.materials import Materials, materials_of
from warpimpact.solver.resolution import Resolution, resolve, weakens
from warpimpact.solver.rings import Rings, azimuths_of, rings_of
from warpimpact.solver.tile import FINER, FINEST, Tile, tent_taps, tile_of

if TYPE_CHECKING:
    from warpimpact.scene import Core, Numerics, Plate, Scene, Shots
    from warpimpact.solver.resolution import Fidelity

Array = NDArray[np.float64]

FEWEST_PLANES = 2
"""Per degradation depth."""
LARGEST_ONSET = 0.02
"""Bound of the onset speed, as a share of the impact velocity."""
STEP_ALLOWANCE = 200
"""How many times the way of an unhindered passage a shot may take, at impact velocity, before it is given up."""
UNBREAKABLE = 1.0e30
"""Strength of a core that has none [Pa], beyond any stress."""


class Planes(NamedTuple):
    """Planes of a window through the thickness: their number, the `spacing` between two [m], and how many of them a
    degradation depth has. One stands for the whole thickness."""

    number: int = 1
    spacing: float = math.inf
    reach: int = 0


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
    planes: Planes = Planes()

    @property
    def reach(self) -> int:
        """Reach of the filter [nodes], at least 1."""
        return max(1, len(self.taps) - 2)


@dataclass(frozen=True)
class Arrays:
    """A scene and its shots as the kernels see them: SI and radians.

    Attributes:
        resolution: the numerics with every choice made.
        variant: the build of the kernels that the scene needs.
        core, rings: the core, and its surface.
        azimuths: of the patches of even rings, then of odd rings [rad], shape [2 around].
        sections: of the core behind the rings; None where it does not bend.
        grids: the plate, and the layers behind it.
        materials: of the plate, and of the layers behind it.
        laminates: for every layer, the first one of those with which it shares the memory of contact.
        onset: κ of the law.
        shots: every member of the kernels' Shots (kernels/shots.py), each of shape [1] or [shots].
        rows: of the trace of each shot; 0 for none.
        layer_standoffs: distances behind the rear face of every layer [m].
        ahead: of the centre of mass, the point that passes stand-offs [m].
    """

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
    shots: dict[str, Array]
    rows: int
    layer_standoffs: Array
    ahead: float

    @property
    def grid(self) -> Grid:
        """The plate."""
        return self.grids[0]


def variant_of(resolution: Resolution, scene: Scene, shots: Shots, materials: list[Materials]) -> Variant:
    """The build of the kernels that a scene needs."""
    plates, interaction = scene.target.layers, scene.interaction
    degrades = any(weakens(scene.target, shots))
    return Variant(
        double=resolution.double,
        nodal=resolution.nodal,
        degrades=degrades,
        rubs=any(one.shear_coefficient > 0.0 or shots.differs("shear_coefficient", k) for k, one in enumerate(plates)),
        rate_dependent=interaction.linear > 0.0 or interaction.quadratic > 0.0,
        rimmed=any(plate.size is not None for plate in plates),
        deep=degrades and not resolution.nodal and _is_deep(scene, materials),
        bends=scene.record.bending,
        layered=len(plates) > 1,
        burst=degrades and shots.at_a_plate > 1,
    )


def arrays_of(scene: Scene, numerics: Numerics | Fidelity, shots: Shots, *, traced: bool = False) -> Arrays:
    """Resolve a scene for its shots.

    Args:
        traced: leave room for the history of every shot.

    Raises:
        ValueError: the numerics have no bending moment, which the scene records, or the block layout does not compute
            the scene.
        MemoryError: the plate's period does not fit at the grid spacing.
    """
    core, target, record = scene.core, scene.target, scene.record
    check_bending(record, numerics)
    resolution = resolve(numerics, scene, shots)
    nodal, around = resolution.nodal, resolution.patches_around
    rings = rings_of(core, resolution.patches_axial, around, resolution.patch_width, discs=not nodal)
    materials = materials_of(scene, shots)
    variant, laminates = variant_of(resolution, scene, shots, materials), laminates_of(scene, materials)
    conditions = _conditions(scene, resolution, shots, materials)
    arrays = Arrays(
        resolution=resolution,
        variant=variant,
        core=core,
        rings=rings,
        azimuths=azimuths_of(around),
        sections=sections_of(core, rings) if record.bending else None,
        grids=[
            _grid(layer, resolution, layer.degradation_length / target.layers[0].degradation_length, planes)
            for layer, planes in zip(target.layers, planes_of(variant, resolution, scene, materials), strict=True)
        ],
        materials=materials,
        laminates=laminates,
        onset=scene.interaction.onset,
        shots=conditions,
        rows=_most_steps(resolution, conditions) + 2 if traced else 0,  # the end, and a step that rounding may add
        layer_standoffs=np.array(record.layer_standoffs, dtype=np.float64),
        ahead=record.ahead(core),
    )
    if resolution.block:
        check_layout(**{name: getattr(arrays.variant, name) for name in SIMPLE_ONLY})
        return in_blocks(arrays, shots)
    return arrays


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


def laminates_of(scene: Scene, materials: list[Materials]) -> list[int]:
    """For every layer, the first one of its laminate: of layers that weaken, touch each other and remember alike. A
    laminate of one material is the plate of its thickness."""
    layers, first = scene.target.layers, [0]
    for k, (before, layer) in enumerate(pairwise(layers), start=1):
        both = materials[k - 1].weakens and materials[k].weakens and materials[k - 1].by_path == materials[k].by_path
        reaches = [(one.degradation_length, one.degradation_depth) for one in (before, layer)]
        touching = scene.target.gaps[k] == 0.0
        first.append(first[-1] if both and touching and reaches[0] == reaches[1] else k)
    return first


def _depths(scene: Scene, materials: list[Materials]) -> list[float]:
    """For every layer, the largest thickness of its laminate [m]."""
    first = laminates_of(scene, materials)
    rear = {k: material.front + material.thickness for k, material in zip(first, materials, strict=True)}
    return [float((rear[k] - materials[k].front).max()) for k in first]


def _is_deep(scene: Scene, materials: list[Materials]) -> bool:
    """Whether a laminate is thicker than the depth over which it weakens together, in any shot."""
    every = zip(scene.target.layers, materials, _depths(scene, materials), strict=True)
    return any(material.weakens and depth > layer.degradation_depth for layer, material, depth in every)


def planes_of(variant: Variant, resolution: Resolution, scene: Scene, materials: list[Materials]) -> list[Planes]:
    """The planes of all layers, about as far apart as a step goes, with one to spare before and behind."""
    planes = []
    for layer, material, thickness in zip(scene.target.layers, materials, _depths(scene, materials), strict=True):
        depth = layer.degradation_depth
        reach = max(FEWEST_PLANES, math.ceil(depth / float(resolution.travel * resolution.passage(thickness))))
        number = math.floor(thickness * reach / depth) + 4 if material.weakens else 4
        planes.append(Planes(number, depth / reach, reach) if variant.deep else Planes())
    return planes


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
    passage = _least(resolution.passage(one.thickness) for one in materials)
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


def _most_steps(resolution: Resolution, conditions: dict[str, Array]) -> int:
    """Steps after which any of the shots is given up."""
    names = ("velocity", "obliquity", "longest_step", "longest_time")
    step = resolution.step_at(*(conditions[name] for name in names))
    return math.ceil(float((conditions["longest_way"] / (conditions["velocity"] * step)).max()))
