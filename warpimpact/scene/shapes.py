"""The shapes of holes. Before any `rotation`, the length of a hole lies along z."""

from abc import abstractmethod
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import (
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from .geometry import shifts_into
from .hole_files import read_holes
from .input_files import input_file
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

    def _check_shape(self) -> None:
        if self.length < self.width:
            raise ValueError(
                f"got length = {1e3 * self.length:g} mm, "
                f"but the length must be at least the width, {1e3 * self.width:g} mm"
            )
        super()._check_shape()


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
        turn = 2.0 * np.pi / _ELLIPSE_CHORDS * np.arange(_ELLIPSE_CHORDS)
        return 0.5 * np.column_stack([self.width * np.cos(turn), self.length * np.sin(turn)])

    @property
    def inradius(self) -> float:
        return self.width / 2

    @property
    def hole_area(self) -> float:
        """Area of one ellipse [m²], exact."""
        return np.pi / 4 * self.length * self.width


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
        super()._check_shape()

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


_Corners = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=3, max_length=1000, fail_fast=True)]
_Cell = tuple[PositiveLength, PositiveLength]
_CELL: TypeAdapter[tuple[float, float]] = TypeAdapter(_Cell)


class PolygonsPattern(Pattern):
    """Polygons in a rectangular cell that repeats. Polygons that overlap those of the next cell make one hole.

    Attributes:
        shape: "polygons".
        spacing: extent (a, b) of the cell along y and z [m].
        staggered: shifts every odd row of cells along y by b/2 along z.
        polygons: corners (y, z) of each hole, from the middle of the cell [m].
        file: holes of the cell instead of polygons: a CSV file of circles with the header y,z,diameter, or a DXF
            drawing with circles and closed polylines, whose layer PERIOD is the cell in place of spacing.
    """

    shape: Literal["polygons"] = "polygons"
    spacing: _Cell
    staggered: Annotated[bool, Field(strict=True)] = False
    polygons: Annotated[tuple[_Corners, ...], Field(min_length=1, max_length=2000, fail_fast=True)]

    @model_validator(mode="before")
    @classmethod
    def _holes_from_file(cls, values: Any, info: ValidationInfo) -> Any:
        if not isinstance(values, dict) or "file" not in values:
            return values
        for key in ("polygons", "staggered"):
            if key in values:
                raise ValueError(f"file and {key} cannot be combined: the file has all holes of a cell")
        holes = read_holes(input_file(values["file"], info))
        rest = {key: value for key, value in values.items() if key != "file"}
        if holes.cell is not None and "spacing" in rest:
            raise ValueError(f"file and spacing cannot be combined: {holes.name} has the cell in its layer PERIOD")
        if holes.cell is None and "spacing" not in rest:
            raise ValueError(holes.without_cell)
        rest["spacing"] = holes.cell or rest["spacing"]
        try:
            cell = _CELL.validate_python(rest["spacing"])
        except ValidationError:
            return rest | {"polygons": ()}  # refused as a spacing
        holes.check(cell)
        return rest | {"polygons": [outline.tolist() for outline in holes.holes.values()]}

    @classmethod
    def _keys(cls) -> list[str]:
        return [*super()._keys(), "file"]

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

    @property
    def is_listed(self) -> bool:
        return not self.staggered

    @property
    def period(self) -> tuple[float, float]:
        return (2.0 if self.staggered else 1.0) * self.spacing[0], self.spacing[1]

    @property
    def open_area(self) -> float:
        return float(sum(shapely.Polygon(spine).area for spine, _ in self._holes) / np.prod(self.period))

    @cached_property
    def _holes(self) -> list[tuple[Array, Array]]:
        """Unions of the polygons of all cells; what a hole surrounds belongs to it."""
        period, images = np.array(self.period), []
        rows = np.array([(-0.25, -0.25), (0.25, 0.25)]) * period if self.staggered else np.zeros((1, 2))
        around = [(-1.5 * side, 1.5 * side) for side in self.period]
        for corners in (np.array(polygon) + row for polygon in self.polygons for row in rows):
            shifts = shifts_into(corners.min(axis=0), corners.max(axis=0), self.period, *around)
            images += [shapely.Polygon(corners + shift) for shift in shifts]
        united = shapely.get_parts(shapely.union_all(images))
        holes = shapely.polygons(shapely.get_exterior_ring(united))
        holes = shapely.orient_polygons(shapely.get_parts(shapely.union_all(holes)))
        middles = shapely.get_coordinates(shapely.centroid(holes)) / period
        of_the_period = (np.floor(middles + 0.5 + EQUAL_LENGTHS) == 0.0).all(axis=1)
        return [(shapely.get_coordinates(hole)[:-1], np.zeros((1, 3))) for hole in holes[of_the_period]]


def _of_a_file(values: Any) -> Any:
    """A table with a file and no shape has polygons."""
    return {"shape": "polygons"} | values if isinstance(values, dict) and "file" in values else values


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
    BeforeValidator(_of_a_file),
]
"""Hole patterns: one hole shape on a lattice, or polygons, repeated periodically (docs/model.md §3)."""
