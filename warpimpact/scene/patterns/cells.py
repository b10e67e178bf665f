"""Patterns of square cells that are hole or material (docs/model.md §3)."""

import math
from abc import abstractmethod
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..exclusions import CELLS, MARGIN, check_together
from ..model import Array
from .pattern import WHOLE_CELL, BoolArray, Check, Counts, Pattern, Range, half_sides, no_end, rounded
from .roundings import smallest_gap

Numbers = NDArray[np.int64]
_AT_ONCE = 2**20
"""Cells that are computed together, about."""


class CellsPattern(Pattern):
    """Square cells, repeated periodically, the period centred on the origin."""

    @property
    @abstractmethod
    def side(self) -> float:
        """Of a cell [m]."""

    @cached_property
    @abstractmethod
    def material(self) -> BoolArray:
        """Where a cell is material, bool of shape [cells along y, cells along z], read-only."""

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the cells along y and z [m]."""
        along_y, along_z = self.material.shape
        return (along_y * self.side, along_z * self.side)

    @property
    def open_area(self) -> float:
        return 1 - float(self.material.mean())

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        return np.asarray(~self.material[self._indices(y, z)])

    def _indices(self, y: Array, z: Array) -> tuple[Numbers, Numbers]:
        """Those of the cells at coordinates y and z [m]."""
        i, j = (
            np.floor(coordinate / self.side + cells / 2).astype(np.int64) % cells
            for coordinate, cells in zip((y, z), self.material.shape, strict=True)
        )
        return i, j

    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float], check: Check = no_end) -> Counts:
        along_y = _means(~self.material, counts[0], sides[0] / self.side)
        shares = np.empty(counts, dtype=np.int16)
        for first in range(0, counts[0], some := max(1, _AT_ONCE // counts[1])):
            check()
            means = _means(along_y[first : first + some].T, counts[1], sides[1] / self.side)
            shares[first : first + some] = rounded(means.T, WHOLE_CELL)
        return shares

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of holes; the rectangle cuts them."""
        lines: list[Array] = self._contours(y_range, z_range).lines(0.5)
        return lines

    def ligament(self, size: tuple[float, float] | None = None) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim of a plate of this `size` [m].

        Outlines cut the corners of cells. A hole that is longer than two periods counts as several holes.
        """
        if size not in self._ligaments:
            self._ligaments[size] = self._ligament(size)
        return self._ligaments[size]

    @cached_property
    def _ligaments(self) -> dict[tuple[float, float] | None, float]:
        """Those known already: the ligament of many holes takes seconds, and every shard tells it."""
        return {}

    def _ligament(self, size: tuple[float, float] | None) -> float:
        period = np.array(self.period)
        half = period if size is None else half_sides(size, self.period, period)
        # Outer and inner rings of each hole, one after the other, with their offsets.
        rings, starts = self._contours(*((-end, end) for end in half)).filled(0.5, math.inf)
        between = smallest_gap(
            [[points[a:b] for a, b in pairwise(at)] for points, at in zip(rings, starts, strict=True)]
        )
        if size is None:
            return between
        furthest = np.array([np.abs(points).max(axis=0) for points in rings]).reshape(-1, 2)
        whole = (half - furthest).min(axis=1)
        return min(between, float(whole[whole > 0].min(initial=np.inf)))

    @property
    def resolution(self) -> float:
        """Largest error of the ligament [m]: one cell."""
        return self.side

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        halves = self.material.repeat(2, axis=0).repeat(2, axis=1)  # half a period is a whole number of these
        image = halves[::along_y, ::along_z]
        return np.array_equal(np.roll(image, self.material.shape, axis=(0, 1)) if centred else image, halves)

    def bounded(self, size: tuple[float, float], margin: float) -> Self:
        """Raise a ValueError: cells do not say which of them make one hole."""
        check_together({MARGIN: True, CELLS: True})
        return self

    def _contours(self, y_range: Range, z_range: Range) -> Any:
        """Generator of contours between holes, which are 1, and material, which is 0, in a rectangle."""
        from contourpy import FillType, LineType, contour_generator

        y, z = (
            self._cell_centres(ends, cells) for ends, cells in zip((y_range, z_range), self.material.shape, strict=True)
        )
        hole = self.is_hole(y, z[:, None]).astype(float)
        hole[[0, -1], :] = hole[:, [0, -1]] = 0.0  # closes the outlines of holes that continue outside
        return contour_generator(y, z, hole, line_type=LineType.Separate, fill_type=FillType.OuterOffset)

    def _cell_centres(self, ends: Range, cells: int) -> Array:
        """Centres [m] of the cells that cover a range, and of one more at each end."""
        low, high = np.floor(np.array(ends) / self.side + cells / 2)
        return (np.arange(low - 1, high + 2) + 0.5 - cells / 2) * self.side


def _means(values: NDArray[Any], count: int, width: float) -> Array:
    """Means of a period of values, shape [values, others], over so many ranges of this width [values] that begin in its
    middle; shape [count, others]."""
    until = np.concatenate([np.zeros_like(values[:1], dtype=np.float64), np.cumsum(values, axis=0, dtype=np.float64)])
    periods, at = np.divmod(np.arange(count + 1) * width + 0.5 * len(values), len(values))
    index = np.minimum(at.astype(np.int64), len(values) - 1)
    ends = until[index] + (at - index)[:, None] * values[index] + periods[:, None] * until[-1]
    return np.asarray(np.diff(ends, axis=0) / width)
