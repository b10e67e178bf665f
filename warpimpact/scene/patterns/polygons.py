"""Holes of any outline, by their corners, as square cells (docs/model.md §3)."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator, model_validator
from scipy.ndimage import label
from shapely.affinity import translate

from ..exclusions import MARGIN, POLYGONS, check_together
from ..model import Array
from ..units import Length, PositiveLength
from .geometry import WHOLE_CELL, BoolArray, Counts, Range, neighbours, rounded, shifts_into
from .pattern import Pattern

_MOST_CELLS = 4_000_000
_CELLS_AT_ONCE = 2**20
_MOST_POLYGONS, _MOST_CORNERS = 400, 400  # which are read and drawn within seconds

_Corners = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=3, max_length=_MOST_CORNERS, fail_fast=True)]


class PolygonsPattern(Pattern):
    """Polygons in a rectangular cell that repeats. Polygons that overlap those of the next cell make one hole.

    Attributes:
        shape: "polygons".
        spacing: extent (a, b) of the cell along y and z [m]; that along z is rounded to whole squares of `cell_size`.
        staggered: shifts every odd row of cells along y by b/2 along z.
        cell_size: side of the squares that are holes or material, about [m]; a whole number of them is `spacing` along
            y.
        polygons: corners (y, z) of each hole, from the middle of the cell [m].
    """

    shape: Literal["polygons"] = "polygons"
    spacing: tuple[PositiveLength, PositiveLength]
    staggered: Annotated[bool, Field(strict=True)] = False
    cell_size: PositiveLength = 5e-5
    polygons: Annotated[tuple[_Corners, ...], Field(min_length=1, max_length=_MOST_POLYGONS, fail_fast=True)]

    @field_validator("polygons")
    @classmethod
    def _bound_holes_in_the_cell(cls, polygons: tuple[_Corners, ...], info: ValidationInfo) -> tuple[_Corners, ...]:
        farthest = np.abs([corner for corners in polygons for corner in corners]).max(axis=0)
        if (farthest > info.data.get("spacing", math.inf)).any():
            raise ValueError(
                f"got corners as far as ({1e3 * farthest[0]:g}, {1e3 * farthest[1]:g}) mm from the middle of the cell, "
                "but they may be at most one spacing away"
            )
        holes = shapely.MultiPolygon([shapely.Polygon(corners) for corners in polygons])
        if not shapely.is_valid(holes):
            raise ValueError(
                f"got polygons that cross themselves or overlap ({shapely.is_valid_reason(holes)}, in m), "
                "but each must bound a hole of its own"
            )
        return polygons

    @model_validator(mode="after")
    def _is_in_one_piece(self) -> Self:
        if (count := math.prod(self._counts)) > _MOST_CELLS:
            raise ValueError(f"got {count:.3g} cells, but at most {_MOST_CELLS:.1g}; a larger cell_size gives fewer")
        _ = self.material
        return self

    @property
    def side(self) -> float:
        """Side of a square [m]."""
        return self.spacing[0] / max(1, round(self.spacing[0] / self.cell_size))

    @property
    def _counts(self) -> tuple[int, int]:
        """Squares of a period along y and z."""
        extent = ((2.0 if self.staggered else 1.0) * self.spacing[0], self.spacing[1])
        along_y, along_z = (max(1, round(length / self.side)) for length in extent)
        return along_y, along_z

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the squares of a period along y and z [m]."""
        along_y, along_z = self._counts
        return (along_y * self.side, along_z * self.side)

    @cached_property
    def material(self) -> BoolArray:
        """Which squares are material, shape [squares along y, squares along z], read-only."""
        holes = np.zeros(self._counts, dtype=bool)
        y, z = (self.side * (np.arange(count, dtype=np.float64) + 0.5 - 0.5 * count) for count in holes.shape)
        half_y, half_z = (0.5 * length for length in self.period)
        for polygon, reach, at in self._images((-half_y, half_y), (-half_z, half_z)):
            near_y, near_z = (np.abs(axis - to) <= far for axis, to, far in zip((y, z), at, reach, strict=True))
            points = np.broadcast_arrays(y[near_y, None] - at[0], z[near_z] - at[1])
            holes[np.ix_(near_y, near_z)] |= shapely.contains_xy(polygon, *points)
        material = _in_one_piece(~holes)
        material.setflags(write=False)
        return material

    def _images(self, y_range: Range, z_range: Range) -> Iterator[tuple[Any, Array, Array]]:
        """Polygons of the holes that reach into a rectangle, each from its middle, with its reach from there, and the
        place of its middle [m]."""
        for corners in map(np.array, self.polygons):
            low, high = corners.min(axis=0), corners.max(axis=0)
            middle, reach = 0.5 * (low + high), 0.5 * (high - low)
            polygon = shapely.Polygon(corners - middle)
            shapely.prepare(polygon)
            for share in (-0.25, 0.25) if self.staggered else (0.0,):
                at = middle + share * np.array(self.period)
                for shift in shifts_into(at - reach, at + reach, self.period, y_range, z_range):
                    yield polygon, reach, at + shift

    @property
    def open_area(self) -> float:
        return 1 - float(self.material.mean())

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        i, j = (
            np.floor(coordinate / self.side + count / 2).astype(np.int64) % count
            for coordinate, count in zip((y, z), self.material.shape, strict=True)
        )
        return np.asarray(~self.material[i, j])

    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float]) -> Counts:
        along_y = _means(~self.material, counts[0], sides[0] / self.side)
        shares = np.empty(counts, dtype=np.int16)
        rows = max(1, _CELLS_AT_ONCE // counts[1])
        for first in range(0, counts[0], rows):
            means = _means(along_y[first : first + rows].T, counts[1], sides[1] / self.side)
            shares[first : first + rows] = rounded(means.T, WHOLE_CELL)
        return shares

    def spines(self, y_range: Range, z_range: Range) -> Any:
        """Holes that reach into a rectangle, as an array of shapely polygons; what a hole surrounds belongs to it."""
        images = [translate(polygon, *at) for polygon, _, at in self._images(y_range, z_range)]
        rings = shapely.get_exterior_ring(shapely.get_parts(shapely.union_all(images)))
        return shapely.get_parts(shapely.union_all(shapely.polygons(rings)))

    @cached_property
    def _gap(self) -> float:
        """Smallest distance between two holes of the unbounded pattern [m]."""
        period = np.array(self.period)
        holes = self.spines(*((-length, length) for length in period))
        low, high = np.split(shapely.bounds(holes), 2, axis=1)
        in_cell = ((low < 0.5 * period) & (high > -0.5 * period)).all(axis=1)
        return neighbours(np.concatenate([holes[in_cell], holes[~in_cell]]), int(in_cell.sum()))[0]

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        halves = self.material.repeat(2, axis=0).repeat(2, axis=1)  # half a period is a whole number of these
        image = halves[::along_y, ::along_z]
        return np.array_equal(np.roll(image, self.material.shape, axis=(0, 1)) if centred else image, halves)

    def bounded(self, size: tuple[float, float] | None, margin: float | None) -> Self:
        """Refuse a margin: a cell of polygons has no single holes to leave out."""
        check_together({MARGIN: margin is not None, POLYGONS: True})
        return self


def _means(values: NDArray[Any], count: int, width: float) -> Array:
    """Means of a period of values, shape [values, others], over `count` ranges of this width [values] from its middle
    on; shape [count, others]."""
    until = np.concatenate([np.zeros_like(values[:1], dtype=np.float64), np.cumsum(values, axis=0, dtype=np.float64)])
    periods, within = np.divmod(np.arange(count + 1) * width + 0.5 * len(values), len(values))
    index = np.minimum(within.astype(np.int64), len(values) - 1)
    ends = until[index] + (within - index)[:, None] * values[index] + periods[:, None] * until[-1]
    return np.asarray(np.diff(ends, axis=0) / width)


def _in_one_piece(material: BoolArray) -> BoolArray:
    """The largest connected part of the material; parts that holes surround fall out.

    Raises:
        ValueError: the holes cut the plate apart.
    """
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
