"""The tile: one period of the pristine plate in cells. It is planned at once, and built later, where it can be
cancelled."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from warpimpact.errors import TooLong
from warpimpact.scene import Pattern, Plate
from warpimpact.scene.geometry import WHOLE_CELL
from warpimpact.scene.units import duration_text
from warpimpact.solver.device import SMALL_MEMORY, free_memory

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Counts = NDArray[np.int16]
Real = type[np.floating[Any]]
Check = Callable[[], object]
"""What is called often, and raises to end the work."""
Kept = TypeVar("Kept", bound="Tile")

BLUR = 3
"""Cells over which the material is averaged, in each direction, so that a patch crosses an edge gradually. Odd."""
CLEARANCE_BLOCKS = 96
"""Largest number of blocks of a period, in each direction, in the search for the clearance."""
CELLS_PER_CHECK = 2**22
"""Approximate number of cells that are computed between two checks for cancellation."""

MOST_BYTES, MOST_SECONDS = 2**31, 20.0
"""Bounds for all tiles of a target: memory, and foreseen time of a core. A plate of 0.5 m in cells of 1/15 of the usual
degradation length fits."""
PER_CELL, PER_SHARP_CELL = 5.0e-8, 1.0e-7
"""Seconds of a core per cell (tests/benchmarks/NOTES.md)."""
MOST_KEPT = 16
"""Most tiles, built or not, that are kept for later shots at the same plate."""


@dataclass(frozen=True, eq=False)
class Tile:
    """One period of the pristine plate: cells of dy × dz [m], `shape` along y and z. `material` is the material
    fraction of each cell; `clearance` is a lower bound of its distance from the material of the whole lattice [m]. Both
    have the shape `shape` and the floating-point type of the kernels, and are built when they are first read.

    Attributes:
        make: computes the material.
        seconds: rough time that it takes a core [s].
        size: size of a number [bytes].
    """

    shape: tuple[int, int]
    dy: float
    dz: float
    make: Callable[[Check], Floats]
    seconds: float = 0.0
    size: int = 8
    _building: Lock = field(default_factory=Lock)

    @property
    def bytes(self) -> int:
        """Memory of both arrays."""
        return 2 * self.size * math.prod(self.shape)

    @property
    def built(self) -> bool:
        """Whether the material is there."""
        return "material" in vars(self)

    def build(self, check: Check) -> None:
        """Compute the material once, whichever threads ask for it; `check` may cancel it."""
        with self._building:
            if not self.built:
                _make_room(self.bytes)
                vars(self)["material"] = self.make(check)

    @cached_property
    def material(self) -> Floats:
        return self.make(lambda: None)

    @cached_property
    def clearance(self) -> Floats:
        # The search runs over blocks of cells. A block with any material counts as a wall.
        rows, columns = self.shape
        block = (math.ceil(rows / CLEARANCE_BLOCKS), math.ceil(columns / CLEARANCE_BLOCKS))
        wall = np.logical_or.reduceat(self.material > 0.0, range(0, rows, block[0]), axis=0)
        wall = np.logical_or.reduceat(wall, range(0, columns, block[1]), axis=1)
        if not wall.any():
            return np.full_like(self.material, math.inf)
        widths = (self.dy * rows / len(wall), self.dz * columns / wall.shape[1])
        every_wall = ndimage.distance_transform_edt(~np.tile(wall, (3, 3)), sampling=widths)
        distance = every_wall[len(wall) : 2 * len(wall), wall.shape[1] : 2 * wall.shape[1]]
        # Distances are from centre to centre, and the last block of a period may be narrower, so two blocks are
        # subtracted.
        kept = np.maximum(0.0, distance - 2.0 * math.hypot(self.dy * block[0], self.dz * block[1]))
        every = kept.astype(self.material.dtype).repeat(block[1], axis=1)[:, :columns].repeat(block[0], axis=0)[:rows]
        return np.asarray(every)


def tile_of(plate: Plate, spacing: float, *, sharp: bool = False, double: bool = False) -> Tile:
    """The tile of a plate; cell (0, 0) has its corner at the origin. Nothing is computed yet.

    Cells are at most `spacing` wide and fit the period. Fractions are means over BLUR × BLUR cells; with `sharp` they
    are the material at the cell's centre, as in the literal scheme. `double` selects float64.
    """
    # Cells in pairs, so that a row staggered by half a period sees the same ones.
    pattern, step = plate.pattern, 1 if sharp else 2
    real: Real = np.float64 if double else np.float32
    count_y, count_z = (step * max(1, math.ceil(p / (step * spacing) - 1e-9)) for p in pattern.period)
    dy, dz = pattern.period[0] / count_y, pattern.period[1] / count_z
    make = partial(_sharp if sharp else _blurred, pattern, (count_y, count_z), (dy, dz), real)
    seconds = (PER_SHARP_CELL if sharp else PER_CELL) * count_y * count_z
    tile = Tile((count_y, count_z), dy, dz, make, seconds, np.dtype(real).itemsize)
    return cached_tile((pattern, spacing, sharp, real), tile)


def cached_tile(required: Any, planned: Kept) -> Kept:
    """The tile for a key: one that was planned before, or this one."""
    with _KEEPING:
        tile: Kept = _KEPT.pop(required, planned)
        _KEPT[required] = tile
        if len(_KEPT) > MOST_KEPT:
            _KEPT.popitem(last=False)
    return tile


_KEPT: OrderedDict[Any, Any] = OrderedDict()
_KEEPING = Lock()


def _make_room(needed: int) -> None:
    """Drop the tiles that were asked for longest ago, until another one of `needed` bytes fits."""
    with _KEEPING:
        for required in [required for required, tile in _KEPT.items() if tile.built]:
            if sum(tile.bytes for tile in _KEPT.values() if tile.built) + needed <= MOST_BYTES:
                break
            del _KEPT[required]


def check_tiles(tiles: Mapping[Tile, str]) -> None:
    """Refuse tiles that take more memory or time than allowed; the message is for the user.

    Args:
        tiles: tiles, with the places of their plates in a campaign.

    Raises:
        MemoryError: they take too much memory.
        TooLong: they take a core more than MOST_SECONDS.
    """
    needed, seconds = sum(tile.bytes for tile in tiles), sum(tile.seconds for tile in tiles)
    if needed <= SMALL_MEMORY:
        return
    allowed = min(MOST_BYTES, free_memory() + sum(tile.bytes for tile in tiles if tile.built))
    if needed <= allowed and seconds <= MOST_SECONDS:
        return
    error: type[Exception] = MemoryError
    takes = f"{needed / 2**30:.3g} GiB, but {allowed / 2**30:.3g} GiB are allowed"
    if needed <= allowed:
        error, most = TooLong, duration_text(MOST_SECONDS)
        takes = f"{duration_text(seconds)} of one CPU core before the first hit, but {most} are allowed"
    largest = max(tiles, key=lambda tile: tile.bytes)
    (rows, columns), place = largest.shape, tiles[largest]
    raise error(
        f"{place}.pattern: got a period of {rows * largest.dy:.6g} m x {columns * largest.dz:.6g} m, in cells of "
        f"{largest.dy:.3g} m x {largest.dz:.3g} m; the target takes {takes}; give a smaller spacing, a longer "
        f"{place}.degradation_length, or a lower level or larger numerics.grid_spacing"
    )


def _sharp(pattern: Pattern, counts: tuple[int, int], sides: tuple[float, float], real: Real, check: Check) -> Floats:
    """Whether the centres of the cells of a period are material, shape `counts`."""
    y, z = (
        np.float64(side / count) * (np.arange(count) + 0.5) for side, count in zip(pattern.period, counts, strict=True)
    )
    material = np.empty(counts, dtype=real)
    for k in range(counts[0]):
        check()
        material[k] = ~pattern.is_hole(y[k : k + 1], z)
    return material


def _blurred(pattern: Pattern, counts: tuple[int, int], sides: tuple[float, float], real: Real, check: Check) -> Floats:
    """Material averaged over BLUR × BLUR cells of a period: exact sums of whole numbers in float32, then one
    division."""
    inside, (rows, columns), adjacent = pattern.shares_in_holes(counts, sides), counts, BLUR // 2
    material, at_once = np.empty(counts, dtype=real), max(1, CELLS_PER_CHECK // columns)
    for first in range(0, rows, at_once):
        check()
        last = min(first + at_once, rows)
        around = inside[np.arange(first - adjacent, last + adjacent) % rows]
        wide = (WHOLE_CELL - np.pad(around, ((0, 0), (adjacent, adjacent)), mode="wrap")).astype(real)
        material[first:last] = _sums(_sums(wide, last - first).T, columns).T
        material[first:last] /= BLUR**2 * WHOLE_CELL
    return material


def _sums(values: Floats, count: int) -> Floats:
    """Sums over BLUR neighbours along the first axis."""
    sums: Floats = np.array(values[:count])
    for k in range(1, BLUR):
        sums += values[k : k + count]
    return sums
