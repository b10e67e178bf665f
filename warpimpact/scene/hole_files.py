"""Holes of a cell from a file: circles of a table (CSV), or circles and closed polylines of a drawing (DXF)."""

import cmath
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from .geometry import Range, neighbours
from .input_files import check_file, read_columns
from .model import Array
from .pattern import EQUAL_LENGTHS, millimetres
from .units import Length

HOLES, PERIOD, RIM = "HOLES", "PERIOD", "RIM"
"""Layers of a drawing: the holes, the cell that repeats, and the edge of a finite plate."""
_CHORD = math.radians(5.0)
"""Largest angle of a chord of an arc, which then lies within 1e-3 of its radius from the arc."""


@dataclass(frozen=True)
class HoleFile:
    """Holes of a file.

    Attributes:
        name: of the file.
        holes: outlines by the words that name a hole in a message, shape [corners, 2] [m] each.
        cell: extent (y, z) of the cell that repeats [m], where the file has it.
        rim: extent (y, z) of a finite plate [m], where the file has it.
    """

    name: str
    holes: dict[str, Array] = field(default_factory=dict)
    cell: Range | None = None
    rim: Range | None = None

    @property
    def without_cell(self) -> str:
        """What to give for a file without a cell; for a finite plate a cell whose edge no hole crosses."""
        if self.rim is None:
            return f"spacing is missing: give the extent of the cell that {self.name} fills, along y and z"
        farthest = np.abs(np.concatenate(list(self.holes.values()))).max(axis=0)
        spacing, size = np.floor(1e3 * np.maximum(2.0 * farthest, self.rim)) + 1.0, 1e3 * np.array(self.rim)
        keys = (f'{key} = ["{y:g} mm", "{z:g} mm"]' for key, (y, z) in (("spacing", spacing), ("plate.size", size)))
        return f"{self.name} has a finite plate in its layer {RIM}, and no cell; give {' here and '.join(keys)}"

    def check(self, cell: Range) -> None:
        """Refuse holes of no area, outside the cell, or without a ligament to the next one.

        Raises:
            ValueError: the message names the file, the hole and its fault.
        """
        polygons: Any = np.array([shapely.Polygon(outline) for outline in self.holes.values()])
        labels, sides = list(self.holes), np.array(cell)
        for label, polygon in zip(labels, polygons, strict=True):
            if not shapely.is_valid(polygon) or shapely.area(polygon) <= (EQUAL_LENGTHS * sides.max()) ** 2:
                raise ValueError(f"{self.name}, {label}: its outline crosses itself or has no area")
            middle = np.array([polygon.centroid.x, polygon.centroid.y])
            if (np.abs(middle) > 0.5 * sides * (1.0 + EQUAL_LENGTHS)).any():
                raise ValueError(
                    f"{self.name}, {label}: its middle lies outside the cell, which reaches "
                    f"{millimetres(0.5 * sides)} from y = z = 0; give a larger spacing, or coordinates from the middle "
                    "of the cell"
                )
        low, high = np.split(shapely.bounds(polygons), 2, axis=1)
        counts = 1 + np.ceil((high - low).max(axis=0) / sides)
        steps = [np.arange(-count, count + 1) * side for count, side in zip(counts, cell, strict=True)]
        shifts = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
        shifts = shifts[np.argsort(np.abs(shifts).sum(axis=1), kind="stable")]  # the cell itself comes first
        images = np.concatenate([_moved(polygons, shift) for shift in shifts])
        gap, first, second = neighbours(images, len(polygons))
        if gap <= EQUAL_LENGTHS * sides.max():
            other = labels[second % len(polygons)]
            again = " of the next cell" if second >= len(polygons) else ""
            raise ValueError(
                f"{self.name}, {labels[first]}: overlaps or touches {other}{again}; give each hole once and "
                "whole, also at the edge of the cell, with a ligament to the next"
            )


def read_holes(path: Path) -> HoleFile:
    """The holes of a CSV file with the columns y, z and diameter, or of a DXF drawing.

    Raises:
        ValueError: the message names the file and its fault.
    """
    check_file(path)
    if path.suffix.lower() == ".dxf":
        return _of_drawing(path)
    if path.suffix.lower() != ".csv":
        raise ValueError(f'got "{path.name}", but holes come from a .csv or a .dxf file')
    columns = read_columns(path, dict.fromkeys(("y", "z", "diameter"), Length), ("y", "z", "diameter"))
    holes = {}
    for row, (y, z, diameter) in enumerate(zip(*columns.values(), strict=True), start=1):
        if diameter <= 0.0:
            raise ValueError(
                f"{path.name}, row {row}: got diameter = {1e3 * diameter:g} mm, but it must be greater than 0"
            )
        holes[f"row {row}"] = _outline(_circle(y, z, 0.5 * diameter))
    return HoleFile(path.name, holes)


def _of_drawing(path: Path) -> HoleFile:
    """Holes of the layer HOLES, or of all other layers if there is none; the cell of the layer PERIOD."""
    try:
        from ezdxf.enums import InsertUnits
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
        from ezdxf.units import conversion_factor
        from ezdxf.upright import upright_all
    except ImportError:
        raise ValueError("DXF needs ezdxf: pip install 'warpimpact[cad]'") from None
    try:
        drawing = readfile(path)
    except (OSError, ValueError, DXFError) as error:
        raise ValueError(f"{path.name} cannot be read as a DXF drawing: {error}") from None
    if not drawing.units:
        raise ValueError(
            f"{path.name} has no units ($INSUNITS is 0); set the units of the drawing, such as millimetres, in the CAD "
            "program and save it again"
        )
    scale = conversion_factor(InsertUnits(drawing.units), InsertUnits.Meters)
    space = drawing.modelspace()
    upright_all(space)
    layers: dict[str, list[Any]] = {}
    for entity in space:
        layers.setdefault(entity.dxf.layer.upper(), []).append(entity)
    frames = {
        name: scale * _rectangle(layers.pop(name), f"{path.name}, layer {name}")
        for name in (PERIOD, RIM)
        if name in layers
    }
    middle = next(iter(frames.values()), np.zeros((2, 2))).mean(axis=0)
    holes = {}
    for entity in layers.get(HOLES) or [entity for several in layers.values() for entity in several]:
        vertices = _vertices(entity, path.name) * [scale, scale, 1.0] - [*middle, 0.0]
        holes[f"{entity.dxftype()} {entity.dxf.handle} at {millimetres(vertices[:, :2].mean(axis=0))}"] = _outline(
            vertices
        )
    if not holes:
        raise ValueError(f"{path.name} has no holes: circles and closed polylines in a layer {HOLES}")
    extents = {name: (*np.ptp(at, axis=0).tolist(),) for name, at in frames.items()}
    return HoleFile(path.name, holes, extents.get(PERIOD), extents.get(RIM))


def _moved(polygons: Any, shift: Array) -> Any:
    return shapely.transform(polygons, lambda corners: corners + shift)


def _rectangle(entities: list[Any], place: str) -> Array:
    """Lower and upper corner of the only rectangle of a layer, as the drawing has them."""
    corners = np.concatenate([_vertices(entity, place)[:, :2] for entity in entities])
    low, high = corners.min(axis=0), corners.max(axis=0)
    if len(corners) != 4 or not np.isclose(shapely.Polygon(corners).area, np.prod(high - low), rtol=1e-6):
        raise ValueError(f"{place}: must be one closed rectangle along y and z")
    return np.stack([low, high])


def _vertices(entity: Any, file: str) -> Array:
    """Vertices of a circle or a closed polyline as the drawing has them: y, z, and bulge of the part that follows."""
    kind = entity.dxftype()
    if kind == "CIRCLE":
        return _circle(entity.dxf.center.x, entity.dxf.center.y, entity.dxf.radius)
    if kind == "LWPOLYLINE":
        vertices, is_closed = np.array(entity.get_points("xyb")), entity.closed
    elif kind == "POLYLINE" and entity.is_2d_polyline:
        points = [(*one.dxf.location.vec2, one.dxf.get("bulge", 0.0)) for one in entity.vertices]
        vertices, is_closed = np.array(points), entity.is_closed
    else:
        vertices, is_closed = np.zeros((0, 3)), False
    is_ring = len(vertices) > 1 and np.allclose(vertices[0, :2], vertices[-1, :2], rtol=0.0, atol=1e-9)
    if not (is_closed or is_ring):
        raise ValueError(
            f"{file}: got {kind} {entity.dxf.handle} in layer {entity.dxf.layer}, but a hole is a circle or a closed "
            f"polyline; explode blocks, join lines and arcs, and put what is no hole outside the layer {HOLES}"
        )
    return vertices[:-1] if is_ring else vertices


def _circle(y: float, z: float, radius: float) -> Array:
    return np.array([[y - radius, z, 1.0], [y + radius, z, 1.0]])


def _outline(vertices: Array) -> Array:
    """Corners of an outline, shape [corners, 2]: the chords of an arc enclose the area of the arc."""
    corners: list[complex] = []
    at = vertices[:, 0] + 1j * vertices[:, 1]
    for start, end, bulge in zip(at.tolist(), np.roll(at, -1).tolist(), vertices[:, 2].tolist(), strict=True):
        corners.append(start)
        angle = 4.0 * math.atan(bulge)
        count = math.ceil(abs(angle) / _CHORD)
        if count < 2:
            continue
        centre = 0.5 * (start + end) + 0.5j * (end - start) / math.tan(0.5 * angle)
        # Both ends lie on the arc, those between at f radii: 2 f + (n − 2) f² = n θ / sin θ.
        ratio = abs(angle) / math.sin(abs(angle) / count)
        share = 0.5 * ratio if count == 2 else (math.sqrt(1.0 + (count - 2) * ratio) - 1.0) / (count - 2)
        turns = [cmath.rect(share, angle * k / count) for k in range(1, count)]
        corners += [centre + (start - centre) * turn for turn in turns]
    return np.array([(corner.real, corner.imag) for corner in corners])
