"""Hole patterns: their interface, none, and holes of one shape on a lattice (docs/model.md §3)."""

import math
from abc import ABC, abstractmethod
from functools import cached_property
from numbers import Real
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
import shapely
from pydantic import Field, ValidationInfo, field_serializer, field_validator, model_validator
from shapely.affinity import scale, translate

from .exclusions import HOLES, STAGGERED, check_together
from .geometry import (
    BoolArray,
    Counts,
    Range,
    distance_to,
    folded_points,
    geometries,
    neighbours,
    placed,
    shares_in,
    shifts_into,
)
from .model import Array, Model
from .units import Angle, Length, PositiveLength, in_radians, quantity

_QUARTER = 16
"""Chords per quarter of a turn in an outline; a circle loses 1.6e-3 of its area."""
_FINE_QUARTER = 45
"""Chords per quarter of a turn in shares of cells; they lie within 0.8e-4 of the diameter of a circle."""
_USUAL_ROTATIONS = (0, 15, 30, 45, 60, 90)
"""Rotations of holes [degree] that are tried where holes overlap."""
_PIECE = 16
"""Chords per piece of an outline, in a search for the nearest one."""
EQUAL_LENGTHS = 1e-9
"""Largest difference of two equal lengths, as a share of the period."""

_PAIR = tuple[PositiveLength, PositiveLength]


class Pattern(Model, ABC):
    """Where a plate has holes. A hole has all points within the distance `rounding` of its spine."""

    @property
    @abstractmethod
    def period(self) -> tuple[float, float]:
        """Extent along y and z [m] of the unit cell: the smallest rectangle, centred on the origin, that repeats."""

    @property
    @abstractmethod
    def open_area(self) -> float:
        """Share of holes in a period."""

    @property
    @abstractmethod
    def _holes(self) -> list[tuple[Array, Array]]:
        """Spines, each with the origins [m] and turns [rad] of its holes in a period, shape [holes, 3]. A spine is a
        polygon, anticlockwise, the ends of a line, or a point, shape [corners, 2] [m]."""

    @property
    def rounding(self) -> float:
        """How far a hole reaches beyond its spine [m]."""
        return 0.0

    @property
    def is_listed(self) -> bool:
        """Whether its holes are listed one by one."""
        return False

    @property
    def farthest(self) -> Array:
        """Extent (y, z) of the holes of a cell from the origin [m]."""
        corners = np.concatenate([placed(*holes).reshape(-1, 2) for holes in self._holes])
        return np.asarray(np.abs(corners).max(axis=0) + self.rounding)

    @property
    def _edge(self) -> float:
        """Distance from its hole within which a point lies on the edge [m]."""
        return EQUAL_LENGTHS * max(self.period)

    def _reaching(self, y_range: Range, z_range: Range) -> list[tuple[Array, Array]]:
        """Holes that reach into a rectangle, in the form of `_holes`."""
        reaching = []
        for spine, places in self._holes:
            corners = placed(spine, places)
            boxes = zip(corners.min(axis=1) - self.rounding, corners.max(axis=1) + self.rounding, strict=True)
            shifts = [shifts_into(low, high, self.period, y_range, z_range) for low, high in boxes]
            repeated = [place + np.pad(of_it, ((0, 0), (0, 1))) for place, of_it in zip(places, shifts, strict=True)]
            reaching.append((spine, np.concatenate(repeated)))
        return reaching

    def spines(self, y_range: Range, z_range: Range) -> Any:
        """Spines of the holes that reach into a rectangle, as an array of shapely geometries."""
        holes = [geometries(placed(spine, places)) for spine, places in self._reaching(y_range, z_range)]
        return np.concatenate([np.empty(0, dtype=object), *holes])

    def outlines(self, y_range: Range, z_range: Range, *, quarter: int = _QUARTER) -> list[Array]:
        """Closed outlines, anticlockwise, each of shape [points, 2] [m], of the holes that reach into a rectangle; arcs
        have this number of chords in a quarter of a turn."""
        rings: list[Array] = []
        for spine, places in self._reaching(y_range, z_range):
            hole = shapely.buffer(geometries(spine[None])[0], self.rounding, quad_segs=quarter)
            rings += list(placed(shapely.get_coordinates(shapely.orient_polygons(hole)), places))
        return rings

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie in a hole or on its edge; bool, of their broadcast shape."""
        return self._are_in_holes(folded_points(y, z, self.period))

    def _are_in_holes(self, points: Any) -> BoolArray:
        return distance_to(self._near, points) <= self.rounding + self._edge

    @cached_property
    def _near(self) -> Any:
        """Spines of the holes about a period."""
        return self.spines(*((-reach, reach) for reach in 0.5 * np.array(self.period) + self._edge))

    def shares_in_holes(self, counts: tuple[int, int], sides: tuple[float, float]) -> Counts:
        """Share of every cell that lies in holes, in parts of WHOLE_CELL, shape `counts`: cells of a period along y and
        z with these sides [m], from the origin on. Arcs are chords here, within 1e-4 of the size of a hole."""
        about = ((-side, side * (count + 1)) for side, count in zip(sides, counts, strict=True))
        return shares_in(self.outlines(*about, quarter=_FINE_QUARTER), counts, sides)

    def edge_distance(self, y: Array, z: Array) -> Array:
        """Distance of points y, z [m] from the nearest outline of a hole, of their broadcast shape: negative in a hole,
        inf where there is none. The chords of an outline lie within 0.13 % of the radius of its arcs."""
        points = folded_points(y, z, self.period)
        distance = distance_to(self._edges, points)
        return np.where(self._are_in_holes(points), -distance, distance)

    @cached_property
    def _edges(self) -> Any:
        """Outlines around a period, cut into pieces. Those along the end of the rectangle are no nearer to a point of
        the period than its own."""
        sides = np.array(self.period)
        rings = self.outlines(*((-reach, reach) for reach in 0.5 * (sides + np.hypot(*sides))))
        parts = [ring[at : at + _PIECE + 1] for ring in rings for at in range(0, len(ring) - 1, _PIECE)]
        numbers = np.repeat(np.arange(len(parts)), list(map(len, parts)))
        return shapely.linestrings(np.concatenate([*parts, np.empty((0, 2))]), indices=numbers)

    def ligament(self, size: tuple[float, float] | None = None) -> float:
        """Smallest distance between two holes, or between a whole hole and the rim of a plate of this `size` [m]; inf
        where there is none. A hole that the rim cuts has no distance to it."""
        if size is None:
            return self._nearest[0]
        sides, half = np.array(self.period), 0.5 * np.array(size)
        low, high = self._corners(self.spines(*((-side, side) for side in 0.5 * sides)))
        reach = (high - low).max(axis=0, initial=0.0)
        # A plate that is smaller by whole cells on every side cuts the same holes.
        half = half - np.maximum(0.0, np.floor((half - reach) / sides) - 2) * sides
        holes = self.spines(*((-side, side) for side in half))
        to_rim = (half - np.abs(self._corners(holes))).min(axis=(0, 2))
        between = neighbours(holes, len(holes))[0] - 2.0 * self.rounding
        return float(min(between, to_rim[to_rim >= 0].min(initial=np.inf)))

    def _corners(self, spines: Any) -> Array:
        """Lower and upper corners (y, z) of the boxes around holes, shape [2, holes, 2] [m]."""
        bounds = shapely.bounds(spines)
        return np.stack([bounds[:, :2] - self.rounding, bounds[:, 2:] + self.rounding])

    def _check_shape(self) -> None:
        """Raise a ValueError if the sizes make no hole."""

    @model_validator(mode="after")
    def _leaves_ligaments(self) -> Self:
        self._check_shape()
        gap, *holes = self._nearest
        if gap <= self._edge:
            raise ValueError(
                f"got {self._typed}, which lets the holes at {' and '.join(map(millimetres, holes))} overlap or touch, "
                f"but a ligament must be left between them{self._remedy}"
            )
        return self

    @property
    def _remedy(self) -> str:
        """What would keep holes apart that overlap, as the end of a sentence; empty where nothing is known."""
        return ""

    @property
    def _typed(self) -> str:
        """What a file gives that decides how near the holes come."""
        return f"spacing = {millimetres(self.period)}"

    @cached_property
    def _nearest(self) -> tuple[float, Array, Array]:
        """Smallest distance between two holes of the unbounded pattern [m], and the middles of both [m]."""
        if not self._holes:
            return math.inf, np.zeros(2), np.zeros(2)
        low, high = self._corners(np.concatenate([geometries(placed(*holes)) for holes in self._holes]))
        counts = 1 + np.ceil((high - low).max(axis=0) / self.period)
        around = [np.arange(-count, count + 1) * step for count, step in zip(counts, self.period, strict=True)]
        shifts = np.stack(np.meshgrid(*around, 0.0, indexing="ij"), axis=-1).reshape(-1, 3)
        shifts = shifts[np.argsort(np.abs(shifts).sum(axis=1), kind="stable")]  # the cell itself comes first
        images = [(spine, shift + places) for shift in shifts for spine, places in self._holes]
        corners = [placed(spine, places) for spine, places in images]
        middles = np.concatenate([of_holes.mean(axis=1) for of_holes in corners])
        gap, first, second = neighbours(np.concatenate(list(map(geometries, corners))), len(low))
        return gap - 2.0 * self.rounding, middles[first], middles[second]

    def is_symmetric(self, along_y: int, along_z: int, *, centred: bool) -> bool:
        """Whether (y, z) → (along_y·y, along_z·z), with 1, or −1 for a mirror image, then half a period along both if
        `centred`, changes nothing."""
        holes, image = self._cut_out(0.0), scale(self._cut_out(0.5 * centred), along_y, along_z, origin=(0.0, 0.0))
        return bool(holes.symmetric_difference(image).area <= EQUAL_LENGTHS * max(self.period) * holes.length)

    def _cut_out(self, shift: float) -> Any:
        """Holes of the rectangle of a period that is shifted by this share of it, seen from its middle."""
        at, half = shift * np.array(self.period), 0.5 * np.array(self.period)
        low, high = at - half, at + half
        spines = self.spines((low[0], high[0]), (low[1], high[1]))
        holes: Any = shapely.multipolygons(shapely.buffer(spines, self.rounding, quad_segs=4))  # as symmetric as arcs
        return translate(holes.intersection(shapely.box(*low, *high)), *-at)


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

    @property
    def _holes(self) -> list[tuple[Array, Array]]:
        return []


class HolePlace(NamedTuple):
    """Place of a hole in a cell: its origin [m] and its rotation from +y towards +z [rad]."""

    y: Length
    z: Length
    rotation: Angle = 0.0


class LatticePattern(Pattern):
    """Holes of one shape in a rectangular cell that repeats.

    A shape has a `spine`, which is a convex polygon, a line or a point. The hole has all points within the distance
    `rounding` of the spine. The spine of a slot is a line; that of a triangle with rounded corners is a smaller
    triangle.

    Attributes:
        staggered: shifts every odd row of cells along y by b/2 along z.
        spacing: extent (a, b) of the cell along y and z, or one length, the pitch, which is the distance of a hole from
            its nearest neighbours [m]. The lattice of a pitch is square; staggered it is hexagonal, with rows along z,
            and that of squares has rows as far apart as the holes in them.
        holes: places of the holes in a cell, each with an optional rotation in addition to `rotation`; by default one
            hole on the origin.
        rotation: rotation of every hole from +y towards +z, given in degrees or with its unit [rad]; by default 30 deg
            for hexagons on a staggered pitch, whose sides then face each other, else 0.
    """

    row_distance: ClassVar[float] = math.sqrt(0.75)
    """Distance of the rows of a staggered pitch, as a share of the pitch."""

    staggered: Annotated[bool, Field(strict=True)] = False
    spacing: _PAIR
    holes: Annotated[tuple[HolePlace, ...], Field(fail_fast=True, min_length=1, max_length=20_000)] | None = None
    rotation: Angle = 0.0

    @field_serializer("holes", when_used="json-unless-none")
    def _with_units(self, holes: tuple[HolePlace, ...]) -> list[tuple[float, float, str]]:
        """Write angles as text; pydantic before 2.14 ignores the types of a NamedTuple and writes plain numbers."""
        return [(float(hole.y), float(hole.z), in_radians(hole.rotation)) for hole in holes]

    @field_validator("spacing", mode="before", json_schema_input_type=_PAIR | PositiveLength)
    @classmethod
    def _of_a_pitch(cls, value: Any, info: ValidationInfo) -> Any:
        if not is_pitch(value):
            return value
        pitch = quantity(PositiveLength)(value)
        return (pitch * cls.row_distance if info.data.get("staggered") else pitch, pitch)

    @property
    @abstractmethod
    def spine(self) -> Array:
        """Corners of a convex polygon, anticlockwise, or the ends of a line, or a point, before any rotation; shape
        [corners, 2] [m]."""

    @property
    def inradius(self) -> float:
        """Distance of the sides of a hole from its place [m]."""
        return self.rounding

    @property
    def is_listed(self) -> bool:
        return self.holes is not None

    @property
    def _typed(self) -> str:
        sizes = [name for name in ("diameter", "length", "width", "side") if hasattr(self, name)]
        given = [f"{name} = {1e3 * getattr(self, name):g} mm" for name in sizes]
        (a, b), staggered = self.spacing, " staggered" if self.staggered else ""
        is_pitch = math.isclose(a, b * (self.row_distance if self.staggered else 1.0), rel_tol=EQUAL_LENGTHS)
        given.append(f"spacing = {f'{1e3 * b:g} mm' if is_pitch else millimetres(self.spacing)}{staggered}")
        turn = f"rotation = {math.degrees(self.rotation):.4g} deg"
        return ", ".join([*given, turn] if len(self.spine) > 1 else given)

    @property
    def _remedy(self) -> str:
        if len(self.spine) == 1:
            return ""
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        turned = {
            degrees: type(self).model_construct(**fields | {"rotation": math.radians(degrees)})._nearest[0]
            for degrees in _USUAL_ROTATIONS
        }
        best = max(turned, key=lambda degrees: round(turned[degrees], 9))  # the first of equal ones
        return f"; rotation = {best} deg leaves {1e3 * turned[best]:.3g} mm" if turned[best] > self._edge else ""

    @property
    def hole_area(self) -> float:
        """Area of one hole [m²] (Steiner's formula)."""
        shape = geometries(self.spine[None])[0]
        perimeter = shape.length * (2.0 if len(self.spine) == 2 else 1.0)  # a line counts on both sides
        return float(shape.area + self.rounding * perimeter + np.pi * self.rounding**2)

    @property
    def hole_size(self) -> tuple[float, float]:
        """Diameter of the largest circle in a hole about its place, and largest extent of a hole [m]."""
        longest = np.linalg.norm(self.spine[:, None] - self.spine[None], axis=-1).max()
        return 2.0 * self.inradius, float(longest) + 2.0 * self.rounding

    def _check_shape(self) -> None:
        check_together({STAGGERED: self.staggered, HOLES: self.holes is not None})
        if self.open_area >= 1:
            raise ValueError(f"got {self._typed}, but the cell must be larger than its holes")

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the unit cell along y and z [m]: two rows of a staggered lattice."""
        a, b = self.spacing
        return (2 * a, b) if self.staggered else (a, b)

    @property
    def open_area(self) -> float:
        return float(len(self._holes[0][1]) * self.hole_area / math.prod(self.period))

    @cached_property
    def _holes(self) -> list[tuple[Array, Array]]:
        a, b = self.spacing
        places = np.array(self.holes or ((0.0, 0.0, 0.0), (a, b / 2, 0.0))[: 1 + self.staggered])
        places[:, :2] -= np.round(places[:, :2] / self.period) * self.period
        places[:, 2] += self.rotation
        return [(self.spine, places)]


def is_pitch(value: Any) -> bool:
    """Whether a spacing is one length."""
    return isinstance(value, str | Real) and not isinstance(value, bool)


def millimetres(pair: Any) -> str:
    """A pair of lengths [m] in words."""
    y, z = (f"{round(1e3 * length, 6) + 0.0:g}" for length in pair)
    return f"({y}, {z}) mm"
