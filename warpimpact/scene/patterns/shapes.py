"""The shapes of holes. Before any `rotation`, the length of a hole lies along z."""

from abc import abstractmethod
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from ..model import Array
from ..units import NonNegativeLength, PositiveLength
from .pattern import LatticePattern, is_pitch

_ELLIPSE_CHORDS = 720


class CirclePattern(LatticePattern):
    """Round holes of `diameter` [m].

    Attributes:
        shape: "circle".
        diameter: of a hole [m].
    """

    shape: Literal["circle"] = "circle"
    diameter: PositiveLength

    @property
    def spine(self) -> Array:
        """The centre, shape [1, 2]."""
        return np.zeros((1, 2))

    @property
    def inradius(self) -> float:
        return self.diameter / 2

    @property
    def rounding(self) -> float:
        """The radius [m]."""
        return self.diameter / 2


class _OblongPattern(LatticePattern):
    """Holes of overall `length` along z and `width` along y [m].

    Attributes:
        length: overall, along z [m].
        width: along y, at most the length [m].
    """

    length: PositiveLength
    width: PositiveLength

    @property
    def inradius(self) -> float:
        return self.width / 2

    def _check_shape(self) -> None:
        if self.length < self.width:
            raise ValueError(
                f"got length = {1e3 * self.length:g} mm, "
                f"but the length must be at least the width, {1e3 * self.width:g} mm"
            )


class SlotPattern(_OblongPattern):
    """Stadium-shaped slots, overall `length` along z and `width` along y [m].

    Attributes:
        shape: "slot".
    """

    shape: Literal["slot"] = "slot"

    @property
    def spine(self) -> Array:
        """The line between the centres of the ends, shape [2, 2] [m]."""
        half = (self.length - self.width) / 2
        return np.array([(0.0, -half), (0.0, half)])

    @property
    def rounding(self) -> float:
        """Half the width [m]."""
        return self.width / 2


class EllipsePattern(_OblongPattern):
    """Elliptic holes, overall `length` along z and `width` along y [m].

    Attributes:
        shape: "ellipse".
    """

    shape: Literal["ellipse"] = "ellipse"

    @property
    def spine(self) -> Array:
        """A polygon on the ellipse, shape [720, 2] [m], for outlines and distances; its error is 1e-5 of the length."""
        turn = 2 * np.pi / _ELLIPSE_CHORDS * np.arange(_ELLIPSE_CHORDS)
        return 0.5 * np.column_stack([self.width * np.cos(turn), self.length * np.sin(turn)])

    @property
    def hole_area(self) -> float:
        """Area of one ellipse [m²], exact."""
        return np.pi / 4 * self.length * self.width

    @property
    def _marks(self) -> Array:
        return self.spine[:: _ELLIPSE_CHORDS // 4]


class _PolygonPattern(LatticePattern):
    """Regular polygons about the place of the hole, with corners rounded by `corner_radius` [m].

    Attributes:
        corner_radius: of the rounded corners [m].
    """

    corner_radius: NonNegativeLength = 0.0

    @property
    @abstractmethod
    def corners(self) -> Array:
        """Sharp corners, anticlockwise, shape [corners, 2] [m]."""

    def _check_shape(self) -> None:
        if self.corner_radius >= self.inradius:
            raise ValueError(
                f"got corner_radius = {1e3 * self.corner_radius:g} mm, "
                f"but it must be smaller than the inradius of the hole, {1e3 * self.inradius:.4g} mm"
            )

    @property
    def spine(self) -> Array:
        """The polygon of the centres of the rounded corners, shape [corners, 2] [m]."""
        return self.corners * (1 - self.corner_radius / self.inradius)

    @property
    def rounding(self) -> float:
        """That of the corners [m]."""
        return self.corner_radius


class TrianglePattern(_PolygonPattern):
    """Equilateral triangles: one side along y, apex to +z.

    Attributes:
        shape: "triangle".
        side: of the triangle with sharp corners [m].
    """

    shape: Literal["triangle"] = "triangle"
    side: PositiveLength

    @property
    def corners(self) -> Array:
        return np.array([(-self.side / 2, -self.inradius), (self.side / 2, -self.inradius), (0.0, 2 * self.inradius)])

    @property
    def inradius(self) -> float:
        return float(self.side / np.sqrt(12))


class SquarePattern(_PolygonPattern):
    """Squares of `side` [m], sides along y and z.

    Attributes:
        shape: "square".
        side: of the square with sharp corners [m].
    """

    row_distance = 1.0
    shape: Literal["square"] = "square"
    side: PositiveLength

    @property
    def corners(self) -> Array:
        return self.inradius * np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])

    @property
    def inradius(self) -> float:
        return self.side / 2


class HexagonPattern(_PolygonPattern):
    """Regular hexagons of `width` across flats [m]; two sides along z, along y on a staggered pitch.

    Attributes:
        shape: "hexagon".
        width: across flats [m].
    """

    shape: Literal["hexagon"] = "hexagon"
    width: PositiveLength

    @model_validator(mode="before")
    @classmethod
    def _sides_face_each_other(cls, values: Any) -> Any:
        is_staggered_pitch = isinstance(values, dict) and values.get("staggered") and is_pitch(values.get("spacing"))
        return {"rotation": "30 deg"} | values if is_staggered_pitch else values

    @property
    def corners(self) -> Array:
        half, side = self.inradius, 2 * self.inradius / np.sqrt(3)
        flanks = [(half, -side / 2), (half, side / 2), (0.0, side), (-half, side / 2), (-half, -side / 2)]
        return np.array([*flanks, (0.0, -side)])

    @property
    def inradius(self) -> float:
        return self.width / 2
