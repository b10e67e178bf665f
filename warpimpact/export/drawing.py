"""The holes of a plate as a drawing for whoever cuts it: SVG and DXF, in mm, y to the right and z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpimpact.results.files import OutputError, aside
from warpimpact.scene import Plate
from warpimpact.scene.display import MM

SUFFIXES = (".svg", ".dxf")
_CORNERS = 12
"""Most points of an outline that may be a regular polygon."""
_ROUNDNESS = 1e-6
"""Largest spread of the distances from the middle of a round hole, as a share of its radius."""


def write_drawing(plate: Plate, output: Path) -> None:
    """Write the holes of a plate, or of one period of an unbounded one, with the rim of that.

    In an SVG drawing filled shapes are holes. A DXF drawing has closed polylines in the layers HOLES and RIM, and a
    circle for each round hole.

    Raises:
        OutputError: the plate has no holes, or ezdxf is not installed.
    """
    half = 0.5 * np.array(plate.size or plate.pattern.period)
    outlines = plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    if not outlines:
        raise OutputError(f"{output}: the plate has no holes to draw")
    holes = [MM * outline for outline in outlines]
    with aside(output) as file:
        (_write_svg if output.suffix.lower() == ".svg" else _write_dxf)(holes, MM * half, file)


def _write_svg(holes: list[NDArray[np.float64]], half: NDArray[np.float64], file: Path) -> None:
    y, z = 2.0 * half
    paths = "".join("M" + "L".join(f"{a:.4f},{-b:.4f}" for a, b in hole) + "Z" for hole in holes)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{y:.6g}mm" height="{z:.6g}mm" '
        f'viewBox="{-half[0]:.6g} {-half[1]:.6g} {y:.6g} {z:.6g}">'
    )
    file.write_text(f'{head}\n<path fill="black" d="{paths}"/>\n</svg>\n', encoding="utf-8")


def _write_dxf(holes: list[NDArray[np.float64]], half: NDArray[np.float64], file: Path) -> None:
    try:
        from ezdxf.document import Drawing
    except ImportError:
        raise OutputError("DXF needs ezdxf: pip install 'warpimpact[cad]'") from None
    drawing = Drawing.new("R2000")
    drawing.units = 4  # mm
    space = drawing.modelspace()
    for layer, outlines in (("HOLES", holes), ("RIM", [half * [(-1, -1), (1, -1), (1, 1), (-1, 1)]])):
        drawing.layers.add(layer)
        for outline in outlines:
            if circle := _circle(outline):
                space.add_circle(*circle, dxfattribs={"layer": layer})
                continue
            space.add_lwpolyline([tuple(point) for point in outline], close=True, dxfattribs={"layer": layer})
    drawing.saveas(file)


def _circle(outline: NDArray[np.float64]) -> tuple[tuple[float, float], float] | None:
    """Centre and radius [mm] of an outline that is a round hole; None for any other outline."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    centre = 0.5 * (low + high)
    distances = np.linalg.norm(outline - centre, axis=1)
    radius = float(distances.max())
    is_round = len(outline) > _CORNERS and np.ptp(distances) < _ROUNDNESS * radius
    return ((float(centre[0]), float(centre[1])), radius) if is_round else None
