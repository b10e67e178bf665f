"""Dimensions of a plate as a drawing shows them: the hole in the middle, the unit cell and the smallest ligament."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from warpimpact.scene import NoPattern
from warpimpact.scene.display import MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from warpimpact.scene import Plate

    Array = NDArray[np.float64]

_NEAREST_HOLES = 40
"""Number of holes about the middle among which the smallest ligament is searched."""
_EQUALLY_SMALL = 1.01
"""Largest ratio of a ligament to the smallest one at which both count as equally small, because outlines are polygons.
The written length is the exact one of the plate."""
_BESIDE, _BELOW = 0.1, 0.05
"""Distance of the dimensions of a hole from it, in periods."""
_COLOUR = "#0072B2"
_LIGAMENT_COLOUR = "#CC79A7"


class Dimension(NamedTuple):
    """A length between two points (y, z) [m]. The text of an upright one stands on its right, or on its left."""

    start: Array
    end: Array
    text: str
    on_left: bool = False


def hole_dimensions(plate: Plate, ligament: Dimension | None) -> list[Dimension]:
    """Width and height of the hole that is nearest to the middle, away from the smallest ligament, and the periods of
    the pattern."""
    if isinstance(plate.pattern, NoPattern) or not (holes := _holes(plate)):
        return []
    low_y, low_z, high_y, high_z = holes[0].bounds
    period_y, period_z = plate.pattern.unit_cell
    on_the_right = ligament is not None and ligament.start[0] + ligament.end[0] < 0.0  # where the ligament is not
    beside = high_y + _BESIDE * period_y if on_the_right else low_y - _BESIDE * period_y
    below = low_z - _BELOW * period_z
    return [
        _dimension((low_y, below), (high_y, below)),
        _dimension((beside, low_z), (beside, high_z)),
        _dimension((-period_y / 2, period_z / 2), (period_y / 2, period_z / 2)),
        _dimension((-period_y / 2, -period_z / 2), (-period_y / 2, period_z / 2))._replace(on_left=True),
    ]


def smallest_ligament(plate: Plate) -> Dimension | None:
    """The smallest ligament between two holes that lies nearest to the middle; None if there is none."""
    pairs = list(combinations(_holes(plate), 2))
    if not pairs:
        return None
    lengths = np.array([first.distance(other) for first, other in pairs])
    if not lengths.min() > 0.0:
        return None
    lines = [
        shapely.shortest_line(*pairs[place]) for place in np.flatnonzero(lengths <= _EQUALLY_SMALL * lengths.min())
    ]
    line = min(lines, key=lambda line: line.distance(shapely.Point(0.0, 0.0)))
    start, end = np.asarray(line.coords)
    smallest = plate.ligament
    return _dimension(start, end, smallest if lengths.min() <= _EQUALLY_SMALL * smallest else None)


def draw_dimensions(axes: Axes, plate: Plate) -> None:
    """Draw the dimensions on axes in mm."""
    ligament = smallest_ligament(plate)
    for dimension in hole_dimensions(plate, ligament):
        _draw(axes, dimension, _COLOUR)
    if ligament is not None:
        _draw(axes, ligament, _LIGAMENT_COLOUR)


def _dimension(
    start: tuple[float, float] | Array, end: tuple[float, float] | Array, length: float | None = None
) -> Dimension:
    """A dimension; `length` [m] replaces the distance of its ends if it is known better."""
    start, end = np.asarray(start), np.asarray(end)
    return Dimension(start, end, f"{(float(np.linalg.norm(end - start)) if length is None else length) * MM:.3g}")


def _holes(plate: Plate) -> list[shapely.Polygon]:
    """Holes within the rim, the nearest to the middle first."""
    cell = np.array(plate.pattern.unit_cell)
    reach = 1.5 * cell if plate.size is None else np.minimum(1.5 * cell, 0.5 * np.array(plate.size))
    outlines = plate.pattern.outlines((-reach[0], reach[0]), (-reach[1], reach[1]))
    holes = [shapely.Polygon(outline) for outline in outlines if len(outline) > 3]
    return sorted(holes, key=lambda hole: hole.centroid.distance(shapely.Point(0.0, 0.0)))[:_NEAREST_HOLES]


def _draw(axes: Axes, dimension: Dimension, colour: str) -> None:
    """Draw a line with an arrow at each end, and its length [mm] beside the middle."""
    start, end = dimension.start * MM, dimension.end * MM
    style = {"arrowstyle": "<->", "color": colour, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", tuple(end), tuple(start), arrowprops=style, zorder=5)
    along_z = abs(end[1] - start[1]) > abs(end[0] - start[0])
    middle = 0.5 * (start + end)
    axes.annotate(
        dimension.text,
        tuple(middle),
        ((-4.0, 0.0) if dimension.on_left else (4.0, 0.0)) if along_z else (0.0, 3.0),
        textcoords="offset points",
        ha=("right" if dimension.on_left else "left") if along_z else "center",
        va="center" if along_z else "bottom",
        color=colour,
        fontsize="small",
        zorder=6,
        bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
    )
