"""Geometry of rounded convex shapes, and shares of cells that lie in them.

A shape has all points within the distance `rounding` of a spine, which is a convex polygon, a line or a point. Areas,
distances and extents are exact. Spines are arrays of shape [corners, 2] [m].
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..model import Array

BoolArray = NDArray[np.bool_]
Counts = NDArray[np.int16]
Numbers = NDArray[np.int64]
Range = tuple[float, float]
Chords = Callable[[Numbers, Array, float], tuple[Array, Array]]
"""(number of the hole, z [m], slack [m]) of lines along y → their two ends in the hole [m], NaN if a line misses it.
The ends have the shape of z; its last axis is along the holes."""

WHOLE_CELL = 24576
"""Parts of a cell that count its share in holes as an integer; a cell inside a hole has exactly all."""
LINES = 3
"""Evenly spaced lines in each direction through the part of a hole in a cell. The share along a line is exact."""
_PER_LINE = WHOLE_CELL // (2 * LINES)
_EDGE = 1e-6
"""Distance from a hole, in sides of a cell, within which a line touches it."""
_LINES_PER_LOT = 2**16
"""Approximate number of lines that are computed together."""


def area(spine: Array, rounding: float) -> float:
    """Area of the shape [m²] (Steiner's formula)."""
    shape = geometries(spine[None])[0]
    perimeter = shape.length * (2.0 if len(spine) == 2 else 1.0)  # a line counts on both sides
    return float(shapely.area(shape) + rounding * perimeter + np.pi * rounding**2)


def chords(spines: Array, rounding: float, which: Any, z: Array, slack: float) -> tuple[Array, Array]:
    """Both ends along y [m] of lines at z [m] in shapes, with the shape of z; NaN if a line misses its shape by more
    than `slack` [m].

    An end lies on the arc about a corner or on a straight part of the outline. Both kinds of points are in the convex
    shape, so the outermost one is the end.

    Args:
        spines: of the shapes, shape [shapes, corners, 2] [m].
        which: index of the shape that each line may cross, along the last axis of z.
    """
    low, high = np.full(z.shape, np.nan), np.full(z.shape, np.nan)
    corners = np.moveaxis(spines, 1, 0)
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        from_y, from_z = corner.T
        left = rounding**2 - np.square(z - from_z[which])
        half = np.sqrt(np.maximum(left, 0.0))
        half[left < -slack * (slack + 2.0 * rounding)] = np.nan
        low, high = np.fmin(low, from_y[which] - half), np.fmax(high, from_y[which] + half)
        if spines.shape[1] == 1:
            break
        along_y, along_z = (following - corner).T
        with np.errstate(divide="ignore", invalid="ignore"):  # a part along y has its ends on the arcs
            outwards = rounding / np.hypot(along_y, along_z)
            above = z - (from_z - outwards * along_y)[which]
            part = above * (1.0 / along_z)[which]
            end = (from_y + outwards * along_z)[which] + above * (along_y / along_z)[which]
        end[~((part >= 0.0) & (part <= 1.0))] = np.nan
        low, high = np.fmin(low, end), np.fmax(high, end)
    return low, high


def placed(spine: Array, places: Array) -> Array:
    """The spine turned by and moved to every place (y, z, turn) [m, rad]; shape [places, corners, 2]."""
    cosine, sine = np.cos(places[:, 2:]), np.sin(places[:, 2:])
    y, z = spine.T
    return np.stack([cosine * y - sine * z + places[:, :1], sine * y + cosine * z + places[:, 1:2]], axis=-1)


def shifts_into(low: Array, high: Array, period: Range, y_range: Range, z_range: Range) -> Array:
    """Whole periods by which a box from `low` to `high` reaches into a rectangle, shape [shifts, 2] [m]."""
    along_y, along_z = (
        np.arange(math.ceil((ends[0] - high[axis]) / step), math.floor((ends[1] - low[axis]) / step) + 1) * step
        for axis, (ends, step) in enumerate(zip((y_range, z_range), period, strict=True))
    )
    return np.stack(np.meshgrid(along_y, along_z, indexing="ij"), axis=-1).reshape(-1, 2)


def distance_to(geometries: Any, y: Array, z: Array, period: Range) -> Array:
    """Distance of points y, z from the nearest geometry [m], in their broadcast shape; inf if there is none.

    The geometries are those about one period, around the origin, of all that repeat with it.
    """
    folded = (at - side * np.round(at / side) for at, side in zip((y, z), period, strict=True))
    points: Any = np.asarray(shapely.points(*np.broadcast_arrays(*folded)))  # one point is no array
    if not len(geometries):
        return np.full(points.shape, np.inf)
    tree = shapely.STRtree(geometries, node_capacity=2)  # 1.5 us per point; 6 us with the default
    _, distances = tree.query_nearest(points.ravel(), all_matches=False, return_distance=True)
    return distances.reshape(points.shape)


def neighbours(geometries: Any, first: int) -> tuple[float, int, int]:
    """Smallest distance [m] of one of the `first` geometries from another one, and the indices of both.

    The distance is 0 if they overlap, and inf if there are fewer than two geometries.
    """
    if len(geometries) < 2:
        return np.inf, 0, 0
    tree = shapely.STRtree(geometries)
    pairs = tree.query(geometries[:first], predicate="intersects")
    if (crossing := np.flatnonzero(pairs[0] != pairs[1])).size:
        return 0.0, int(pairs[0, crossing[0]]), int(pairs[1, crossing[0]])
    pairs, gaps = tree.query_nearest(geometries[:first], exclusive=True, return_distance=True)
    least = gaps.argmin()
    return float(gaps[least]), int(pairs[0, least]), int(pairs[1, least])


def geometries(spines: Array) -> Any:
    """Spines of shape [spines, corners, 2] [m] as an array of shapely geometries, shape [spines]."""
    corners = spines.shape[1]
    make = shapely.points if corners == 1 else shapely.linestrings if corners == 2 else shapely.polygons
    return make(spines[:, 0] if corners == 1 else spines)


def rounded(share: Array, whole: Any) -> Counts:
    """Shares of `whole` as integers. A half is rounded up, even after a rounding error, so that mirrored holes have
    mirrored shares."""
    return np.asarray(np.floor(share * whole + (0.5 + 1e-6)), dtype=np.int16)


def half_shares(chords: Chords, extents: Array, counts: tuple[int, int], sides: tuple[float, float]) -> Counts:
    """Half the shares of cells in holes, from lines along y, in parts of WHOLE_CELL, shape `counts`.

    The other half comes from lines along z, so that a plate turned by a right angle has the same shares. Straight sides
    of a hole are exact anywhere in a cell: sides along z end lines, and sides along y end the strip of the lines.

    Args:
        extents: lowest and highest z of every hole, shape [holes, 2] [m].
        counts, sides: as in `Pattern.shares_in_holes`.
    """
    inside = np.zeros((counts[0] + 2, counts[1]), dtype=np.int16)
    ends = extents / sides[1]
    columns = np.clip(np.stack([np.floor(ends[:, 0]), np.ceil(ends[:, 1])], axis=1), 0, counts[1]).astype(np.int64)
    lot = np.cumsum(LINES * (columns[:, 1] - columns[:, 0])) // _LINES_PER_LOT
    for holes in np.split(np.arange(len(columns)), np.flatnonzero(np.diff(lot)) + 1):
        met_columns = columns[holes, 1] - columns[holes, 0]
        hole = np.repeat(holes, met_columns)
        column = np.arange(met_columns.sum()) + np.repeat(columns[holes, 1] - np.cumsum(met_columns), met_columns)
        from_z = np.maximum(column, ends[hole, 0])
        strip = np.minimum(column + 1, ends[hole, 1]) - from_z
        z = from_z + (np.arange(LINES)[:, None] + 0.5) / LINES * strip
        low, high = chords(hole, z * sides[1], _EDGE * min(sides))
        met = low < high
        column, weight = (np.broadcast_to(values, met.shape)[met] for values in (column, rounded(strip, _PER_LINE)))
        for end, sign in ((low, 1), (high, -1)):
            _add(inside, np.clip(end[met] / sides[0], 0, counts[0]), column, weight, sign)
    for before, row in pairwise(inside):  # half the time of numpy.cumsum along the first axis
        row += before
    return inside[: counts[0]]


def _add(inside: Counts, at: Array, column: Numbers, weight: Counts, sign: int) -> None:
    """Add signed lines, from their ends `at` on [cells], to the differences between cells along y.

    At both ends the part of the cell that lies in the hole is rounded, so mirrored holes have mirrored shares.
    """
    cell = np.floor(at)
    part = at - cell if sign < 0 else 1.0 - (at - cell)
    inside_cell = rounded(part, weight)
    first = inside_cell if sign > 0 else weight - inside_cell
    for row, share in ((cell, first), (cell + 1, weight - first)):
        np.add.at(inside.reshape(-1), row.astype(np.int64) * inside.shape[1] + column, sign * share)
