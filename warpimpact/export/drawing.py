"""The holes of a plate as a drawing for whoever cuts it: SVG and DXF, in mm, y to the right and z up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from warpimpact.errors import OutputError
from warpimpact.results.files import atomic_path
from warpimpact.scene import Plate
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM, count_text

SUFFIXES = (".svg", ".dxf")
_SAME_PLACE = 1e-6
"""Largest distance of two holes that are one hole of the period, in periods."""


def write_drawing(plate: Plate, output: Path) -> list[str]:
    """Write the holes of a plate, or each hole of one period of an unbounded plate once.

    In an SVG drawing filled shapes are holes. A DXF drawing has them in the layer HOLES, as circles and as closed
    polylines with arcs, and the rim of the plate in the layer RIM, or the period in the layer PERIOD.

    Returns:
        What to know before cutting, a sentence each.

    Raises:
        OutputError: the plate has no holes, or ezdxf is not installed.
    """
    sides, pattern = np.array(plate.size or plate.pattern.period), plate.pattern
    spines = pattern.spines(*((-side / 2, side / 2) for side in sides))
    if not len(spines):
        raise OutputError(f"{output}: the plate has no holes to draw")
    spines = _once(spines, sides) if plate.size is None else spines
    low, high = np.split(shapely.bounds(spines), 2, axis=1) + np.array([[[-1.0]], [[1.0]]]) * pattern.rounding
    count = count_text(len(spines), "hole")
    if plate.size is None:
        steps = " mm and ".join(f"{side * MM:g}" for side in sides)
        notes = [f"The drawing has one period: {count}, to be repeated every {steps} mm."]
    else:
        cut = int((np.maximum(high, -low) > sides / 2 * (1.0 + _SAME_PLACE)).any(axis=1).sum())
        notes = [f"The rim cuts {cut} of {count}. List whole holes in a cell of this size."] if cut else []
    holes = [_vertices(shapely.get_coordinates(spine) * MM, pattern.rounding * MM) for spine in spines]
    with atomic_path(output) as file:
        if output.suffix.lower() == ".svg":
            box = np.minimum(low.min(axis=0), -sides / 2) * MM, np.maximum(high.max(axis=0), sides / 2) * MM
            _write_svg(holes, pattern.rounding * MM, *box, file)
        else:
            _write_dxf(holes, "PERIOD" if plate.size is None else "RIM", sides * MM / 2, file)
    return notes


def _once(spines: Any, period: Array) -> Any:
    """One spine of those that repeat with the period, each time the one nearest to the origin."""
    middles = shapely.get_coordinates(shapely.centroid(spines))
    order = np.argsort(np.linalg.norm(middles, axis=1), kind="stable")
    places = np.round(middles[order] / period / _SAME_PLACE).astype(int) % round(1.0 / _SAME_PLACE)
    return spines[order][np.unique(places, axis=0, return_index=True)[1]]


def _vertices(corners: Array, rounding: float) -> Array:
    """Outline of a hole, anticlockwise, shape [vertices, 3]: place, and bulge of the part that follows.

    The bulge is the tangent of a quarter of the angle of an arc, 0 for a straight part.

    Args:
        corners: of the spine, a closed polygon, a line or a point, shape [corners, 2].
        rounding: distance of the outline from the spine.
    """
    if len(corners) == 1:
        return np.array([[*(corners[0] - [rounding, 0.0]), 1.0], [*(corners[0] + [rounding, 0.0]), 1.0]])
    if len(corners) > 2:
        corners = shapely.get_coordinates(shapely.orient_polygons(shapely.Polygon(corners)))[:-1]
    following = np.roll(corners, -1, axis=0)
    along = (following - corners) / np.linalg.norm(following - corners, axis=1, keepdims=True)
    outwards = rounding * np.stack([along[:, 1], -along[:, 0]], axis=1)
    heading = np.arctan2(along[:, 1], along[:, 0])
    turn = (np.roll(heading, -1) - heading) % (2.0 * np.pi)
    starts = np.column_stack([corners + outwards, np.zeros(len(corners))])
    ends = np.column_stack([following + outwards, np.tan(turn / 4.0)])
    return np.stack([starts, ends], axis=1).reshape(-1, 3) if rounding else starts


def _write_svg(holes: list[Array], rounding: float, low: Array, high: Array, file: Path) -> None:
    (left, _), (_, up), (width, height) = low, high, high - low
    paths, arc = "", f"A{rounding:.6g},{rounding:.6g} 0 0 0 "
    for hole in holes:
        places = [f"{y:.4f},{-z:.4f}" for y, z, _ in [*hole, hole[0]]]
        parts = (f"{arc if bulge else 'L'}{to}" for bulge, to in zip(hole[:, 2], places[1:], strict=True))
        paths += f"M{places[0]}{''.join(parts)}Z"
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.6g}mm" height="{height:.6g}mm" '
        f'viewBox="{left:.6g} {-up:.6g} {width:.6g} {height:.6g}">'
    )
    file.write_text(f'{head}\n<path fill="black" d="{paths}"/>\n</svg>\n', encoding="utf-8")


def _write_dxf(holes: list[Array], frame: str, half: Array, file: Path) -> None:
    try:
        from ezdxf.document import Drawing
    except ImportError:
        raise OutputError("DXF needs ezdxf: pip install 'warpimpact[cad]'") from None
    drawing = Drawing.new("R2000")
    drawing.units = 4  # mm
    space = drawing.modelspace()
    corners = half * [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    for layer, outlines in (("HOLES", holes), (frame, [np.column_stack([corners, np.zeros(4)])])):
        drawing.layers.add(layer)
        for outline in outlines:
            if len(outline) == 2:
                (y, z, _), (end, _, _) = outline
                space.add_circle((0.5 * (y + end), z), 0.5 * (end - y), dxfattribs={"layer": layer})
            else:
                points = [tuple(vertex) for vertex in outline.tolist()]
                space.add_lwpolyline(points, format="xyb", close=True, dxfattribs={"layer": layer})
    drawing.saveas(file)
