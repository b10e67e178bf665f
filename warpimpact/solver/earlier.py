"""Scratch of the earlier hits at a plate, in the memory of a device (kernels/earlier.py, kernels/channel.py)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warpimpact.solver.prepare import Prepared

PLANES = 1.5
"""Largest distance of the planes of a channel, in √(R × cell), R the largest radius of the core. Between two planes the
side wall of an oblique channel is off by 0.28 tan² of the angle with the normal, in cells, at most."""
CLOSED = -1.0
"""What a window holds where no channel is near [m]."""


def planes(prepared: Prepared) -> list[int]:
    """Planes on which the channels through each layer are kept; none where no earlier hits are."""
    if not prepared.variant.burst:
        return [0] * len(prepared.grids)
    thickest = [float(material.thickness.max()) for material in prepared.materials]
    return [planes_of(prepared, layer, thickness) for layer, thickness in enumerate(thickest)]


def planes_of(prepared: Prepared, layer: int, thickness: float) -> int:
    """Planes of a channel through a layer of some thickness [m]; a shot has those of its own thickness."""
    return 1 + math.ceil(thickness / float(_apart(prepared)[layer]))


def _apart(prepared: Prepared) -> NDArray[np.float64]:
    """Largest distance of the planes of a channel through each layer [m]."""
    radius = prepared.scene.core.max_radius
    return np.array([PLANES * math.sqrt(radius * grid.spacing) for grid in prepared.grids])


def channel_nodes(prepared: Prepared, windows: Sequence[tuple[int, int]]) -> list[int]:
    """Nodes of the channels through each layer in a slot, whose windows have so many cells."""
    return [number * math.prod(cells) for number, cells in zip(planes(prepared), windows, strict=True)]


def scratch(
    prepared: Prepared, stage: Any, put: Any, fields: Any, slots: int, nodes: int, windows: Sequence[tuple[int, int]]
) -> Any:
    """The Earlier of some slots; the channels that a shot finds are in its fields.

    Args:
        stage: the build of the march.
        put: puts values on the device (`solver.structs.Put`).
        nodes: of the exposure in a slot.
        windows: cells of the windows of all layers.
    """
    earlier, channels = stage.Earlier(), stage.Channels()
    count, layers = prepared.shots.at_a_plate, len(prepared.grids)
    pierced, through = channel_nodes(prepared, windows), planes(prepared)
    channels.count, channels.nodes, channels.planes = count, sum(pierced), sum(through)
    channels.first, channels.first_plane = (put(np.cumsum([0, *own[:-1]]), wp.int32) for own in (pierced, through))
    channels.apart = put(_apart(prepared), wp.float64)
    each, kept = slots * count * layers, nodes if prepared.variant.degrades else 0
    sizes = {"inside": slots * count * sum(pierced), "sections": slots * sum(through), "box": each, "through": each}
    _empty(channels, stage.Channels, sizes, put.device)
    earlier.count, earlier.nodes, earlier.layers = count, nodes, layers
    sizes = {"exposure": slots * count * kept, "y": each, "z": each, "open": each}
    _empty(earlier, stage.Earlier, sizes, put.device)
    earlier.channels = channels
    fields.channel_nodes = sum(pierced)
    fields.channel = wp.full(slots * sum(pierced), CLOSED, dtype=prepared.variant.real, device=put.device)
    return earlier


def _empty(filled: Any, struct: Any, sizes: dict[str, int], device: str) -> None:
    """Give members of a struct arrays of so many values."""
    for name, size in sizes.items():
        setattr(filled, name, wp.empty(size, dtype=struct.vars[name].type.dtype, device=device))
