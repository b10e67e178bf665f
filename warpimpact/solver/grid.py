"""Plates as the kernels see them: one period of material fractions, and the grid of the exposure with its filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene.patterns import WHOLE_CELL
from warpimpact.solver.device import SMALL, free_memory
from warpimpact.solver.keys import Key
from warpimpact.solver.materials import ROUNDING

if TYPE_CHECKING:
    from warpimpact.scene import Pattern, Plate
    from warpimpact.solver.materials import Materials
    from warpimpact.solver.resolution import Resolution

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Counts = NDArray[np.int16]
Real = type[np.floating[Any]]

FINER = 5
"""Cells of the tile per cell of the exposure's grid, in each direction. A patch reads the cell under its centre."""
FINEST = 15.0
"""Fewest cells of the tile per degradation length: the edge of a hole decides more about tilt than the grid does."""
SHARED = 4
"""Cells of shared tiles per factor of two."""
BLUR = 3
"""Cells of the tile over which its material is averaged, in each direction: a patch then crosses an edge gradually.
Odd."""
BLOCKS = 96
"""Largest number of blocks of a period, in each direction, in the search for the clearance."""

FEWEST_PLANES, PLANES = 3, 1.6
"""Per degradation depth: at least, and times the square root of its steps, as planes err by the fourth order of their
distance and steps by the second of theirs. Twice as many change no answer by a tenth of its error (oblique, slots)."""
SPARE = 4
"""Planes beyond those within a laminate: one on each side, the one behind the last whole spacing, and its neighbour."""


@dataclass(frozen=True, eq=False)
class Tile:
    """One period of the pristine plate: material fractions, shape [cells_y, cells_z], cells of dy × dz [m]. Both arrays
    have the floating-point type of the kernels."""

    material: Floats
    dy: float
    dz: float

    @cached_property
    def clearance(self) -> Floats:
        """Lower bound of every cell's distance from the material of the whole lattice [m], shape of `material`."""
        # The search runs over blocks of cells. A block with any material is a wall.
        rows, columns = self.material.shape
        block = (math.ceil(rows / BLOCKS), math.ceil(columns / BLOCKS))
        wall = _any_of(_any_of(self.material > 0.0, block[0]).T, block[1]).T
        if not wall.any():
            return np.full_like(self.material, math.inf)
        widths = (self.dy * rows / len(wall), self.dz * columns / wall.shape[1])
        own = nearest_wall(wall, widths)
        # Two blocks are subtracted, as distances are from centre to centre and the last block of a period may be
        # narrower.
        kept = np.maximum(0.0, own - 2.0 * math.hypot(self.dy * block[0], self.dz * block[1]))
        every = kept.astype(self.material.dtype).repeat(block[1], axis=1)[:, :columns].repeat(block[0], axis=0)[:rows]
        return np.asarray(every)


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


def grids_of(
    layers: Sequence[Plate],
    materials: Sequence[Materials],
    resolution: Resolution,
    lengths: Sequence[Lengths],
    *,
    deep: bool,
    shared: bool,
) -> list[Grid]:
    """The grids of some layers, whose cells are as wide as their degradation lengths have it.

    Args:
        lengths: over which the layers weaken, in the place of their own.
        deep: whether windows have planes through the thickness.
        shared: whether plates of other degradation lengths have the same tiles, in finer cells than they need.

    Raises:
        MemoryError: as `tile_of`.
    """
    return [
        _grid(plate, resolution, own, own.length / lengths[0].length, material if deep else None, shared)
        for plate, own, material in zip(layers, lengths, materials, strict=True)
    ]


def _grid(
    plate: Plate, resolution: Resolution, own: Lengths, wider: float, deep: Materials | None, shared: bool
) -> Grid:
    """The grid of a layer with some degradation lengths, whose cells are so many times as wide as those of the plate.

    Args:
        deep: its material, where windows have planes through the thickness.
    """
    nodal, spacing = resolution.nodal, wider * resolution.grid_spacing
    cells = spacing if nodal else min(spacing / FINER, own.length / FINEST)
    if shared:
        cells = 2.0 ** (math.floor(SHARED * math.log2(cells)) / SHARED)
    tile = tile_of(plate, cells, sharp=nodal, double=resolution.double)
    if nodal:  # its nodes are the tile's cells, which fit the period
        spacing = min(tile.dy, tile.dz)
    size_y, size_z = plate.size or (math.inf, math.inf)
    return Grid(
        tile=tile,
        period=plate.pattern.period,
        half_size=(0.5 * size_y, 0.5 * size_z),
        spacing=spacing,
        taps=half_taps(0.0 if nodal else own.length, spacing),
        planes=WHOLE if deep is None else _planes(own.depth, deep, resolution),
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


def tile_of(plate: Plate, spacing: float, *, sharp: bool = False, double: bool = False) -> Tile:
    """Material fraction about every cell of one period; cell (0, 0) has its corner at the origin.

    Cells are at most `spacing` wide and fit the period; fractions are means over BLUR × BLUR cells. `sharp` takes each
    cell's centre alone, as the literal scheme does, and `double` has them in float64.

    Raises:
        MemoryError: the tile does not fit; the message is for the user.
    """
    return _tile(Key(plate.pattern), spacing, sharp, np.float64 if double else np.float32)


@lru_cache(maxsize=16)
def _tile(key: Key[Pattern], spacing: float, sharp: bool, real: Real) -> Tile:
    """The tile of a pattern, kept for later shots at the same plate."""
    pattern = key.value
    period_y, period_z = pattern.period
    # An even number, so that a row staggered by half a period sees the same cells.
    step = 1 if sharp else 2
    count_y, count_z = (step * max(1, math.ceil(p / (step * spacing) - 1e-9)) for p in (period_y, period_z))
    dy, dz = period_y / count_y, period_z / count_z
    needed = 3 * 8 * count_y * count_z
    if needed > SMALL and needed > (free := free_memory()):
        raise MemoryError(
            "numerics.grid_spacing or plate.degradation_length, which determines it, is too small: the period of the "
            f"plate, {period_y:g} m x {period_z:g} m, needs {needed / 2**30:.3g} GiB in cells of {spacing:.3g} m, and "
            f"{free / 2**30:.3g} GiB are free"
        )
    if sharp:
        return Tile(_sharp(pattern, count_y, count_z).astype(real), dy, dz)
    return Tile(_blurred(pattern.shares_in_holes((count_y, count_z), (dy, dz)), real), dy, dz)


def _sharp(pattern: Pattern, count_y: int, count_z: int) -> NDArray[np.bool_]:
    """Whether the centres of so many cells of a period are material."""
    y, z = (
        np.float64(side / count) * (np.arange(count) + 0.5)
        for side, count in zip(pattern.period, (count_y, count_z), strict=True)
    )
    return ~np.stack([pattern.is_hole(y[k : k + 1], z) for k in range(count_y)])


def _blurred(inside: Counts, real: Real) -> Floats:
    """Means of material over BLUR × BLUR cells of a period: sums of whole numbers, which floats of 32 bits hold
    exactly, and one division.

    Args:
        inside: share of each cell in holes, in parts of WHOLE_CELL.
    """
    rows, columns = inside.shape
    wide = (WHOLE_CELL - np.pad(inside, BLUR // 2, mode="wrap")).astype(real)
    material = _sums(_sums(wide, rows).T, columns).T
    material /= BLUR**2 * WHOLE_CELL
    return material


def _sums(values: Floats, count: int) -> Floats:
    """Sums over BLUR neighbours along the first axis."""
    sums: Floats = np.array(values[:count])
    for k in range(1, BLUR):
        sums += values[k : k + count]
    return sums


def _any_of(marked: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Whether any of so many rows in a row is marked, column by column; the last ones may be fewer."""
    found = marked[::size].copy()
    for part in (marked[k::size] for k in range(1, size)):
        found[: len(part)] |= part
    return found


def nearest_wall(wall: NDArray[np.bool_], widths: tuple[float, float]) -> Array:
    """Distance [m] of every block of one period from the nearest wall of the lattice, centre to centre, for blocks of
    these widths: first along z, then over all rows. At least one block is a wall.

    scipy.ndimage has this, too, but a run would wait a quarter of a second for its import.
    """
    rows, columns = wall.shape
    number, walls = np.arange(3 * columns), np.tile(wall, 3)
    before = np.maximum.accumulate(np.where(walls, number, -math.inf), axis=1)
    behind = np.minimum.accumulate(np.where(walls, number, math.inf)[:, ::-1], axis=1)[:, ::-1]
    along = np.minimum(number - before, behind - number)[:, columns : 2 * columns] * widths[1]
    nearest = np.full((rows, columns), math.inf)
    square = np.tile(np.square(along), (3, 1))
    for shift in range(rows // 2 + 1):
        if (beyond := (shift * widths[0]) ** 2) >= nearest.max():
            break
        below, above = (square[rows + way : 2 * rows + way] for way in (-shift, shift))
        nearest = np.minimum(nearest, beyond + np.minimum(below, above))
    return np.asarray(np.sqrt(nearest))


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
