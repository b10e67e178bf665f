"""Shares of cells in convex holes that do not overlap, line by line: a line lies in a hole from one end to another."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .pattern import WHOLE_CELL, Check, Counts, rounded

LINES = 3
"""In each direction through what a cell has of a hole, evenly. Along a line its share is exact."""
_EDGE = 1e-6
"""A line that is no more of the side of a cell outside a hole touches it."""
_AT_ONCE = 2**16
"""Lines that are looked at together, about."""

Numbers = NDArray[np.int64]
Chords = Callable[[Numbers, Array, float], tuple[Array, Array]]
"""(number of the hole, z [m], slack [m]) of lines along y → their ends in the hole [m]; NaN where a line misses it. The
ends are of the shape of z, whose last axis is that of the holes."""
_PER_LINE = WHOLE_CELL // (2 * LINES)


def half_shares(
    chords: Chords, extents: Array, counts: tuple[int, int], sides: tuple[float, float], check: Check
) -> Counts:
    """Half the shares of cells that lie in holes, by lines along y, in parts of WHOLE_CELL, shape `counts`. The other
    half has lines along z, so that a plate that is turned by a right angle has the same shares.

    The sides of a hole along z end lines, and those along y end the strip of a column of cells through which lines go.
    So both are exact, wherever they lie in a cell.

    Args:
        extents: lowest and highest z of every hole, shape [holes, 2] [m].
        counts, sides: of the cells along y and z, from the origin on; of a cell [m].
        check: as in `Pattern.shares_in_holes`.
    """
    inside = np.zeros((counts[0] + 2, counts[1]), dtype=np.int16)
    ends = extents / sides[1]
    columns = np.clip(np.stack([np.floor(ends[:, 0]), np.ceil(ends[:, 1])], axis=1), 0, counts[1]).astype(np.int64)
    for some in _in_lots(LINES * (columns[:, 1] - columns[:, 0])):
        check()
        each = columns[some, 1] - columns[some, 0]
        hole = np.repeat(some, each)
        column = np.arange(each.sum()) + np.repeat(columns[some, 1] - np.cumsum(each), each)
        from_z = np.maximum(column, ends[hole, 0])
        strip = np.minimum(column + 1, ends[hole, 1]) - from_z
        z = from_z + (np.arange(LINES)[:, None] + 0.5) / LINES * strip
        low, high = chords(hole, z * sides[1], _EDGE * min(sides))
        met = low < high
        column, weight = (np.broadcast_to(own, met.shape)[met] for own in (column, rounded(strip, _PER_LINE)))
        for end, sign in ((low, 1), (high, -1)):
            _add(inside, np.clip(end[met] / sides[0], 0, counts[0]), column, weight, sign)
    for before, row in pairwise(inside):  # half the time of numpy.cumsum along the first axis
        check()
        row += before
    return inside[: counts[0]]


def _in_lots(lines: Numbers) -> list[Numbers]:
    """Numbers of the holes with so many lines each, in lots of some _AT_ONCE lines."""
    lot = np.cumsum(lines) // _AT_ONCE
    return np.split(np.arange(len(lines)), np.flatnonzero(np.diff(lot)) + 1)


def _add(inside: Counts, at: Array, column: Numbers, weight: Counts, sign: int) -> None:
    """Add lines with a sign, from their ends `at` on [cells], to the differences between cells along y.

    Mirrored holes have mirrored shares: of the cell of either end, what lies in the hole is rounded.
    """
    cell = np.floor(at)
    part = at - cell if sign < 0 else 1.0 - (at - cell)
    own = rounded(part, weight)
    own = own if sign > 0 else weight - own
    for row, share in ((cell, own), (cell + 1, weight - own)):
        np.add.at(inside.reshape(-1), row.astype(np.int64) * inside.shape[1] + column, sign * share)
