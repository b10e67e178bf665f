"""From a scene, its shots and numerics to the plain arrays that the kernels read. All choices are made here, once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.variant import Variant
from warpimpact.scene import Scene, Shots, exclusions
from warpimpact.scene.interaction import TERMS
from warpimpact.solver.cover import CoverRule
from warpimpact.solver.grid import WIDER_BEHIND, Grid, block_window, first_windows, grids_of
from warpimpact.solver.resolution import (
    Materials,
    Resolution,
    conditions_of,
    layer_steps,
    materials_of,
    resolve,
    steps_of,
)
from warpimpact.solver.rings import Rings, Sections, rings_of, sections_of
from warpimpact.solver.settings import FastLawSettings
from warpimpact.solver.tile import Tile, check_tiles

Array = NDArray[np.float64]

PER_BYTE, PER_PATCH, PER_NODE = 1.7e-10, 2.8e-9, 1.5e-9
"""Seconds that a core takes: to open a window, per byte; for a step, per patch and per node under the core
(tests/benchmarks/NOTES.md)."""


@dataclass(frozen=True)
class Cost:
    """What a shot takes, foreseen: time of a core [s], and memory [bytes]."""

    seconds: float
    bytes: int


class Surface(NamedTuple):
    """A core in patches: its rings, with so many patches around; and the sections behind them, None without bending."""

    rings: Rings
    around: int
    sections: Sections | None


@dataclass(frozen=True)
class Prepared:
    """A scene and its shots as the kernels see them: SI and radians.

    Attributes:
        scene, shots: the scene and its shots.
        resolution: the numerics with every choice made.
        variant: build of the kernels that the scene needs.
        surface: surface of the core.
        grids: grids of all layers.
        materials: materials of all layers; the plate is the first.
        conditions: every member of the kernels' Shots (kernels/target.py), each of shape [1] or [shots].
        stretch: length of a step in each layer over that of the shortest (kernels/structs.py, Target), each of shape
            [1] or [shots].
        steps: largest number of steps of an unhindered passage.
        first_cells: nodes of the first window of the plate in each direction, as each shot needs it, shape [shots].
        rows: rows of the trace of each shot; 0 for none.
        slide: whether windows behind several layers follow a core that leaves them. Snapshots need all that it passed.
    """

    scene: Scene
    shots: Shots
    resolution: Resolution
    variant: Variant
    surface: Surface
    grids: list[Grid]
    materials: list[Materials]
    conditions: dict[str, NDArray[Any]]
    stretch: list[Array]
    steps: int
    first_cells: NDArray[np.int64]
    rows: int = 0
    slide: bool = True

    @property
    def grid(self) -> Grid:
        """Grid of the plate."""
        return self.grids[0]

    @property
    def tiles(self) -> set[Tile]:
        """Tiles of all plates."""
        return {tile for grid in self.grids for tile in grid.tiles}

    @property
    def cells(self) -> int:
        """Nodes, in each direction, of a first window of the plate that serves all shots."""
        return int(self.first_cells.max())

    def windows(self, cells: int) -> NDArray[np.int64]:
        """Nodes of the windows of all layers in each direction, for those of the plate's window; 0 where a layer keeps
        no field."""
        return np.asarray(self.windows_behind(np.array([cells])).max(axis=1))

    def windows_behind(self, plate: NDArray[np.int64]) -> NDArray[np.int64]:
        """Nodes of the windows of all layers, in each direction, shape [layers, shots]; 0 where a layer keeps no field.

        Args:
            plate: nodes of the plate's windows in each direction, shape [1] or [shots].
        """
        front, core = self.materials[0], self.scene.core
        steep, counts = np.tan(self.shots.obliquity), [np.broadcast_to(plate, len(self.shots))]
        for material, grid in zip(self.materials[1:], self.grids[1:], strict=True):
            thicker = np.maximum(0.0, material.thickness - front.thickness)
            half = 0.5 * counts[0] * self.grid.spacing + WIDER_BEHIND * core.bounding_radius + thicker * steep
            count = 2 * (np.ceil(half / grid.spacing).astype(np.int64) + 2 * len(grid.taps) + 3)
            counts.append(count if material.weakens else np.zeros_like(counts[0]))
        return np.stack(counts)

    def nodes(self, cells: int) -> int:
        """Nodes of a shot in the windows of all layers."""
        return int((self.windows(cells) ** 2).sum())

    @property
    def cost(self) -> Cost:
        """What a core takes for a shot that passes all layers, roughly; the same on every machine."""
        core, shots, size = self.scene.core, self.shots, 8 if self.variant.double else 4
        nodes = self.nodes(self.cells) if self.variant.degrades else 0  # each has an exposure and its gain
        patches, steps = len(self.surface.rings.station) * self.resolution.patches_around, 0.0
        for material, grid, stretch in zip(self.materials, self.grids, self.stretch, strict=True):
            way = stretch * self.conditions["time_step"] * shots.velocity * np.cos(shots.obliquity)
            below = (2.0 * core.max_radius / grid.spacing) ** 2 if material.weakens else 0.0
            passage = float(np.mean((material.thickness + core.length) / way))
            steps += passage * (PER_PATCH * patches + PER_NODE * below)
        return Cost(PER_BYTE * 2 * size * nodes + steps, 2 * size * nodes)


def prepare(scene: Scene, shots: Shots, numerics: FastLawSettings) -> Prepared:
    """Make every choice for some shots.

    Args:
        numerics: numerics that fix a resolution. For an accuracy, a pilot finds them first.

    Raises:
        ValueError: the numerics fix no resolution; they cannot compute the bending moment that the scene records,
            or layers; or the block layout does not compute the scene.
        TooLong: a shot would take months.
        MemoryError: the tiles of the plates take more memory or time than they may.
    """
    core, target, record, interaction = scene.core, scene.target, scene.record, scene.interaction
    if numerics.explicit is None:
        raise ValueError("got numerics with an accuracy, but this needs a resolution: give a level or single settings")
    materials = materials_of(scene, shots)
    weakening = [material.weakens for material in materials]
    resolution = resolve(scene, numerics, weakening)
    time_steps = layer_steps(scene, shots, materials, resolution)
    conditions: dict[str, NDArray[Any]] = conditions_of(scene, shots, materials, time_steps)
    steps = int(steps_of(shots, conditions).max())
    plates = list(enumerate(target.layers))
    exclusions.check_together(
        {
            exclusions.NODAL: resolution.nodal,
            exclusions.BLOCK: resolution.block,
            exclusions.DOUBLE: resolution.double,
            exclusions.BENDING: record.bending,
            exclusions.LAYERS: len(plates) > 1,
            exclusions.BY_PATH: any(material.by_path for material in materials),
            exclusions.FREE_SURFACE: interaction.free_surface is not None,
        }
    )
    # The build depends on which quantities may differ, not on their values, so a shot has the same bits in any company.
    free = interaction.free_surface
    cover = None if free is None else CoverRule(core.max_radius, free.carried, free.gap)
    grids = grids_of(target.layers, resolution, cover)
    check_tiles({tile: place for grid, (place, _) in zip(grids, target.named, strict=True) for tile in grid.tiles})
    first_cells = first_windows(core, shots, materials[0], grids[0], nodal=resolution.nodal)
    variant = Variant(
        double=resolution.double,
        nodal=resolution.nodal,
        degrades=any(weakening),
        rubs=any(plate.shear_coefficient > 0.0 or shots.varies("shear_coefficient", k) for k, plate in plates),
        rate_dependent=any(getattr(interaction, name) > 0.0 or name in shots.columns for name in TERMS[1:]),
        free_surface=interaction.free_surface is not None,
        rimmed=any(plate.size is not None for _, plate in plates),
        bends=record.bending,
        layered=len(plates) > 1,
        window=block_window(int(first_cells.max())) if resolution.block else 0,
    )
    around = resolution.patches_around
    rings = rings_of(core, resolution.patches_axial, around, resolution.patch_width, discs=not resolution.nodal)
    return Prepared(
        scene=scene,
        shots=shots,
        resolution=resolution,
        variant=variant,
        surface=Surface(rings, around, sections_of(core, rings) if record.bending else None),
        grids=grids,
        materials=materials,
        conditions=conditions,
        stretch=[step / conditions["time_step"] for step in time_steps],
        steps=steps,
        first_cells=first_cells,
    )
