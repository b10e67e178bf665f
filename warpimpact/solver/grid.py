"""Plates as the kernels see them: tile, grid of the exposure with its filter, and windows of it about a hit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Core, Plate, Shots
from warpimpact.solver.cover import Cover, CoverRule, cover_of
from warpimpact.solver.resolution import Materials, Resolution
from warpimpact.solver.tile import Tile, tile_of

Array = NDArray[np.float64]

FINER = 5
"""Cells of the tile per cell of the exposure's grid, in each direction. A patch reads the tile's cell under its
centre."""
FINEST = 15.0
"""Fewest cells of the tile per degradation length. The edge of a hole affects tilt more than the grid does."""

Counts = NDArray[np.int64]

SIZES = (1024, 2048, 3072, 4096, 6144)
"""Sizes of windows in the block layout [nodes]; each is compiled by itself. Two float32 fields of the largest fill the
48 KiB of shared memory that a block has on every CUDA device."""
SLACK, NODAL_SLACK = 1.6, 1.2
"""Half the width of a first window for a straight shot, in radii of the core. It is smaller in the literal scheme, on
whose fine grid large windows cost more time than the repetition of some shots."""
WIDER_BEHIND = 0.6
"""Half of the difference between the widths of the first windows of a layer and of the plate, in largest distances of
the core's surface from its centre of mass: the core arrives turned."""


@dataclass(frozen=True)
class Grid:
    """A plate as the kernels see it.

    Attributes:
        tile: one period of the plate.
        period, half_size: extents (y, z) of the period, and half extents of the plate [m]; infinite without a rim.
        spacing: spacing of the window's grid [m].
        taps: weights of the tent filter from its middle on, and one 0.
        cover: material along a normal, where a free surface counts.
    """

    tile: Tile
    period: tuple[float, float]
    half_size: tuple[float, float]
    spacing: float
    taps: Array
    cover: Cover | None = None

    @property
    def tiles(self) -> list[Tile]:
        """Tiles that are computed before the first shot."""
        return [self.tile] if self.cover is None else [self.tile, self.cover]

    @property
    def reach(self) -> int:
        """Reach of the filter [nodes], at least 1."""
        return max(1, len(self.taps) - 2)


def grids_of(layers: Sequence[Plate], resolution: Resolution, cover: CoverRule | None) -> list[Grid]:
    """The grids of some layers. The width of their cells is proportional to their degradation lengths.

    Args:
        cover: what the covers depend on; None without a free surface.
    """
    grids, nodal = [], resolution.nodal
    for plate in layers:
        length = plate.degradation_length
        spacing = length / layers[0].degradation_length * resolution.grid_spacing
        cells = spacing if nodal else min(spacing / FINER, length / FINEST)
        tent = tent_taps(0.0 if nodal else length, spacing)
        tile = tile_of(plate, cells, sharp=nodal, double=resolution.double)
        if nodal:  # its nodes are the tile's cells, which fit the period
            spacing = min(tile.dy, tile.dz)
        size_y, size_z = plate.size or (math.inf, math.inf)
        grids.append(
            Grid(
                tile=tile,
                period=plate.pattern.period,
                half_size=(0.5 * size_y, 0.5 * size_z),
                spacing=spacing,
                taps=np.append(tent[len(tent) // 2 :], 0.0),
                cover=None if cover is None else cover_of(plate, cells, cover, double=resolution.double),
            )
        )
    return grids


def tent_taps(length: float, cell: float) -> Array:
    """Weights of a discrete filter. Together with bilinear scattering and bilinear reading it acts as the tent K of
    half-width ℓ.

    Scattering and reading each add cell²/6 to the second moment, on average. The half-width of the filter is adjusted
    so that mass and second moment, ℓ²/6, are exact in total. If ℓ is at most √2 cells, there is nothing to filter.
    """
    if length <= math.sqrt(2.0) * cell:
        return np.ones(1)

    moment = (length / cell) ** 2 / 6.0 - 1.0 / 3.0  # second moment of the filter, in cells
    for reach in range(1, math.ceil(length / cell) + 1):
        # Σ(1 - |k|/w) k² = moment Σ(1 - |k|/w) over |k| <= reach is linear in 1/w.
        points, ramp = 2 * reach + 1, reach * (reach + 1)
        half_width = ramp * (0.5 * ramp - moment) / (points * (ramp / 3.0 - moment))
        if reach < half_width + 1e-9 <= reach + 1 + 2e-9:
            break
    weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / half_width
    return np.asarray(weights / weights.sum())


def first_windows(core: Core, shots: Shots, material: Materials, grid: Grid, *, nodal: bool) -> Counts:
    """Nodes, in each direction, of a window that holds the footprint of a core that keeps its attitude through the
    plate; shape [shots]. Layers behind it have windows of their own.

    Args:
        material, grid: of the plate.
    """
    slack = NODAL_SLACK if nodal else SLACK
    turned = np.minimum(1.0, np.sin(np.hypot(shots.pitch, shots.yaw)))
    half = (
        slack * core.max_radius / np.cos(shots.obliquity)
        + material.thickness * np.tan(shots.obliquity)
        + core.bounding_radius * turned
    )
    return np.asarray(2 * (np.ceil(half / grid.spacing).astype(np.int64) + 2 * grid.reach + 3))


def block_window(cells: int) -> int:
    """Nodes of the smallest block window that holds cells × cells nodes; 0 if none does."""
    return next((size for size in SIZES if size >= cells**2), 0)
