"""The interface of all hole patterns, and the pattern without holes."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..model import Array, Model
from .roundings import distance_to, pieces

BoolArray = NDArray[np.bool_]
Counts = NDArray[np.int16]
Range = tuple[float, float]
Check = Callable[[], object]


WHOLE_CELL = 24576
"""Parts of a cell that count its share in holes as an integer; a cell inside a hole has exactly all."""


def no_end() -> None:
    """A `check` that never ends the work."""


def rounded(share: Array, whole: Any) -> Counts:
    """Shares of `whole` as integers. A half is rounded up, even after a rounding error, so that mirrored holes have
    mirrored shares."""
    return np.asarray(np.floor(share * whole + (0.5 + 1e-6)), dtype=np.int16)


def half_sides(size: tuple[float, float], cell: tuple[float, float], reach: Array) -> Array:
    """Half the sides of a small plate with the same ligaments as a plate of this `size` [m].

    A plate that is smaller by whole cells on every side cuts the same holes. It is at least two cells larger than the
    `reach` of a hole.
    """
    half, sides = np.array(size) / 2, np.array(cell)
    spare: Array = np.maximum(0.0, np.floor((half - reach) / sides) - 2)
    return np.asarray(half - spare * sides)


class Pattern(Model, ABC):
    """Where a plate has holes."""

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

    def has_edge(self, y: Array, z: Array, reach: float) -> BoolArray:
        """Whether the edge of a hole may lie within `reach` of points y, z [m]; bool, of their broadcast shape. False
        is certain."""
        return np.ones(np.broadcast_shapes(np.shape(y), np.shape(z)), dtype=bool)

    @abstractmethod
    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float], check: Check = no_end) -> Counts:
        """Share of every cell that lies in holes, in parts of WHOLE_CELL, shape `counts`: cells of a period along y and
        z with these sides [m], from the origin on. `check` is called often, and raises to end the work."""

    def edge_distance(self, y: Array, z: Array) -> Array:
        """Distance of points y, z [m] from the nearest outline of a hole, of their broadcast shape: negative in a hole,
        inf where there is none. The chords of an outline lie within 0.13 % of the radius of its arcs."""
        y, z = (at - side * np.round(at / side) for at, side in zip((y, z), self.period, strict=True))
        apart = distance_to(self._edges, y, z)
        return np.where(self.is_hole(y, z), -apart, apart)

    @cached_property
    def _edges(self) -> Any:
        """Outlines around a period, cut into pieces. Those along the end of the rectangle are no nearer to a point of
        the period than its own."""
        sides = np.array(self.period)
        return pieces(self.outlines(*((-reach, reach) for reach in 0.5 * (sides + np.hypot(*sides)))))

    @abstractmethod
    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of the holes that reach into a rectangle."""

    @abstractmethod
    def ligament(self, size: tuple[float, float] | None = None) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim of a plate of this `size` [m]; inf
        where there is none. A hole that the rim cuts has no distance to it."""

    @property
    def resolution(self) -> float:
        """Largest error of the ligament [m]; 0 for shapes with exact formulas."""
        return 0.0

    @abstractmethod
    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        """Whether (y, z) → (along_y·y, along_z·z), with 1, or −1 for a mirror image, then half a period along both if
        `centred`, changes nothing."""

    @property
    def unbounded(self) -> Self:
        """The pattern with all its holes, without a plate that bounds it."""
        return self

    @abstractmethod
    def bounded(self, size: tuple[float, float], margin: float) -> Self:
        """The pattern without the holes that reach into a `margin` along the rim of a plate of this `size` [m]. The
        size becomes its period.

        Raises:
            ValueError: says why that is impossible.
        """


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

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        return []

    def ligament(self, size: tuple[float, float] | None = None) -> float:
        return math.inf

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        return True

    def bounded(self, size: tuple[float, float], margin: float) -> Self:
        return self
