"""Files that masks come from: images, arrays and drawings."""

import math
import signal
import subprocess
import sys
import xml.etree.ElementTree as xml
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files import check_file
from ..model import Array
from ..units import PositiveLength, brief, quantity
from .drawings import check_drawing
from .pattern import BoolArray

_MOST_CELLS = 4096  # along one side; 16 million in all
_CHORDS = 64  # of a curve of a drawing
_MOST_BYTES = 2**28
_LONGEST, _MOST_MEMORY = 20.0, 2**32
"""Processor time [s] and memory [bytes] that a drawing may take."""
_PATIENCE = 10.0
"""Times as long as that a loaded machine may take."""
_CHILD = "import sys; from warpimpact.scene.patterns.mask_files import draw; draw(*sys.argv[1:])"
_REFUSED = 3
_OUT_OF_TIME = [-getattr(signal, name) for name in ("SIGXCPU",) if hasattr(signal, name)]
_MOST_CROSSING = 500
"""Corners of an outline that crosses itself."""
_MOST_HOLES = 10_000
"""Whose distances from each other are found within seconds."""


def read_mask(path: Path, cell_size: float) -> BoolArray:
    """Where a cell of a mask is material, shape [cells along y, cells along z].

    Args:
        path: a .png image, a .npy array or a .svg drawing.
        cell_size: side of a cell [m]; only a drawing needs it.

    Raises:
        ValueError: names the file and what is wrong with it.
    """
    check_file(path, _MOST_BYTES)
    match path.suffix.lower():
        case ".png":
            return _material(path, _read_png(path))
        case ".npy":
            return _material(path, _read_npy(path))
        case ".svg":
            return _material(path, ~_read_svg(path, cell_size))
    raise ValueError(f"{path.name} is not a mask: give a .png image, a .npy array or a .svg drawing")


def _material(path: Path, cells: NDArray[Any]) -> BoolArray:
    from scipy.ndimage import label  # a quarter of a second to import

    levels = np.unique(cells)
    if not (len(levels) == 2 and levels[0] == 0 < levels[1]):
        raise ValueError(f"{path.name} is not a mask: a mask has two values, 0 is hole and one above is material")
    material: BoolArray = cells != 0
    holes = label(~material)[1]
    if holes > _MOST_HOLES:
        raise ValueError(f"{path.name} has {holes} holes, but a mask has at most {_MOST_HOLES}")
    return material


def _read_png(path: Path) -> NDArray[Any]:
    from PIL.PngImagePlugin import PngImageFile

    try:
        image = PngImageFile(path)  # reads the header; nothing is decoded yet
    except Exception:  # Pillow lets errors of many classes through
        raise ValueError(f"{path.name} is not a PNG image") from None
    with image:
        _check_size(path, image.size)
        try:
            mode = image.mode
            cells = np.asarray(image.convert("L"))[::-1].T
        except Exception as error:
            raise ValueError(f"{path.name} is a damaged PNG image: {brief(str(error))}") from None
    if mode not in ("1", "L", "P", "RGB"):
        raise ValueError(f"{path.name} is not a mask: give a grey or 1-bit image, not {mode}")
    return cells


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        array = np.lib.format.open_memmap(path, mode="r")
    except Exception:  # a header is a literal of Python, which may be anything
        raise ValueError(f"{path.name} is not an array of numbers in .npy format") from None
    if array.ndim != 2 or array.dtype.kind not in "biuf":
        raise ValueError(f"{path.name} is not a mask: a mask is a two-dimensional array of numbers")
    _check_size(path, array.shape)
    return array


def _read_svg(path: Path, cell_size: float) -> BoolArray:
    """`_cells_of` in a process of its own: what a drawing costs shows when it is drawn."""
    check_drawing(path)
    command = [sys.executable, "-P", "-c", _CHILD, str(path), repr(cell_size), repr(_LONGEST)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_PATIENCE * _LONGEST, check=False)
    except subprocess.TimeoutExpired:
        done = None
    if done is None or done.returncode in _OUT_OF_TIME:
        raise ValueError(f"{path.name} takes more than {_LONGEST:g} s to draw; give fewer or simpler shapes")
    if done.returncode == _REFUSED:
        raise ValueError(done.stderr.decode())
    if done.returncode:
        raise ValueError(f"{path.name} cannot be drawn within {_MOST_MEMORY >> 30} GiB; give fewer or simpler shapes")
    cells: BoolArray = np.load(BytesIO(done.stdout), allow_pickle=False)
    return cells


def draw(path: str, cell_size: str, longest: str) -> None:
    """What the process does: it writes the cells of a drawing, or why there are none."""
    with suppress(ImportError):  # a system without such limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY, _MOST_MEMORY))
        seconds = math.ceil(float(longest))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    try:
        np.save(sys.stdout.buffer, _cells_of(Path(path), float(cell_size)))
    except ValueError as error:
        sys.stderr.write(str(error))
        sys.exit(_REFUSED)


def _cells_of(path: Path, cell_size: float) -> BoolArray:
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
    try:
        shapes = _svg_shapes(path, extent)
    except _NoShape:
        raise
    except Exception as error:  # of drawings that are no drawings, svgelements lets errors of any class through
        raise ValueError(f"{path.name} has shapes that cannot be read: {brief(str(error))}") from None
    shapely.prepare(shapes)
    y, z = ((np.arange(count) + 0.5) * cell_size for count in counts)
    return np.array([shapely.contains_xy(shapes, at, z) for at in y])


def _svg_extent(path: Path, side: str) -> float:
    """Width or height of a drawing [m]."""
    root = xml.parse(path).getroot()
    if side not in root.attrib:
        raise ValueError(f'{path.name} has no {side}; a drawing has both width and height, such as "16mm"')
    try:
        return quantity(PositiveLength)(root.attrib[side])
    except ValueError as error:
        raise ValueError(f"{path.name}: {side}: {error}") from None


class _NoShape(ValueError):
    """A drawing without holes."""


def _svg_shapes(path: Path, extent: Array) -> Any:
    """All filled shapes of a drawing of this extent as one geometry, y and z from its lower left corner [m]."""
    import shapely
    import svgelements

    drawing = svgelements.SVG.parse(str(path))
    scale, filled = extent[0] / drawing.width, []
    for shape in drawing.elements():
        if isinstance(shape, svgelements.Shape) and shape.fill is not None and shape.fill.value is not None:
            rings = [_flattened(part) for part in abs(svgelements.Path(shape)).as_subpaths()]
            filled.append(_in_odd_many([_polygon(ring) for ring in rings if len(ring) > 2]))
    if not filled:
        raise _NoShape(f"{path.name} has no filled shape, but filled shapes are the holes")
    return shapely.transform(shapely.union_all(filled), lambda points: points * (scale, -scale) + (0.0, extent[1]))


def _in_odd_many(polygons: list[Any]) -> Any:
    """What lies in an odd number of polygons. They are joined two by two: one after the other, a drawing of thousands
    would take the square of its time."""
    import shapely

    while len(polygons) > 1:
        pairs = [shapely.symmetric_difference(*pair) for pair in zip(polygons[::2], polygons[1::2], strict=False)]
        polygons = pairs + polygons[2 * len(pairs) :]
    return polygons[0] if polygons else shapely.Polygon()


def _polygon(ring: Array) -> Any:
    """What a ring encloses; one that crosses itself may do so as often as the square of its corners."""
    import shapely

    if not np.isfinite(ring).all():
        raise ValueError("a corner is not a finite number")
    polygon = shapely.Polygon(ring)
    if shapely.is_valid(polygon):
        return polygon
    if len(ring) > _MOST_CROSSING:
        raise ValueError(f"an outline of {len(ring)} corners crosses itself")
    return shapely.make_valid(polygon)


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
