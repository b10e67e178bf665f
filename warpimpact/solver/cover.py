"""The cover of a plate: how much material lies ahead of a point, in every direction in the plane (docs/model.md §4.9).

Rays run from node to node of the grid, so hits a lattice vector apart see the same lengths, and mirrored ones mirrored
lengths.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import NoPattern, Pattern, Plate
from warpimpact.solver.tile import Check, Floats, Real, Tile, cached_tile

Array = NDArray[np.float64]

COARSER = 3
"""Cells of the tile per node of the cover, in each direction: lengths change slowly. Edges are the tile's."""
DIRECTIONS_PER_OCTANT = 4
"""Directions in an eighth of a turn."""
RADII = 12
"""Classes of the core's radius, as the core has pushed no more than what lay within its radius there."""
EDGE_RADII = 4.0
"""Radii of the core up to which edges are searched."""
LENGTH_WITHOUT_EDGE = 1.0e3
"""Length ahead in a plate without holes [m]: nothing is left of an exponential of it."""
PER_LENGTH = 3.5e-7
"""Seconds of a core per node and direction."""


class CoverRule(NamedTuple):
    """What the cover of a pattern depends on: the core's largest radius [m], the share of the material behind a point
    that counts, and the share of a gap behind it that is taken off."""

    radius: float
    carried: float
    gap: float


@dataclass(frozen=True, eq=False)
class Cover(Tile):
    """A table of lengths [m] at the nodes of a period, the first of which is at the origin, in `directions` from z on
    towards y, for each of `radii` classes of the core's radius. `material` has them, of shape [radii, directions + 1,
    nodes along y + 1, nodes along z + 1]: the last ones are the first ones again. A length is negative where its node,
    or one beside it, does not press."""

    directions: int = 8 * DIRECTIONS_PER_OCTANT
    radii: int = RADII

    @property
    def bytes(self) -> int:
        """Memory of the table."""
        return self.size * self.radii * math.prod(count + 1 for count in (*self.shape, self.directions))


def cover_of(plate: Plate, spacing: float, pushed: CoverRule, *, double: bool) -> Cover:
    """The cover of a plate whose tile has cells of at most `spacing` [m]. Nothing is computed yet."""
    pattern, counts, directions = plate.pattern, (1, 1), 8 * DIRECTIONS_PER_OCTANT
    real: Real = np.float64 if double else np.float32
    if not isinstance(pattern, NoPattern):
        rows, columns = (2 * max(1, math.ceil(extent / (2 * COARSER * spacing) - 1e-9)) for extent in pattern.period)
        counts = (rows, columns)
    dy, dz = (extent / count for extent, count in zip(pattern.period, counts, strict=True))
    make = partial(_table, pattern, counts, pushed, directions, real)
    seconds = PER_LENGTH * math.prod(counts) * directions
    cover = Cover(counts, dy, dz, make, seconds, np.dtype(real).itemsize, directions=directions, radii=RADII)
    return cached_tile((pattern, spacing, pushed, real, DIRECTIONS_PER_OCTANT, COARSER, RADII), cover)


def _table(
    pattern: Pattern, counts: tuple[int, int], pushed: CoverRule, directions: int, real: Real, check: Check
) -> Floats:
    if isinstance(pattern, NoPattern):
        return np.full((RADII, directions + 1, 2, 2), LENGTH_WITHOUT_EDGE, dtype=real)
    y, z = (
        np.arange(count, dtype=np.float64) * (extent / count)
        for count, extent in zip(counts, pattern.period, strict=True)
    )
    check()
    inside = pattern.edge_distance(y[:, None], z[None, :])
    table = np.empty((directions, RADII, *counts), dtype=real)
    radii = pushed.radius * (np.arange(RADII) + 0.5)[:, None, None] / RADII
    sides = (pattern.period[0] / counts[0], pattern.period[1] / counts[1])
    parts, half = directions // 8, directions // 2
    rays = list(_rays(parts))
    for k in range(half):
        check()
        ahead, behind = (
            _first_two_edges(inside, ray, parts, sides, EDGE_RADII * pushed.radius) for ray in (rays[k], rays[k + half])
        )
        table[k] = _cover(inside > 0.0, ahead[0], behind, pushed, radii)
        table[k + half] = _cover(inside > 0.0, behind[0], ahead, pushed, radii)
    table = table.swapaxes(0, 1)
    return np.pad(table, ((0, 0), (0, 1), (0, 1), (0, 1)), mode="wrap")


def _rays(parts: int) -> Iterator[tuple[int, int]]:
    """Rows and columns of the grid that each direction goes on by in `parts` parts of a way, from columns on towards
    rows: each part leads to the next row or column."""
    for k in range(8 * parts):
        eighth, part = divmod(k + parts, 2 * parts)
        aside = part - parts
        yield ((aside, parts), (parts, -aside), (-aside, -parts), (-parts, aside))[eighth % 4]


def _first_two_edges(
    inside: Array, ray: tuple[int, int], parts: int, sides: tuple[float, float], far: float
) -> tuple[Array, Array]:
    """Distances along a ray of every node from the first and the second edge [m]; infinite far beyond `far` [m].

    Args:
        inside: distance of the nodes from the nearest edge, negative in a hole; periodic.
        ray: rows and columns from a node to the next one on it, in this number of `parts`.
    """
    part = math.hypot(ray[0] * sides[0], ray[1] * sides[1]) / parts
    places = [_between(inside, ray[0] * k, ray[1] * k, parts) for k in range(parts + 1)]
    first, second = np.full_like(inside, np.inf), np.full_like(inside, np.inf)
    for k, (here, there) in enumerate(pairwise(places)):
        crossed = (here > 0.0) != (there > 0.0)
        share = np.divide(here, here - there, out=np.zeros_like(here), where=crossed)
        edge = np.where(crossed, (k + share) * part, np.inf)
        first, second = _joined(first, second, edge, np.inf)
    nodes, way = 1, parts * part
    while way < far:  # twice as far
        ahead = (-nodes * ray[0], -nodes * ray[1])
        beyond = [way + np.roll(edge, ahead, axis=(0, 1)) for edge in (first, second)]
        first, second = _joined(first, second, *beyond)
        nodes, way = 2 * nodes, 2.0 * way
    return first, second


def _joined(first: Array, second: Array, next_first: Array, next_second: Array | float) -> tuple[Array, Array]:
    """The first two edges of two parts of a ray, one behind the other."""
    following = np.where(np.isfinite(first), next_first, next_second)
    return np.minimum(first, next_first), np.minimum(second, following)


def _between(values: Array, rows: int, columns: int, parts: int) -> Array:
    """Values of a periodic grid some parts of rows and columns on; one of them is whole."""
    (row, adjacent), (column, along) = divmod(rows, parts), divmod(columns, parts)
    here = np.roll(values, (-row, -column), axis=(0, 1))
    if not (adjacent or along):
        return here
    next_one = np.roll(values, (-row - (adjacent > 0), -column - (along > 0)), axis=(0, 1))
    return np.asarray(here + ((adjacent + along) / parts) * (next_one - here))


def _cover(
    solid: NDArray[np.bool_], ahead: Array, behind: tuple[Array, Array], pushed: CoverRule, radii: Array
) -> Array:
    """Lengths of one direction, for the first edge ahead and the first two behind, where the core has each of some
    radii [m], of shape [radii, 1, 1]; negative where they do not count."""
    gap, end = (np.minimum(edge, radii) for edge in behind)
    in_material = np.minimum(ahead, EDGE_RADII * pushed.radius) + pushed.carried * gap
    length = np.where(solid, in_material, np.maximum(pushed.carried * (end - gap) - pushed.gap * gap, 0.0))
    presses = length > 0.0
    everywhere = _around(presses.astype(np.int8)) == 9
    shown, filled = presses, length
    for _ in range(2):  # so that lengths between nodes are those of the material beside them
        count = _around(shown.astype(np.int8))
        mean = _around(filled) / np.maximum(count, 1)
        filled = np.where(shown, filled, mean)
        shown = count > 0
    return np.where(everywhere, filled, -filled)


def _around(values: NDArray[Any]) -> NDArray[Any]:
    """Sums over every node of a period and the eight around it."""
    padded = np.pad(values, ((0, 0), (1, 1), (1, 1)), mode="wrap")
    rows = padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]
    return np.asarray(rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:])
