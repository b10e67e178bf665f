"""The shapes of holes. Before any `rotation`, the length of a hole lies along z."""

from abc import abstractmethod
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from pydantic import Field, ValidationInfo, field_validator, model_validator
from shapely.affinity import scale, translate

from .exclusions import MARGIN, POLYGONS, check_together
from .geometry import Range, neighbours, shifts_into
from .model import Array
from .pattern import EQUAL_LENGTHS, LatticePattern, NoPattern, Pattern, is_pitch
from .units import Length, NonNegativeLength, PositiveLength

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


_MOST_POLYGONS, _MOST_CORNERS = 400, 400  # which are read and drawn within seconds

_Corners = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=3, max_length=_MOST_CORNERS, fail_fast=True)]


class PolygonsPattern(Pattern):
    """Polygons in a rectangular cell that repeats. Polygons that overlap those of the next cell make one hole.

    Attributes:
        shape: "polygons".
        spacing: extent (a, b) of the cell along y and z [m].
        staggered: shifts every odd row of cells along y by b/2 along z.
        polygons: corners (y, z) of each hole, from the middle of the cell [m].
    """

    shape: Literal["polygons"] = "polygons"
    spacing: tuple[PositiveLength, PositiveLength]
    staggered: Annotated[bool, Field(strict=True)] = False
    polygons: Annotated[tuple[_Corners, ...], Field(min_length=1, max_length=_MOST_POLYGONS, fail_fast=True)]

    @field_validator("polygons")
    @classmethod
    def _bound_holes_in_the_cell(cls, polygons: tuple[_Corners, ...], info: ValidationInfo) -> tuple[_Corners, ...]:
        farthest = np.abs([corner for corners in polygons for corner in corners]).max(axis=0)
        if (farthest > info.data.get("spacing", np.inf)).any():
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
    def _leaves_a_plate(self) -> Self:
        """Check that the largest piece of a few periods meets its own image in the next one along y and z."""
        a, b = self.period
        window = shapely.box(-1.5 * a, -1.5 * b, 1.5 * a, 1.5 * b)
        pieces = shapely.get_parts(window.difference(shapely.union_all(self.spines((-2 * a, 2 * a), (-2 * b, 2 * b)))))
        piece = pieces[shapely.area(pieces).argmax()] if len(pieces) else window.boundary
        if not all(piece.intersection(translate(piece, *by)).area > 0.0 for by in ((a, 0.0), (0.0, b))):
            raise ValueError("got holes that cut the plate apart, but the material must hold together")
        return self

    @property
    def period(self) -> tuple[float, float]:
        """Extent of a period along y and z [m]: two rows of a staggered pattern."""
        return (2.0 if self.staggered else 1.0) * self.spacing[0], self.spacing[1]

    @property
    def open_area(self) -> float:
        return float(self._cut_out(0.0).area / np.prod(self.period))

    def _cut_out(self, shift: float) -> Any:
        """Holes of the rectangle of a period that is shifted by this share of it, seen from its middle."""
        at, half = shift * np.array(self.period), 0.5 * np.array(self.period)
        low, high = at - half, at + half
        holes = shapely.union_all(self.spines((low[0], high[0]), (low[1], high[1])))
        return translate(holes.intersection(shapely.box(*low, *high)), *-at)

    def spines(self, y_range: Range, z_range: Range) -> Any:
        """Holes that reach into a rectangle, as an array of shapely polygons; what a hole surrounds belongs to it."""
        (a, b), images = self.period, []
        window = shapely.box(y_range[0], z_range[0], y_range[1], z_range[1])
        for corners in map(np.array, self.polygons):
            for stagger in np.array([(-a, -b), (a, b)]) / 4 if self.staggered else np.zeros((1, 2)):
                low, high = corners.min(axis=0) + stagger, corners.max(axis=0) + stagger
                around = (y_range[0] - a, y_range[1] + a), (z_range[0] - b, z_range[1] + b)
                images += [corners + stagger + shift for shift in shifts_into(low, high, self.period, *around)]
        holes = shapely.get_parts(shapely.union_all([shapely.Polygon(corners) for corners in images]))
        holes = shapely.get_parts(shapely.union_all(shapely.polygons(shapely.get_exterior_ring(holes))))
        return holes[shapely.intersects(holes, window)]

    @cached_property
    def _gap(self) -> float:
        """Smallest distance between two holes of the unbounded pattern [m]."""
        period = np.array(self.period)
        holes = self.spines(*((-length, length) for length in period))
        low, high = np.split(shapely.bounds(holes), 2, axis=1)
        in_cell = ((low < 0.5 * period) & (high > -0.5 * period)).all(axis=1)
        return neighbours(np.concatenate([holes[in_cell], holes[~in_cell]]), int(in_cell.sum()))[0]

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        holes, image = self._cut_out(0.0), scale(self._cut_out(0.5 * centred), along_y, along_z, origin=(0.0, 0.0))
        return bool(holes.symmetric_difference(image).area <= EQUAL_LENGTHS * max(self.period) * holes.length)

    def bounded(self, size: tuple[float, float] | None, margin: float | None) -> Self:
        """Refuse a margin: a cell of polygons has no single holes to leave out."""
        check_together({MARGIN: margin is not None, POLYGONS: True})
        return self


AnyPattern = Annotated[
    SlotPattern
    | CirclePattern
    | TrianglePattern
    | SquarePattern
    | HexagonPattern
    | EllipsePattern
    | NoPattern
    | PolygonsPattern,
    Field(discriminator="shape"),
]
"""Hole patterns: one hole shape on a lattice, or polygons, repeated periodically (docs/model.md §3)."""
