"""The base of free forms: holes of no named shape, drawn in square cells (docs/model.md §3).

A tool of some diameter opens the holes: what the tool does not reach stays material (the opening of mathematical
morphology: J. Serra, Image Analysis and Mathematical Morphology, Academic Press 1982). Material that a hole surrounds
falls out.
"""

import math
from abc import abstractmethod
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from ..exclusions import CELLS, MARGIN, check_together
from ..model import Array
from ..units import NonNegativeLength, PositiveLength
from .pattern import WHOLE_CELL, BoolArray, Check, Counts, Pattern, Range, half_sides, no_end, rounded
from .roundings import smallest_gap

_MOST_CELLS = 4_000_000
_CELLS_PER_CHECK = 2**20


class FreeForm(Pattern):
    """Holes in a rectangular cell that repeats, drawn in small squares; the period is centred on the origin.

    Attributes:
        spacing: extent (a, b) of the cell along y and z [m]; that along z is rounded to whole squares of the drawing.
        smallest_feature: diameter of the tool that cuts the holes: no part of a hole is narrower [m].
        cell_size: side of the squares of the drawing, about [m]; a whole number of them is `spacing` along y.
    """

    spacing: tuple[PositiveLength, PositiveLength]
    smallest_feature: NonNegativeLength = 0.0
    cell_size: PositiveLength = 5e-5

    @property
    @abstractmethod
    def extent(self) -> tuple[float, float]:
        """Extent of the period along y and z before it is rounded [m]."""

    @abstractmethod
    def drawn(self, y: Array, z: Array) -> BoolArray:
        """Where the holes are before a tool opens them, at y of shape [squares along y, 1] and z [squares along z]
        [m]."""

    @model_validator(mode="after")
    def _is_in_one_piece(self) -> Self:
        count = math.prod(side / self.side for side in self.extent)
        if count > _MOST_CELLS:
            raise ValueError(f"got {count:.3g} cells, but at most {_MOST_CELLS:.1g}; a larger cell_size gives fewer")
        _ = self.material
        return self

    @property
    def side(self) -> float:
        """Side of a square of the drawing [m]."""
        return self.spacing[0] / max(1, round(self.spacing[0] / self.cell_size))

    @cached_property
    def material(self) -> BoolArray:
        """Which squares are material, shape [squares along y, squares along z], read-only."""
        counts = [max(1, round(length / self.side)) for length in self.extent]
        y, z = (self.side * (np.arange(count, dtype=np.float64) + 0.5 - 0.5 * count) for count in counts)
        material = _in_one_piece(~_opened(self.drawn(y[:, None], z), 0.5 * self.smallest_feature / self.side))
        material.setflags(write=False)
        return material

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the drawing along y and z [m]."""
        along_y, along_z = self.material.shape
        return (along_y * self.side, along_z * self.side)

    @property
    def open_area(self) -> float:
        return 1 - float(self.material.mean())

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        i, j = (
            np.floor(coordinate / self.side + count / 2).astype(np.int64) % count
            for coordinate, count in zip((y, z), self.material.shape, strict=True)
        )
        return np.asarray(~self.material[i, j])

    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float], check: Check = no_end) -> Counts:
        along_y = _means(~self.material, counts[0], sides[0] / self.side)
        shares = np.empty(counts, dtype=np.int16)
        rows = max(1, _CELLS_PER_CHECK // counts[1])
        for first in range(0, counts[0], rows):
            check()
            means = _means(along_y[first : first + rows].T, counts[1], sides[1] / self.side)
            shares[first : first + rows] = rounded(means.T, WHOLE_CELL)
        return shares

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines of holes, each of shape [points, 2] [m]; the rectangle cuts them."""
        lines: list[Array] = self._contours(y_range, z_range).lines(0.5)
        return lines

    def ligament(self, size: tuple[float, float] | None = None) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim of a plate of this `size` [m].

        Outlines cut the corners of squares. A hole that is longer than two periods counts as several holes.
        """
        if size not in self._ligaments:
            self._ligaments[size] = self._ligament(size)
        return self._ligaments[size]

    @cached_property
    def _ligaments(self) -> dict[tuple[float, float] | None, float]:
        """Known ligaments: that of many holes takes seconds, and every shard needs it."""
        return {}

    def _ligament(self, size: tuple[float, float] | None) -> float:
        period = np.array(self.period)
        half = period if size is None else half_sides(size, self.period, period)
        # Outer and inner rings of each hole, one after the other, with their offsets.
        rings, starts = self._contours(*((-end, end) for end in half)).filled(0.5, math.inf)
        holes = [[points[a:b] for a, b in pairwise(offsets)] for points, offsets in zip(rings, starts, strict=True)]
        between = smallest_gap(holes)
        if size is None:
            return between
        farthest = np.array([np.abs(points).max(axis=0) for points in rings]).reshape(-1, 2)
        to_rim = (half - farthest).min(axis=1)
        return min(between, float(to_rim[to_rim > 0].min(initial=np.inf)))

    @property
    def resolution(self) -> float:
        """Largest error of the ligament [m]: one square."""
        return self.side

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        halves = self.material.repeat(2, axis=0).repeat(2, axis=1)  # half a period is a whole number of these
        image = halves[::along_y, ::along_z]
        return np.array_equal(np.roll(image, self.material.shape, axis=(0, 1)) if centred else image, halves)

    def bounded(self, size: tuple[float, float], margin: float) -> Self:
        """Raise a ValueError: squares do not say which of them make one hole."""
        check_together({MARGIN: True, CELLS: True})
        return self

    def _contours(self, y_range: Range, z_range: Range) -> Any:
        """Generator of contours between holes, which are 1, and material, which is 0, in a rectangle."""
        from contourpy import FillType, LineType, contour_generator

        y, z = (self._centres(ends, count) for ends, count in zip((y_range, z_range), self.material.shape, strict=True))
        hole = self.is_hole(y, z[:, None]).astype(float)
        hole[[0, -1], :] = hole[:, [0, -1]] = 0.0  # closes the outlines of holes that continue outside
        return contour_generator(y, z, hole, line_type=LineType.Separate, fill_type=FillType.OuterOffset)

    def _centres(self, ends: Range, count: int) -> Array:
        """Centres [m] of the squares that cover a range, and of one more at each end."""
        low, high = np.floor(np.array(ends) / self.side + count / 2)
        return (np.arange(low - 1, high + 2) + 0.5 - count / 2) * self.side


def _means(values: NDArray[Any], count: int, width: float) -> Array:
    """Means of a period of values, shape [values, others], over `count` ranges of this width [values] from its middle
    on; shape [count, others]."""
    until = np.concatenate([np.zeros_like(values[:1], dtype=np.float64), np.cumsum(values, axis=0, dtype=np.float64)])
    periods, within = np.divmod(np.arange(count + 1) * width + 0.5 * len(values), len(values))
    index = np.minimum(within.astype(np.int64), len(values) - 1)
    ends = until[index] + (within - index)[:, None] * values[index] + periods[:, None] * until[-1]
    return np.asarray(np.diff(ends, axis=0) / width)


def _opened(holes: BoolArray, radius: float) -> BoolArray:
    """The parts of holes that a disc of this radius [squares] reaches without leaving the holes."""
    if radius < 0.5 or not holes.any() or holes.all():
        return holes
    from scipy.ndimage import distance_transform_edt

    margin = min(math.ceil(2.0 * radius) + 2, *holes.shape)
    wide = np.pad(holes, margin, mode="wrap")
    centres = distance_transform_edt(wide) > radius
    reached = distance_transform_edt(~centres) <= radius
    return np.asarray(reached[margin:-margin, margin:-margin] & holes)


def _in_one_piece(material: BoolArray) -> BoolArray:
    """The largest connected part of the material; parts that holes surround fall out.

    Raises:
        ValueError: the holes cut the plate apart.
    """
    from scipy.ndimage import label

    rows, columns = material.shape
    labels = label(np.tile(material, (3, 3)))[0]
    middle = labels[rows : 2 * rows, columns : 2 * columns]
    counts = np.bincount(middle[middle > 0], minlength=1)
    piece = int(counts.argmax()) if counts.any() else 0
    row, column = (int(index[0]) for index in np.nonzero(middle == piece)) if piece else (0, 0)
    whole = [(row + k * rows, column + m * columns) for k, m in ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2))]
    if not piece or any(labels[at] != piece for at in whole):
        raise ValueError("got holes that cut the plate apart, but the material must hold together")
    return np.asarray(middle == piece)
