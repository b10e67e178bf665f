"""Geometry of rounded convex shapes. A shape has all points within the distance `rounding` of a spine, which is a
convex polygon, a line or a point. Areas, distances and extents are exact. Spines are arrays of shape [corners, 2] [m].
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..model import Array

_PIECE = 16
"""Chords per piece of an outline."""
_QUARTER = 16
"""Chords per quarter of a turn in an outline; a circle loses 1.6e-3 of its area."""


def area(spine: Array, rounding: float) -> float:
    """Area of the shape [m²] (Steiner's formula)."""
    import shapely

    shape = geometries(spine[None])[0]
    perimeter = shape.length * (2.0 if len(spine) == 2 else 1.0)  # a line counts on both sides
    return float(shapely.area(shape) + rounding * perimeter + np.pi * rounding**2)


def distance(spine: Array, y: Array, z: Array) -> Array:
    """Distance of points y, z from the spine [m], of their broadcast shape; negative within a polygon.

    Mirrored points have the same distance from a mirrored spine, to the bit.
    """
    ends = list(zip(spine, np.roll(spine, -1, axis=0), strict=True))
    nearest, within = np.array(np.inf), np.array(True)
    for start, end in ends[: 1 if len(ends) < 3 else None]:
        half = 0.5 * float(np.hypot(*(end - start)))
        along_y, along_z = (end - start) / (2.0 * half) if half > 0.0 else np.zeros(2)
        from_y, from_z = y - 0.5 * (start[0] + end[0]), z - 0.5 * (start[1] + end[1])
        along = np.clip(from_y * along_y + from_z * along_z, -half, half)
        to_edge = np.hypot(from_y - along * along_y, from_z - along * along_z)
        if len(spine) < 3:
            return np.asarray(to_edge)
        nearest = np.minimum(nearest, to_edge)
        within = within & (from_z * along_y - from_y * along_z > 0.0)
    return np.where(within, -nearest, nearest)


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


def outline(spine: Array, rounding: float) -> Array:
    """Closed outline of the shape, shape [points, 2] [m]; chords between points on the exact outline."""
    import shapely

    shape = geometries(spine[None])[0]
    return np.array(shapely.get_coordinates(shapely.buffer(shape, rounding, quad_segs=_QUARTER) if rounding else shape))


def distance_to(geometries: Any, y: Array, z: Array) -> Array:
    """Distance of points y, z from the nearest geometry [m], in their broadcast shape; inf if there is none."""
    import shapely

    points: Any = shapely.points(*np.broadcast_arrays(y, z))
    if not len(geometries):
        return np.full(points.shape, np.inf)
    tree = shapely.STRtree(geometries, node_capacity=2)  # 1.5 us per point; 6 us with the default
    _, distances = tree.query_nearest(points.ravel(), all_matches=False, return_distance=True)
    return distances.reshape(points.shape)


def neighbours(geometries: Any, first: int) -> tuple[float, int, int]:
    """Smallest distance [m] of one of the `first` geometries from another one, and the indices of both.

    The distance is 0 if they overlap, and inf if there are fewer than two geometries.
    """
    import shapely

    if len(geometries) < 2:
        return np.inf, 0, 0
    tree = shapely.STRtree(geometries)
    pairs = tree.query(geometries[:first], predicate="intersects")
    if (crossing := np.flatnonzero(pairs[0] != pairs[1])).size:
        return 0.0, int(pairs[0, crossing[0]]), int(pairs[1, crossing[0]])
    pairs, gaps = tree.query_nearest(geometries[:first], exclusive=True, return_distance=True)
    least = gaps.argmin()
    return float(gaps[least]), int(pairs[0, least]), int(pairs[1, least])


def smallest_gap(shapes: Sequence[Sequence[Array]]) -> float:
    """Smallest distance [m] between two shapes that do not overlap; inf if there are fewer than two. A shape is its
    closed outlines, each of shape [points, 2] [m].

    A tree finds the nearest of short pieces of the outlines. The numbers of two shapes differ in a binary digit; so for
    every digit, the pieces of the shapes with 1 are compared with the pieces of the shapes with 0.
    """
    import shapely

    lines = pieces([ring for rings in shapes for ring in rings])
    counts = [sum(math.ceil((len(ring) - 1) / _PIECE) for ring in rings) for rings in shapes]
    owner, least = np.repeat(np.arange(len(shapes)), counts), np.inf
    for digit in range((len(shapes) - 1).bit_length() if shapes else 0):
        is_one = (owner >> digit & 1).astype(bool)
        limit = least if np.isfinite(least) and least > 0.0 else None
        gaps = shapely.STRtree(lines[~is_one]).query_nearest(
            lines[is_one], max_distance=limit, return_distance=True, all_matches=False
        )[1]
        least = min(least, float(gaps.min(initial=np.inf)))
    return least


def pieces(rings: Sequence[Array]) -> Any:
    """Short pieces of closed outlines, each of shape [points, 2] [m], as an array of shapely geometries."""
    import shapely

    parts = [ring[at : at + _PIECE + 1] for ring in rings for at in range(0, len(ring) - 1, _PIECE)]
    numbers = np.repeat(np.arange(len(parts)), list(map(len, parts)))
    return shapely.linestrings(np.concatenate([*parts, np.empty((0, 2))]), indices=numbers)


def geometries(spines: Array) -> Any:
    """Spines of shape [spines, corners, 2] [m] as an array of shapely geometries, shape [spines]."""
    import shapely

    corners = spines.shape[1]
    make = shapely.points if corners == 1 else shapely.linestrings if corners == 2 else shapely.polygons
    return make(spines[:, 0] if corners == 1 else spines)
