"""Bursts on a device: the scratch of earlier hits, and the order in which the shots at one plate are computed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels.status import Status

Numbers = NDArray[np.int64]


def earlier_hits(stage: Any, count: int, slots: int, nodes: list[int], device: Any) -> Any:
    """Scratch of earlier hits (kernels/earlier.py).

    Args:
        stage: the build of the march.
        count: shots at a plate; 1 needs no scratch.
        nodes: of a slot in the windows of all layers.
    """
    earlier = stage.Earlier()
    if count > 1:
        earlier.count, earlier.nodes, earlier.layers = count, sum(nodes), len(nodes)
        places = slots * count * len(nodes)
        sizes = {"exposure": slots * count * sum(nodes)} | dict.fromkeys(("y", "z", "open"), places)
        for name, size in sizes.items():
            kind = stage.Earlier.vars[name].type.dtype
            setattr(earlier, name, wp.empty(size, dtype=kind, device=device))
    return earlier


def bytes_of(count: int, nodes: int, layers: int, size: int) -> int:
    """Scratch of a slot for the earlier hits [bytes], if a number has this size."""
    return count * (nodes * size + 17 * layers) if count > 1 else 0


def whole_plates(which: NDArray[np.bool_], count: int) -> Numbers:
    """Indices of all shots at those plates of which any shot is marked."""
    return np.flatnonzero(np.repeat(which.reshape(-1, count).any(axis=1), count))


def in_turns(which: Numbers, count: int, slots: int) -> Numbers:
    """Shots in the order in which a device that computes so many plates at a time takes them: of each lot of plates
    first all first shots, then all second ones. Those at one plate are then in one slot, one after another."""
    lots = (which[first : first + slots * count] for first in range(0, len(which), slots * count))
    return np.concatenate([lot.reshape(-1, count).T.reshape(-1) for lot in lots])


def turns(total: int, count: int, slots: int) -> Iterator[tuple[int, int]]:
    """(first, number) of the launches that compute so many shots in the order of `in_turns`."""
    for first in range(0, total, slots * count):
        plates = min(slots, (total - first) // count)
        yield from ((first + turn * plates, plates) for turn in range(count))


def chunk_of(most: int, count: int) -> int:
    """Shots per launch, at most so many but at least one plate: those at one plate stay together."""
    return max(1, most // count) * count


def spoilt(status: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Statuses of all shots, in which a shot fails, too, where the computation of an earlier one at its plate failed:
    nobody knows what that one left of the plate."""
    rows = status.reshape(-1, count).copy()
    for order in range(1, count):
        before = rows[:, order - 1]
        rows[:, order] = np.where(before >= Status.UNFINISHED, before, rows[:, order])
    return rows.reshape(-1)
