"""The interface of all hole patterns, and the pattern without holes."""

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
import shapely

from ..model import Array, Model
from .geometry import BoolArray, Check, Counts, Range, distance_to, neighbours, no_end, pieces

_QUARTER = 16
"""Chords per quarter of a turn in an outline; a circle loses 1.6e-3 of its area."""


class Pattern(Model, ABC):
    """Where a plate has holes. A hole has all points within the distance `rounding` of its spine."""

    @property
    @abstractmethod
    def period(self) -> tuple[float, float]:
        """Extent along y and z [m] of the rectangle, centred on the origin, that repeats."""

    @property
    def unit_cell(self) -> tuple[float, float]:
        """Extent along y and z [m] of the cell that represents the pattern: the period, unless the pattern is
        bounded."""
        return self.period

    @property
    @abstractmethod
    def open_area(self) -> float:
        """Share of holes in a period."""

    @abstractmethod
    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie in a hole; bool, of their broadcast shape."""

    @abstractmethod
    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float], check: Check = no_end) -> Counts:
        """Share of every cell that lies in holes, in parts of WHOLE_CELL, shape `counts`: cells of a period along y and
        z with these sides [m], from the origin on. `check` is called often, and raises to end the work."""

    @abstractmethod
    def spines(self, y_range: Range, z_range: Range) -> Any:
        """Spines of the holes that reach into a rectangle, as an array of shapely geometries."""

    @property
    def rounding(self) -> float:
        """How far a hole reaches beyond its spine [m]."""
        return 0.0

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of the holes that reach into a rectangle."""
        holes = self.spines(y_range, z_range)
        if self.rounding:
            holes = shapely.buffer(holes, self.rounding, quad_segs=_QUARTER)
        return [np.array(shapely.get_coordinates(hole)) for hole in holes]

    def edge_distance(self, y: Array, z: Array) -> Array:
        """Distance of points y, z [m] from the nearest outline of a hole, of their broadcast shape: negative in a hole,
        inf where there is none. The chords of an outline lie within 0.13 % of the radius of its arcs."""
        apart = distance_to(self._edges, y, z, self.period)
        return np.where(self.is_hole(y, z), -apart, apart)

    @cached_property
    def _edges(self) -> Any:
        """Outlines around a period, cut into pieces. Those along the end of the rectangle are no nearer to a point of
        the period than its own."""
        sides = np.array(self.period)
        return pieces(self.outlines(*((-reach, reach) for reach in 0.5 * (sides + np.hypot(*sides)))))

    def ligament(self, size: tuple[float, float] | None = None) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim of a plate of this `size` [m]; inf
        where there is none. A hole that the rim cuts has no distance to it. An ellipse is a polygon here."""
        if size is None:
            return self._gap
        sides, half = np.array(self.period), 0.5 * np.array(size)
        low, high = self._corners(self.spines(*((-side, side) for side in 0.5 * sides)))
        reach = (high - low).max(axis=0, initial=0.0)
        # A plate that is smaller by whole cells on every side cuts the same holes.
        half = half - np.maximum(0.0, np.floor((half - reach) / sides) - 2) * sides
        holes = self.spines(*((-side, side) for side in half))
        to_rim = (half - np.abs(self._corners(holes))).min(axis=(0, 2))
        is_wide = bool((half >= reach + 2 * sides).all())
        between = self._gap if is_wide else neighbours(holes, len(holes))[0] - 2.0 * self.rounding
        return float(min(between, to_rim[to_rim >= 0].min(initial=np.inf)))

    def _corners(self, spines: Any) -> Array:
        """Lower and upper corners (y, z) of the boxes around holes, shape [2, holes, 2] [m]."""
        bounds = shapely.bounds(spines)
        return np.stack([bounds[:, :2] - self.rounding, bounds[:, 2:] + self.rounding])

    @property
    @abstractmethod
    def _gap(self) -> float:
        """Smallest distance between two holes of the unbounded pattern [m]."""

    @abstractmethod
    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        """Whether (y, z) → (along_y·y, along_z·z), with 1, or −1 for a mirror image, then half a period along both if
        `centred`, changes nothing."""

    def bounded(self, size: tuple[float, float] | None, margin: float | None) -> Self:
        """The pattern without the holes that reach into a `margin` along the rim of a plate of this `size` [m], which
        becomes its period. Without both it has all holes.

        Raises:
            ValueError: says why that is impossible.
        """
        return self


class NoPattern(Pattern):
    """A plate without holes; its unit cell is a square millimetre.

    Attributes:
        shape: "none".
    """

    shape: Literal["none"] = "none"

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the unit cell along y and z [m]; the size is arbitrary."""
        return (1e-3, 1e-3)

    @property
    def open_area(self) -> float:
        return 0.0

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        return np.zeros(np.broadcast_shapes(np.shape(y), np.shape(z)), dtype=bool)

    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float], check: Check = no_end) -> Counts:
        return np.zeros(counts, dtype=np.int16)

    def spines(self, y_range: Range, z_range: Range) -> Any:
        return np.empty(0, dtype=object)

    @property
    def _gap(self) -> float:
        return math.inf

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        return True
