"""Scratch of the earlier hits at a plate, in the memory of a device (kernels/earlier.py, kernels/channel.py)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import constants

if TYPE_CHECKING:
    from warpimpact.solver.prepare import Prepared

PLANES = 1.5
"""Largest distance of two planes of a channel, in √(R × cell), with R the largest radius of the core. Between two
planes the side wall of an oblique channel is wrong by at most 0.28 tan²(angle with the normal) cells."""


def planes(prepared: Prepared) -> list[int]:
    """Number of planes on which the channels through each layer are kept; 0 without earlier hits."""
    if not prepared.variant.burst:
        return [0] * len(prepared.grids)
    thickest = [float(material.thickness.max()) for material in prepared.materials]
    return [planes_of(prepared, layer, thickness) for layer, thickness in enumerate(thickest)]


def planes_of(prepared: Prepared, layer: int, thickness: float) -> int:
    """Number of planes of a channel through a layer of this thickness [m], which may differ from shot to shot."""
    return 1 + math.ceil(thickness / float(_apart(prepared)[layer]))


def _apart(prepared: Prepared) -> NDArray[np.float64]:
    """Largest distance of the planes of a channel through each layer [m]."""
    radius = prepared.scene.core.max_radius
    return np.array([PLANES * math.sqrt(radius * grid.spacing) for grid in prepared.grids])


def channel_nodes(prepared: Prepared, windows: Sequence[tuple[int, int]]) -> list[int]:
    """Nodes of the channels through each layer in a slot, for windows of these numbers of cells along y and z."""
    return [number * math.prod(cells) for number, cells in zip(planes(prepared), windows, strict=True)]


def scratch(
    prepared: Prepared, stage: Any, put: Any, fields: Any, slots: int, nodes: int, windows: Sequence[tuple[int, int]]
) -> Any:
    """The Earlier of some slots, with `nodes` of the exposure in a slot and windows of these numbers of cells in the
    layers. The channels that a shot finds are put in its fields."""
    earlier = stage.Earlier()
    count, layers = prepared.shots.at_a_plate, len(prepared.grids)
    pierced, through = channel_nodes(prepared, windows), planes(prepared)
    earlier.count, earlier.nodes, earlier.layers = count, nodes, layers
    earlier.channel_nodes, earlier.planes = sum(pierced), sum(through)
    earlier.first, earlier.first_plane = (put(np.cumsum([0, *counts[:-1]]), wp.int32) for counts in (pierced, through))
    earlier.apart = put(_apart(prepared), wp.float64)
    boxes, kept = slots * count * layers, nodes if prepared.variant.degrades else 0
    sizes = dict.fromkeys(("hit", "open", "box", "through"), boxes) | {
        "exposure": slots * count * kept,
        "inside": slots * count * sum(pierced),
        "sections": slots * sum(through),
    }
    for name, size in sizes.items():
        kind = stage.Earlier.vars[name].type.dtype
        setattr(earlier, name, wp.empty(size, dtype=kind, device=put.device))
    fields.channel_nodes = sum(pierced)
    closed = constants.NO_CHANNEL.value
    fields.channel = wp.full(slots * sum(pierced), closed, dtype=prepared.variant.real, device=put.device)
    return earlier
