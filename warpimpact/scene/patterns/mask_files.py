"""Files that masks come from: images, arrays and drawings."""

import struct
import xml.etree.ElementTree as xml
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from ..units import PositiveLength, quantity
from .pattern import BoolArray

_MOST_CELLS = 4096  # along one side; 16 million in all
_CHORDS = 64  # of a curve of a drawing
_NOT_UNDERSTOOD = {"text", "image", "foreignObject", "clip-path", "mask"}


def read_mask(path: Path, cell_size: float) -> BoolArray:
    """Where a cell of a mask is material, shape [cells along y, cells along z].

    Args:
        path: a .png image, a .npy array or a .svg drawing.
        cell_size: side of a cell [m]; only a drawing needs it.

    Raises:
        ValueError: names the file and what is wrong with it.
    """
    match path.suffix.lower():
        case ".png":
            return _material(path, _read_png(path))
        case ".npy":
            return _material(path, _read_npy(path))
        case ".svg":
            return _material(path, ~_read_svg(path, cell_size))
    raise ValueError(f"{path.name} is not a mask: give a .png image, a .npy array or a .svg drawing")


def _material(path: Path, cells: NDArray[Any]) -> BoolArray:
    levels = np.unique(cells)
    if not (len(levels) == 2 and levels[0] == 0 < levels[1]):
        raise ValueError(f"{path.name} is not a mask: a mask has two values, 0 is hole and one above is material")
    material: BoolArray = cells != 0
    return material


def _read_png(path: Path) -> NDArray[Any]:
    with path.open("rb") as stream:
        header = stream.read(24)
    if len(header) < 24 or not header.startswith(b"\x89PNG\r\n\x1a\n"):
        raise ValueError(f"{path.name} is not a PNG image")
    _check_size(path, struct.unpack(">II", header[16:]))  # before anything is decoded
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
    _check_size(path, array.shape)
    return array


def _read_svg(path: Path, cell_size: float) -> BoolArray:
    """Where the middle of a cell lies in a filled shape of a drawing; where shapes of one path overlap is none."""
    import shapely

    extent = np.array([_svg_extent(path, side) for side in ("width", "height")])
    counts = np.round(extent / cell_size).astype(int)
    if not np.allclose(counts * cell_size, extent, rtol=1e-6):
        raise ValueError(
            f"{path.name} is {1e3 * extent[0]:g} mm × {1e3 * extent[1]:g} mm, "
            f"which cells of cell_size = {1e3 * cell_size:g} mm do not fill evenly"
        )
    _check_size(path, tuple(counts))
    shapes = _svg_shapes(path, extent)
    shapely.prepare(shapes)
    y, z = ((np.arange(count) + 0.5) * cell_size for count in counts)
    return np.array([shapely.contains_xy(shapes, at, z) for at in y])


def _svg_extent(path: Path, side: str) -> float:
    """Width or height of a drawing [m]; also checks that the drawing has nothing that is not understood."""
    try:
        root = xml.parse(path).getroot()
    except (xml.ParseError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} is not an SVG drawing: {error}") from None
    if _tag(root) != "svg":
        raise ValueError(f'{path.name} is not an SVG drawing: it begins with "{_tag(root)}"')
    for element in root.iter():
        for name in _NOT_UNDERSTOOD & {_tag(element), *element.attrib}:
            raise ValueError(f"{path.name} has {name}, which is not understood; give filled paths and plain shapes")
    if side not in root.attrib:
        raise ValueError(f'{path.name} has no {side}; a drawing has both width and height, such as "16mm"')
    try:
        return quantity(PositiveLength)(root.attrib[side])
    except ValueError as error:
        raise ValueError(f"{path.name}: {side}: {error}") from None


def _tag(element: xml.Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _svg_shapes(path: Path, extent: Array) -> Any:
    """All filled shapes of a drawing of this extent as one geometry, y and z from its lower left corner [m]."""
    import shapely
    import svgelements

    drawing = svgelements.SVG.parse(str(path))
    scale, filled = extent[0] / drawing.width, []
    for shape in drawing.elements():
        if isinstance(shape, svgelements.Shape) and shape.fill is not None and shape.fill.value is not None:
            rings = [_flattened(part) for part in abs(svgelements.Path(shape)).as_subpaths()]
            polygons = [shapely.make_valid(shapely.Polygon(ring)) for ring in rings if len(ring) > 2]
            nothing: Any = shapely.Polygon()
            filled.append(reduce(shapely.symmetric_difference, polygons, nothing))
    if not filled:
        raise ValueError(f"{path.name} has no filled shape, but filled shapes are the holes")
    return shapely.transform(shapely.union_all(filled), lambda points: points * (scale, -scale) + (0.0, extent[1]))


def _flattened(subpath: Any) -> Array:
    """Corners of a subpath, and points of its curves, shape [points, 2]."""
    import svgelements

    points = []
    for segment in subpath:
        straight = isinstance(segment, svgelements.Linear | svgelements.Move)
        points += [segment.point(t) for t in np.linspace(0.0, 1.0, _CHORDS + 1)[1:]] if not straight else [segment.end]
    return np.array([(point.x, point.y) for point in points if point is not None])


def _check_size(path: Path, shape: tuple[int, ...]) -> None:
    if not all(1 <= cells <= _MOST_CELLS for cells in shape):
        raise ValueError(
            f"{path.name} has {shape[0]} × {shape[1]} cells, "
            f"but a mask has at least 1 and at most {_MOST_CELLS} along each side"
        )
