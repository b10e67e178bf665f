"""Shares of cells in convex holes that do not overlap, from the chords of lines through the cells."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .pattern import WHOLE_CELL, Check, Counts, rounded

LINES = 3
"""Evenly spaced lines in each direction through the part of a hole in a cell. The share along a line is exact."""
_EDGE = 1e-6
"""Distance from a hole, in sides of a cell, within which a line touches it."""
_LINES_PER_LOT = 2**16
"""Approximate number of lines that are computed together."""

Numbers = NDArray[np.int64]
Chords = Callable[[Numbers, Array, float], tuple[Array, Array]]
"""(number of the hole, z [m], slack [m]) of lines along y → their two ends in the hole [m], NaN if a line misses it.
The ends have the shape of z; its last axis is along the holes."""
_PER_LINE = WHOLE_CELL // (2 * LINES)


def half_shares(
    chords: Chords, extents: Array, counts: tuple[int, int], sides: tuple[float, float], check: Check
) -> Counts:
    """Half the shares of cells in holes, from lines along y, in parts of WHOLE_CELL, shape `counts`.

    The other half comes from lines along z, so that a plate turned by a right angle has the same shares. Straight sides
    of a hole are exact anywhere in a cell: sides along z end lines, and sides along y end the strip of the lines.

    Args:
        extents: lowest and highest z of every hole, shape [holes, 2] [m].
        counts, sides, check: as in `Pattern.shares_in_holes`.
    """
    inside = np.zeros((counts[0] + 2, counts[1]), dtype=np.int16)
    ends = extents / sides[1]
    columns = np.clip(np.stack([np.floor(ends[:, 0]), np.ceil(ends[:, 1])], axis=1), 0, counts[1]).astype(np.int64)
    for holes in _lots(LINES * (columns[:, 1] - columns[:, 0])):
        check()
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
        check()
        row += before
    return inside[: counts[0]]


def _lots(lines: Numbers) -> list[Numbers]:
    """Numbers of the holes in lots of about _LINES_PER_LOT lines; `lines` is the number of lines of each hole."""
    lot = np.cumsum(lines) // _LINES_PER_LOT
    return np.split(np.arange(len(lines)), np.flatnonzero(np.diff(lot)) + 1)


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
