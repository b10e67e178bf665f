"""Hole patterns: one hole shape on a periodic lattice, or any mask repeated periodically (MODEL §3)."""

import math
import struct
from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from .files import InputFile
from .model import Array, Model
from .units import PositiveLength

BoolArray = NDArray[np.bool_]
Range = tuple[float, float]

_MASK_LIMIT = 4096  # cells along one side; 16 million in all
_ARC = np.linspace(0.0, np.pi, 33)
_WITHIN = (np.arange(64) + 1.0 / math.e) / 64  # irrational: no probe lies on the edge of a hole of round numbers


class Pattern(Model, ABC):
    """Where a plate has holes."""

    @property
    @abstractmethod
    def period(self) -> tuple[float, float]:
        """Extent of a rectangular unit cell along y and z [m]."""

    @property
    @abstractmethod
    def open_area(self) -> float:
        """Share of holes in a unit cell."""

    @abstractmethod
    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie in a hole; bool, of their broadcast shape."""

    @property
    @abstractmethod
    def probes(self) -> tuple[Array, Array]:
        """Coordinates y and z [m] of a rectangular grid of points, none on an edge: two patterns of the kind and
        period that have a hole at the same ones of them are the same."""

    @abstractmethod
    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of the holes that reach into a rectangle."""


class NoPattern(Pattern):
    """A plate without holes; its unit cell is a square millimetre."""

    shape: Literal["none"] = "none"

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the unit cell along y and z [m]; any would do."""
        return (1e-3, 1e-3)

    @property
    def open_area(self) -> float:
        """Share of holes in a unit cell."""
        return 0.0

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """False everywhere, of the broadcast shape of y and z."""
        return np.zeros(np.broadcast_shapes(np.shape(y), np.shape(z)), dtype=bool)

    @property
    def probes(self) -> tuple[Array, Array]:
        """The origin: all points are alike."""
        return np.zeros(1), np.zeros(1)

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """There are none."""
        return []


class LatticePattern(Pattern):
    """One convex hole at the points (j·a, k·b) of a lattice with `spacing` (a, b) along y and z [m].

    `staggered` shifts every odd row j by b/2 along z. A hole fits into its a × b cell with a ligament
    left around it, so that holes never overlap.
    """

    spacing: tuple[PositiveLength, PositiveLength]
    staggered: Annotated[bool, Field(strict=True)] = False

    @property
    @abstractmethod
    def hole_area(self) -> float:
        """Area of one hole [m²]."""

    @property
    @abstractmethod
    def hole_outline(self) -> Array:
        """Closed outline of the hole on the origin, shape [points, 2] [m]; touches its bounding box."""

    @abstractmethod
    def _in_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points near the origin lie in the hole on the origin."""

    @model_validator(mode="after")
    def _leaves_a_ligament(self) -> Self:
        low, high = self._bounding_box
        for axis, pitch, extent in zip("yz", self.spacing, high - low, strict=True):
            if pitch <= extent:
                raise ValueError(
                    f"got spacing = {1e3 * pitch:g} mm along {axis}, "
                    f"but it must be larger than the hole, {1e3 * extent:g} mm"
                )
        return self

    @property
    def period(self) -> tuple[float, float]:
        """Extent of a rectangular unit cell along y and z [m]: two rows of a staggered lattice."""
        a, b = self.spacing
        return (2 * a, b) if self.staggered else (a, b)

    @property
    def open_area(self) -> float:
        """Share of holes in a unit cell."""
        a, b = self.spacing
        return self.hole_area / (a * b)

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie in a hole; bool, of their broadcast shape."""
        a, b = self.spacing
        middle_y, middle_z = self._bounding_box.mean(axis=0)
        row = np.round((y - middle_y) / a)
        shift = self._shift(row)
        column = np.round((z - middle_z - shift) / b)
        return self._in_hole(y - row * a, z - shift - column * b)

    @property
    def probes(self) -> tuple[Array, Array]:
        """Coordinates y and z [m] of a grid as fine as the hole needs, over the holes of two rows."""
        low, high = self._bounding_box
        y, z = (low + _WITHIN[:, None] * (high - low)).T
        shift = float(self._shift(np.array(1)))
        return np.concatenate([y, y + self.spacing[0]]), np.concatenate([z, z + shift])

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of the holes that reach into a rectangle."""
        a, b = self.spacing
        (low_y, low_z), (high_y, high_z) = self._bounding_box
        centres = []
        for row in _lattice_range(y_range, a, low_y, high_y):
            shift = float(self._shift(row))
            z_shifted = (z_range[0] - shift, z_range[1] - shift)
            centres += [(row * a, column * b + shift) for column in _lattice_range(z_shifted, b, low_z, high_z)]
        return [self.hole_outline + centre for centre in centres]

    def _shift(self, row: Array) -> Array:
        """Shift of a row of holes along z [m]."""
        return np.where(self.staggered & (row % 2 == 1), self.spacing[1] / 2, 0.0)

    @cached_property
    def _bounding_box(self) -> Array:
        """Lower and upper corner (y, z) of the hole on the origin, shape [2, 2] [m]."""
        return np.array([self.hole_outline.min(axis=0), self.hole_outline.max(axis=0)])


class SlotPattern(LatticePattern):
    """Stadium-shaped slots, overall `length` along z and `width` along y [m]."""

    shape: Literal["slot"] = "slot"
    length: PositiveLength
    width: PositiveLength

    @model_validator(mode="after")
    def _longer_than_wide(self) -> Self:
        if self.length < self.width:
            raise ValueError(
                f"got length = {1e3 * self.length:g} mm, "
                f"but a slot must be at least as long as wide, {1e3 * self.width:g} mm"
            )
        return self

    @property
    def hole_area(self) -> float:
        """Area of one slot [m²]."""
        return self.width * (self.length - self.width) + np.pi / 4 * self.width**2

    @property
    def hole_outline(self) -> Array:
        """Closed outline of the slot on the origin, shape [points, 2] [m]."""
        end = self.width / 2 * np.column_stack([np.cos(_ARC), np.sin(_ARC)]) + (0, self._half_flank)
        return np.concatenate([end, -end, end[:1]])

    def _in_hole(self, y: Array, z: Array) -> BoolArray:
        beyond_flank = np.maximum(np.abs(z) - self._half_flank, 0.0)
        return y**2 + beyond_flank**2 <= (self.width / 2) ** 2

    @property
    def _half_flank(self) -> float:
        return (self.length - self.width) / 2


class CirclePattern(LatticePattern):
    """Round holes of `diameter` [m]."""

    shape: Literal["circle"] = "circle"
    diameter: PositiveLength

    @property
    def hole_area(self) -> float:
        """Area of one hole [m²]."""
        return np.pi / 4 * self.diameter**2

    @property
    def hole_outline(self) -> Array:
        """Closed outline of the hole on the origin, shape [points, 2] [m]."""
        arc = self.diameter / 2 * np.column_stack([np.cos(_ARC), np.sin(_ARC)])
        return np.concatenate([arc, -arc])

    def _in_hole(self, y: Array, z: Array) -> BoolArray:
        return y**2 + z**2 <= (self.diameter / 2) ** 2


class TrianglePattern(LatticePattern):
    """Equilateral triangles of `side` [m]: centroid on the lattice point, one side along y, apex to +z."""

    shape: Literal["triangle"] = "triangle"
    side: PositiveLength

    @property
    def hole_area(self) -> float:
        """Area of one hole [m²]."""
        return np.sqrt(3) / 4 * self.side**2

    @property
    def hole_outline(self) -> Array:
        """Closed outline of the hole on the origin, shape [4, 2] [m]."""
        half, base, apex = self.side / 2, -self._inradius, 2 * self._inradius
        return np.array([(-half, base), (half, base), (0.0, apex), (-half, base)])

    def _in_hole(self, y: Array, z: Array) -> BoolArray:
        # Distances from the centroid along the outward normals of the base and of the nearer flank.
        flank = np.sqrt(3) / 2 * np.abs(y) + z / 2
        return np.maximum(-z, flank) <= self._inradius

    @property
    def _inradius(self) -> float:
        return self.side / np.sqrt(12)


class MaskPattern(Pattern):
    """Square cells of `cell_size` [m] from a file, repeated periodically, the mask centred on the origin.

    A .npy file holds a two-dimensional array, axis 0 along y and axis 1 along z: zero is hole, one other
    value is material. In a PNG image y runs from left to right and z from bottom to top: black is hole, one
    other grey is material.
    """

    shape: Literal["mask"] = "mask"
    file: InputFile
    cell_size: PositiveLength

    @model_validator(mode="after")
    def _is_a_mask(self) -> Self:
        _ = self.material
        return self

    @cached_property
    def material(self) -> BoolArray:
        """Where a cell is material, bool of shape [cells along y, cells along z], read-only."""
        cells = _read_mask(self.file)
        levels = np.unique(cells)
        if not (len(levels) == 2 and levels[0] == 0 < levels[1]):
            raise ValueError(
                f"{self.file.name} is not a mask: a mask has two values, 0 is hole and one above is material"
            )
        material = cells != 0
        material.setflags(write=False)
        return material

    @property
    def period(self) -> tuple[float, float]:
        """Extent of the mask along y and z [m]."""
        along_y, along_z = self.material.shape
        return (along_y * self.cell_size, along_z * self.cell_size)

    @property
    def open_area(self) -> float:
        """Share of holes in the mask."""
        return 1 - float(self.material.mean())

    def is_hole(self, y: Array, z: Array) -> BoolArray:
        """Whether points y, z [m] lie in a hole; bool, of their broadcast shape."""
        i, j = (
            np.floor(coordinate / self.cell_size + cells / 2).astype(np.int64) % cells
            for coordinate, cells in zip((y, z), self.material.shape, strict=True)
        )
        return ~self.material[i, j]

    @property
    def probes(self) -> tuple[Array, Array]:
        """Coordinates y and z [m] of two points in every row and column of cells, and in every half of one."""
        y, z = ((np.arange(2 * cells) + 0.5 - cells) * (0.5 * self.cell_size) for cells in self.material.shape)
        return y, z

    def outlines(self, y_range: Range, z_range: Range) -> list[Array]:
        """Closed outlines, each of shape [points, 2] [m], of holes cut off at a rectangle."""
        from contourpy import contour_generator

        y, z = (
            self._cell_centres(ends, cells) for ends, cells in zip((y_range, z_range), self.material.shape, strict=True)
        )
        hole = self.is_hole(y, z[:, None]).astype(float)
        hole[[0, -1], :] = hole[:, [0, -1]] = 0.0  # closes the outlines of holes that go on outside
        lines: list[Array] = contour_generator(y, z, hole, line_type="Separate").lines(0.5)  # type: ignore[assignment]
        return lines

    def _cell_centres(self, ends: Range, cells: int) -> Array:
        """Centres [m] of the cells that cover a range, and of one more at each end."""
        low, high = np.floor(np.array(ends) / self.cell_size + cells / 2)
        return (np.arange(low - 1, high + 2) + 0.5 - cells / 2) * self.cell_size


AnyPattern = Annotated[
    SlotPattern | CirclePattern | TrianglePattern | NoPattern | MaskPattern, Field(discriminator="shape")
]


def _lattice_range(ends: Range, pitch: float, low: float, high: float) -> Array:
    """Integers i for which [i·pitch + low, i·pitch + high] reaches into a range."""
    return np.arange(np.ceil((ends[0] - high) / pitch), np.floor((ends[1] - low) / pitch) + 1)


def _read_mask(path: Path) -> NDArray[Any]:
    """Numbers of a mask file, shape [cells along y, cells along z]."""
    readers = {".png": _read_png, ".npy": _read_npy}
    if path.suffix.lower() not in readers:
        raise ValueError(f"{path.name} is not a mask: give a .png image or a .npy array")
    return readers[path.suffix.lower()](path)


def _read_png(path: Path) -> NDArray[Any]:
    with path.open("rb") as stream:
        header = stream.read(24)
    if len(header) < 24 or not header.startswith(b"\x89PNG\r\n\x1a\n"):
        raise ValueError(f"{path.name} is not a PNG image")
    _check_mask_size(path, struct.unpack(">II", header[16:]))  # before anything is decoded
    from PIL import Image

    try:
        with Image.open(path) as image:
            if image.mode not in ("1", "L", "P", "RGB"):
                raise ValueError(f"{path.name} is not a mask: give a grey or 1-bit image, not {image.mode}")
            return np.asarray(image.convert("L"))[::-1].T
    except OSError as error:
        raise ValueError(f"{path.name} is a damaged PNG image: {error}") from None


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        array = np.lib.format.open_memmap(path, mode="r")
    except (ValueError, OSError):
        raise ValueError(f"{path.name} is not an array of numbers in .npy format") from None
    if array.ndim != 2 or array.dtype.kind not in "biuf":
        raise ValueError(f"{path.name} is not a mask: a mask is a two-dimensional array of numbers")
    _check_mask_size(path, array.shape)
    return array


def _check_mask_size(path: Path, shape: tuple[int, ...]) -> None:
    if not all(1 <= cells <= _MASK_LIMIT for cells in shape):
        raise ValueError(
            f"{path.name} has {shape[0]} × {shape[1]} cells, "
            f"but a mask has at least 1 and at most {_MASK_LIMIT} along each side"
        )
