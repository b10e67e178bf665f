"""Geometry of holes on a plane: distances, and shares of cells that lie in them.

A hole has all points within the distance `rounding` of a spine: a polygon, a line or a point [m].
"""

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .model import Array

BoolArray = NDArray[np.bool_]
Counts = NDArray[np.int16]
Range = tuple[float, float]

WHOLE_CELL = 24576
"""Parts of a cell that count its share in holes as an integer; a cell inside a hole has exactly all."""
LINES = 3
"""Evenly spaced lines in each direction through the part of a hole in a cell. The share along a line is exact."""
_PER_LINE = WHOLE_CELL // (2 * LINES)
_PARTS_PER_LOT = 2**17
"""Approximate number of parts of sides, one per column of cells, that are computed together."""


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


def folded_points(y: Array, z: Array, period: Range) -> Any:
    """Points y, z [m] moved by whole periods into that around the origin, as geometries of their broadcast shape."""
    folded = (at - side * np.round(at / side) for at, side in zip((y, z), period, strict=True))
    return np.asarray(shapely.points(*np.broadcast_arrays(*folded)))  # one point is no array


def distance_to(geometries: Any, points: Any) -> Array:
    """Distance of `folded_points` from the nearest geometry [m], in their shape; inf if there is none.

    The geometries are those about one period, around the origin, of all that repeat with it.
    """
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


def shares_in(rings: list[Array], counts: tuple[int, int], sides: tuple[float, float]) -> Counts:
    """Share of every cell that lies in polygons, in parts of WHOLE_CELL, shape `counts`.

    Half of it comes from lines along y and half from lines along z, so that a plate turned by a right angle has the
    same shares. Sides along y or z are exact anywhere in a cell: they end lines, or the strip of the lines.

    Args:
        rings: closed outlines, anticlockwise and apart from each other, shape [points, 2] [m] each.
        counts, sides: number and size [m] of the cells along y and z, from the origin on.
    """
    along_y = _half_shares(rings, counts, sides)
    along_z = _half_shares([ring[::-1, ::-1] for ring in rings], counts[::-1], sides[::-1])
    return along_y + along_z.T


def _half_shares(rings: list[Array], counts: tuple[int, int], sides: tuple[float, float]) -> Counts:
    """Half the shares of cells in polygons, from lines along y."""
    inside = np.zeros((counts[0] + 2, counts[1]), dtype=np.int16)
    if not rings:
        return inside[: counts[0]]
    extents = np.array([(ring[:, 1].min(), ring[:, 1].max()) for ring in rings])
    start, end = (np.concatenate(parts) for parts in ([r[:-1] for r in rings], [r[1:] for r in rings]))
    (bottom, top), of = extents.T / sides[1], np.repeat(np.arange(len(rings)), [len(ring) - 1 for ring in rings])
    low, high = np.minimum(start[:, 1], end[:, 1]) / sides[1], np.maximum(start[:, 1], end[:, 1]) / sides[1]
    first, last = (np.clip(edge, 0, counts[1]).astype(np.int64) for edge in (np.floor(low), np.ceil(high)))
    for lot in np.array_split(np.arange(len(of)), 1 + (last - first).sum() // _PARTS_PER_LOT):
        columns = last[lot] - first[lot]
        side = np.repeat(lot, columns)
        column = np.arange(columns.sum()) + np.repeat(last[lot] - np.cumsum(columns), columns)
        from_z = np.maximum(column, bottom[of[side]])
        strip = np.minimum(column + 1, top[of[side]]) - from_z
        z = from_z + (np.arange(LINES)[:, None] + 0.5) / LINES * strip
        line, part = np.nonzero((z >= low[side]) & (z < high[side]))
        side, column, weight = side[part], column[part], _rounded(strip[part], _PER_LINE)
        (from_y, from_z), (to_y, to_z) = start[side].T, end[side].T
        at = from_y + (z[line, part] * sides[1] - from_z) * ((to_y - from_y) / (to_z - from_z))
        at = np.clip(at / sides[0], 0, counts[0])
        for sign, which in ((1, to_z < from_z), (-1, to_z > from_z)):  # going down, the hole follows along y
            _add(inside, at[which], column[which], weight[which], sign)
    return np.cumsum(inside, axis=0, dtype=np.int16)[: counts[0]]


def _add(inside: Counts, at: Array, column: NDArray[np.int64], weight: Counts, sign: int) -> None:
    """Add signed lines, from their ends `at` on [cells], to the differences between cells along y.

    At both ends the part of the cell that lies in the hole is rounded, so mirrored holes have mirrored shares.
    """
    cell = np.floor(at)
    part = at - cell if sign < 0 else 1.0 - (at - cell)
    inside_cell = _rounded(part, weight)
    first = inside_cell if sign > 0 else weight - inside_cell
    for row, share in ((cell, first), (cell + 1, weight - first)):
        np.add.at(inside.reshape(-1), row.astype(np.int64) * inside.shape[1] + column, sign * share)


def _rounded(share: Array, whole: Any) -> Counts:
    """Shares of `whole` as integers. A half is rounded up, even after a rounding error, so that mirrored holes have
    mirrored shares."""
    return np.asarray(np.floor(share * whole + (0.5 + 1e-6)), dtype=np.int16)
