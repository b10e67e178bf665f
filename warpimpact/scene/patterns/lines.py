"""Points in convex holes that do not overlap, line by line: a line of points lies in a hole from one end to another."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model import Array
from .pattern import Counts

ON_EDGE = 1e-6
"""A point that is no more of the side of a cell outside a hole lies in it: symmetric holes have symmetric tiles."""
_LINES = 2**16
"""Lines that are looked at together, about."""

Numbers = NDArray[np.int64]
Chords = Callable[[Numbers, Array, float], tuple[Array, Array]]
"""(number of the hole, z [m], slack [m]) of lines along y → their ends in the hole [m]; NaN where a line misses it."""


def points_in(
    chords: Chords, extents: Array, counts: tuple[int, int], sides: tuple[float, float], samples: int
) -> Counts:
    """How many of samples × samples points, evenly in each cell, lie in holes; shape `counts`.

    Args:
        extents: lowest and highest z of every hole, shape [holes, 2] [m].
        counts, sides: of the cells along y and z, from the origin on; of a cell [m].
    """
    fine, slack = np.array(sides) / samples, ON_EDGE * min(sides)
    ends = np.clip(extents / fine[1] + (-1.5, 1.5), 0, samples * counts[1]).astype(np.int64)
    inside = np.zeros((counts[0] + 2, counts[1]), dtype=np.int16)
    for some in _in_lots(ends[:, 1] - ends[:, 0]):
        lines = ends[some, 1] - ends[some, 0]
        line = np.arange(lines.sum()) + np.repeat(ends[some, 1] - np.cumsum(lines), lines)
        low, high = chords(np.repeat(some, lines), (line + 0.5) * fine[1], slack)
        first, behind = np.ceil((low - slack) / fine[0] - 0.5), np.floor((high + slack) / fine[0] + 0.5)
        met = first < behind
        for end, sign in ((first, 1), (behind, -1)):
            at = np.clip(end[met], 0, samples * counts[0]).astype(np.int64)
            _add(inside, at, line[met] // samples, samples, sign)
    for before, row in pairwise(inside):  # half the time of numpy.cumsum along the first axis
        row += before
    return inside[: counts[0]]


def _in_lots(lines: Numbers) -> list[Numbers]:
    """Numbers of the holes with so many lines each, in lots of some _LINES lines."""
    lot = np.cumsum(lines) // _LINES
    return np.split(np.arange(len(lines)), np.flatnonzero(np.diff(lot)) + 1)


def _add(inside: Counts, at: Numbers, column: Numbers, samples: int, sign: int) -> None:
    """Add lines of points, from point `at` on, to the differences between cells along y."""
    cell, before = np.divmod(at, samples)
    for row, points in ((cell, samples - before), (cell + 1, before)):
        np.add.at(inside.reshape(-1), row * inside.shape[1] + column, (sign * points).astype(np.int16))
