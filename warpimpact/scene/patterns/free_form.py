"""Free forms from a few numbers, or from the corners of their holes."""

import itertools
import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from ..model import Array, Model
from ..units import Angle, Length, PositiveLength
from .cells import FreeForm
from .pattern import BoolArray

_MOST_POLYGONS, _MOST_CORNERS = 400, 400  # which are read and drawn within seconds
_Exponent = Annotated[float, Field(gt=0.05, le=100.0)]


class Supershape(Model):
    """One hole of a free form, ``r(θ) ∝ (|cos(mθ/4)|^n2 + |sin(mθ/4)|^n3)^(−1/n1)``.

    Source: J. Gielis, American Journal of Botany 90 (2003) 333.

    Attributes:
        y, z: its place in the cell [m].
        radius: its largest radius, before `stretch` [m].
        lobes: m, number of equal parts around; 0 for a circle.
        exponents: n1, n2 and n3.
        stretch: length along its z over length along its y, before the rotation.
        rotation: from +y towards +z [rad].
    """

    y: Length = 0.0
    z: Length = 0.0
    radius: PositiveLength
    lobes: Annotated[int, Field(strict=True, ge=0, le=24)] = 4
    exponents: tuple[_Exponent, _Exponent, _Exponent] = (2.0, 2.0, 2.0)
    stretch: Annotated[float, Field(ge=0.1, le=10.0)] = 1.0
    rotation: Angle = 0.0

    @property
    def reach(self) -> float:
        """Largest distance of its edge from its place [m]."""
        return self.radius * max(1.0, self.stretch)

    def holds(self, y: Array, z: Array) -> BoolArray:
        """Whether points, relative to its place [m], lie in it; in their broadcast shape."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        along_y, along_z = cosine * y + sine * z, (cosine * z - sine * y) / self.stretch
        radius = self._form(np.arctan2(along_z, along_y))
        largest = self._form(np.linspace(-np.pi, np.pi, 1441)).max()
        return np.asarray(np.hypot(along_y, along_z) <= self.radius * radius / largest)

    def _form(self, angle: Array) -> Array:
        """r(θ) of the class's formula, up to a factor."""
        n1, n2, n3 = self.exponents
        turn = 0.25 * self.lobes * angle
        return np.asarray((np.abs(np.cos(turn)) ** n2 + np.abs(np.sin(turn)) ** n3) ** (-1.0 / n1))


class Wave(Model):
    """A term of a level set, amplitude × cos(2π (k y/a + l z/b) + phase).

    Attributes:
        along_y, along_z: k and l, periods in the cell.
        amplitude: relative to the other waves.
        phase: shift of the wave [rad].
    """

    along_y: Annotated[int, Field(strict=True, ge=-6, le=6)]
    along_z: Annotated[int, Field(strict=True, ge=-6, le=6)]
    amplitude: Annotated[float, Field(ge=-100.0, le=100.0)] = 1.0
    phase: Angle = 0.0


class _Polygon(NamedTuple):
    """One hole with straight edges.

    Attributes:
        y, z: its place, the middle of its extent [m].
        reach: the farthest that it extends from its place along y or z [m].
        outline: a shapely polygon, from its place.
    """

    y: float
    z: float
    reach: float
    outline: Any

    @classmethod
    def of(cls, corners: Array) -> Self:
        """From corners of shape [corners, 2] [m]."""
        import shapely

        low, high = corners.min(axis=0), corners.max(axis=0)
        place = 0.5 * (low + high)
        outline = shapely.Polygon(corners - place)
        shapely.prepare(outline)
        return cls(float(place[0]), float(place[1]), 0.5 * float((high - low).max()), outline)

    def holds(self, y: Array, z: Array) -> BoolArray:
        """Whether points, relative to its place [m], lie in it; in their broadcast shape."""
        import shapely

        return np.asarray(shapely.contains_xy(self.outline, *np.broadcast_arrays(y, z)))


class _UnionPattern(FreeForm):
    """Forms in a cell; forms that overlap make one hole.

    Attributes:
        staggered: shifts every odd row of cells along y by b/2 along z.
    """

    staggered: Annotated[bool, Field(strict=True)] = False

    @property
    @abstractmethod
    def _forms(self) -> Sequence[Supershape | _Polygon]:
        """The forms of a cell."""

    @property
    def extent(self) -> tuple[float, float]:
        return ((2.0 if self.staggered else 1.0) * self.spacing[0], self.spacing[1])

    def drawn(self, y: Array, z: Array) -> BoolArray:
        sides = (len(y) * self.side, len(z) * self.side)
        rows = ((-0.25, -0.25), (0.25, 0.25)) if self.staggered else ((0.0, 0.0),)
        holes = np.zeros((len(y), len(z)), dtype=bool)
        for form in self._forms:
            for row in rows:
                place = [at + share * side for at, share, side in zip((form.y, form.z), row, sides, strict=True)]
                images = [_images(at, form.reach, side) for at, side in zip(place, sides, strict=True)]
                for at_y, at_z in itertools.product(*images):
                    near_y, near_z = (np.abs(axis.ravel() - at) <= form.reach for axis, at in ((y, at_y), (z, at_z)))
                    holes[np.ix_(near_y, near_z)] |= form.holds(y[near_y] - at_y, z[near_z] - at_z)
        return holes


class SupershapePattern(_UnionPattern):
    """Unions of one to three supershapes in a cell.

    Attributes:
        shape: "supershape".
        forms: the supershapes.
    """

    shape: Literal["supershape"] = "supershape"
    forms: Annotated[tuple[Supershape, ...], Field(min_length=1, max_length=3)]

    @property
    def _forms(self) -> Sequence[Supershape | _Polygon]:
        return self.forms


_Corners = Annotated[tuple[tuple[Length, Length], ...], Field(min_length=3, max_length=_MOST_CORNERS, fail_fast=True)]


class PolygonsPattern(_UnionPattern):
    """Holes of any outline in a cell, by their corners.

    Attributes:
        shape: "polygons".
        polygons: corners (y, z) of each hole, from the middle of the cell [m].
    """

    shape: Literal["polygons"] = "polygons"
    polygons: Annotated[tuple[_Corners, ...], Field(min_length=1, max_length=_MOST_POLYGONS, fail_fast=True)]

    @field_validator("polygons")
    @classmethod
    def _bound_holes_in_the_cell(cls, polygons: tuple[_Corners, ...], info: ValidationInfo) -> tuple[_Corners, ...]:
        import shapely

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

    @property
    def _forms(self) -> Sequence[Supershape | _Polygon]:
        return [_Polygon.of(np.array(corners)) for corners in self.polygons]


class LevelSetPattern(FreeForm):
    """Holes where a sum of a few waves is largest.

    Attributes:
        shape: "level_set".
        waves: the terms of the sum.
        share: open area of the cell, before a tool opens the holes.
    """

    shape: Literal["level_set"] = "level_set"
    waves: Annotated[tuple[Wave, ...], Field(min_length=1, max_length=12)]
    share: Annotated[float, Field(gt=0.0, lt=1.0)]

    @property
    def extent(self) -> tuple[float, float]:
        return self.spacing

    def drawn(self, y: Array, z: Array) -> BoolArray:
        a, b = len(y) * self.side, len(z) * self.side
        height = sum(
            wave.amplitude * np.cos(2.0 * np.pi * (wave.along_y * y / a + wave.along_z * z / b) + wave.phase)
            for wave in self.waves
        )
        if np.ptp(height) < 1e-9:
            raise ValueError("got waves that cancel, but their sum must differ from place to place")
        return np.asarray(height > np.quantile(height, 1.0 - self.share))


def _images(place: float, reach: float, side: float) -> list[float]:
    """Places [m] of the images of a hole that reach into a period about the origin."""
    first, last = (math.ceil((-0.5 * side - reach - place) / side), math.floor((0.5 * side + reach - place) / side))
    return [place + number * side for number in range(first, last + 1)]
