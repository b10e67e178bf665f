"""Plates as the kernels see them: the tile, and the grid of the exposure with its filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.solver.cover import Cover, Pushed, cover_of
from warpimpact.solver.materials import ROUNDING
from warpimpact.solver.tile import Tile, tile_of

if TYPE_CHECKING:
    from warpimpact.scene import Plate
    from warpimpact.solver.materials import Materials
    from warpimpact.solver.resolution import Resolution

Array = NDArray[np.float64]

FINER = 5
"""Cells of the tile per cell of the exposure's grid, in each direction. A patch reads the cell under its centre."""
FINEST = 15.0
"""Fewest cells of the tile per degradation length: the edge of a hole decides more about tilt than the grid does."""
SHARED = 4
"""Cells of shared tiles per factor of two."""

FEWEST_PLANES, PLANES = 3, 1.6
"""Per degradation depth: at least, and times the square root of its steps, as planes err by the fourth order of their
distance and steps by the second of theirs. Twice as many change no answer by a tenth of its error (oblique, slots)."""
SPARE = 4
"""Planes beyond those within a laminate: one on each side, the one behind the last whole spacing, and its neighbour."""


class Lengths(NamedTuple):
    """Over which a layer weakens together: `length` in its plane and `depth` through its thickness [m]."""

    length: float
    depth: float


class Planes(NamedTuple):
    """Planes of a window through the thickness: their number, the `spacing` between two [m], and how many of them a
    degradation depth has. One stands for the whole thickness."""

    number: int = 1
    spacing: float = math.inf
    reach: int = 0


WHOLE = Planes()


@dataclass(frozen=True)
class Grid:
    """A plate as the kernels see it.

    Attributes:
        tile: one period of it.
        period, half_size: extents (y, z) of the period, and half of those of the plate [m]; infinite without a rim.
        spacing: of the window's grid [m].
        taps: the tent's filter from its middle on, and one 0.
        planes: of the window's grid through the thickness.
        cover: material along a normal, where a free surface counts.
    """

    tile: Tile
    period: tuple[float, float]
    half_size: tuple[float, float]
    spacing: float
    taps: Array
    planes: Planes = WHOLE
    cover: Cover | None = None

    @property
    def tiles(self) -> list[Tile]:
        """What is computed before the first shot."""
        return [self.tile] if self.cover is None else [self.tile, self.cover]

    @property
    def reach(self) -> int:
        """Reach of the filter [nodes], at least 1."""
        return max(1, len(self.taps) - 2)


def grids_of(
    layers: Sequence[Plate],
    materials: Sequence[Materials],
    resolution: Resolution,
    lengths: Sequence[Lengths],
    *,
    deep: bool,
    shared: bool,
    cover: Pushed | None,
) -> list[Grid]:
    """The grids of some layers, whose cells are as wide as their degradation lengths have it.

    Args:
        lengths: over which the layers weaken, in the place of their own.
        deep: whether windows have planes through the thickness.
        shared: whether plates of other degradation lengths have the same tiles, in finer cells than they need.
        cover: what their covers depend on; None without a free surface.
    """
    return [
        _grid(plate, resolution, reach, reach.length / lengths[0].length, material if deep else None, shared, cover)
        for plate, reach, material in zip(layers, lengths, materials, strict=True)
    ]


def _grid(
    plate: Plate,
    resolution: Resolution,
    own: Lengths,
    wider: float,
    deep: Materials | None,
    shared: bool,
    cover: Pushed | None,
) -> Grid:
    """The grid of a layer with some degradation lengths. Its cells are `wider` times as wide as those of the plate.

    Args:
        deep: its material, where windows have planes through the thickness.
    """
    nodal, spacing = resolution.nodal, wider * resolution.grid_spacing
    cells = spacing if nodal else min(spacing / FINER, own.length / FINEST)
    if shared:
        cells = 2.0 ** (math.floor(SHARED * math.log2(cells)) / SHARED)
    taps = half_taps(0.0 if nodal else own.length, spacing)
    planes = WHOLE if deep is None else _planes(own.depth, deep, resolution)
    tile = tile_of(plate, cells, sharp=nodal, double=resolution.double)
    if nodal:  # its nodes are the tile's cells, which fit the period
        spacing = min(tile.dy, tile.dz)
    size_y, size_z = plate.size or (math.inf, math.inf)
    return Grid(
        tile=tile,
        period=plate.pattern.period,
        half_size=(0.5 * size_y, 0.5 * size_z),
        spacing=spacing,
        taps=taps,
        planes=planes,
        cover=None if cover is None else cover_of(plate, cells, cover, double=resolution.double),
    )


def half_taps(length: float, spacing: float) -> Array:
    """The filter of a degradation length [m] on a grid as the kernels read it: from its middle on, and one 0."""
    taps = tent_taps(length, spacing)
    return np.append(taps[len(taps) // 2 :], 0.0)


def _planes(depth: float, material: Materials, resolution: Resolution) -> Planes:
    """Those of a layer with a degradation depth [m], which the step of a plate as thick as that refines."""
    way = resolution.travel * float(resolution.passage(depth, depth, weakens=True))
    reach = max(FEWEST_PLANES, math.ceil(PLANES * math.sqrt(depth / way)))
    most = float(material.together.max()) / depth if material.weakens else 0.0
    return Planes(math.floor(most * reach + ROUNDING) + SPARE, depth / reach, reach)


def tent_taps(length: float, cell: float) -> Array:
    """Weights of a discrete filter. Together with bilinear scattering and bilinear reading it acts as the tent K of
    half-width ℓ.

    Scattering and reading each add cell²/6 to the second moment, on average. The half-width of the filter is adjusted
    so that mass and second moment, ℓ²/6, are exact in total. If ℓ is at most √2 cells, there is nothing to filter.
    """
    if length <= math.sqrt(2.0) * cell:
        return np.ones(1)

    moment = (length / cell) ** 2 / 6.0 - 1.0 / 3.0  # of the filter, in cells
    for reach in range(1, math.ceil(length / cell) + 1):
        # Σ(1 - |k|/w) k² = moment Σ(1 - |k|/w) over |k| <= reach is linear in 1/w.
        points, ramp = 2 * reach + 1, reach * (reach + 1)
        half_width = ramp * (0.5 * ramp - moment) / (points * (ramp / 3.0 - moment))
        if reach < half_width + 1e-9 <= reach + 1 + 2e-9:
            break
    weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / half_width
    return np.asarray(weights / weights.sum())
