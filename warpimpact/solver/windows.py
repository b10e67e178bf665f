"""Windows: the part of each layer about a hit whose nodes remember what has weakened them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warpimpact.scene import Core, Shots
    from warpimpact.solver.grid import Grid
    from warpimpact.solver.materials import Materials

Cells = tuple[int, int]
"""Of a window, along y and z."""
Counts = NDArray[np.int64]

SIZES = (1024, 2048, 3072, 4096, 6144)
"""Windows that blocks have [nodes]; each is compiled by itself. Two fields of float32 of the largest fill the 48 KiB of
shared memory that a block of every CUDA device has."""
SLACK, NODAL_SLACK = 1.6, 1.2
"""Half the width of a first window for a straight shot, in radii of the core. It is smaller for the literal scheme: on
its fine grid, large windows cost more time than the repetition of some shots."""
DEEP = 0.6
"""Half of what the first window of a layer behind the plate is wider than that of the plate, in largest distances of
the core's surface from its centre of mass: the core arrives turned."""


def first_windows(core: Core, shots: Shots, material: Materials, grid: Grid, *, nodal: bool) -> Counts:
    """Nodes of a window, in each direction, that holds the footprint of a core that keeps its attitude through the
    plate, or the laminate that it begins; shape [shots]. Layers farther away have windows of their own.

    Args:
        material, grid: of the plate.
    """
    slack = NODAL_SLACK if nodal else SLACK
    turned = np.minimum(1.0, np.sin(np.hypot(shots.pitch, shots.yaw)))
    half = (
        slack * core.max_radius / np.cos(shots.obliquity)
        + material.together * np.tan(shots.obliquity)
        + core.bounding_radius * turned
    )
    return 2 * (np.ceil(half / grid.spacing).astype(np.int64) + 2 * grid.reach + 3)


def windows_behind(
    core: Core, shots: Shots, materials: Sequence[Materials], grids: Sequence[Grid], plate: Counts, *, burst: bool
) -> Counts:
    """Nodes of the windows of all layers, in each direction, shape [layers, shots], if those of the plate have so many;
    0 where a layer keeps no field. A layer that earlier hits pierce keeps their channels.

    Args:
        plate: shape [1] or [shots].
    """
    steep, own = np.tan(shots.obliquity), [np.broadcast_to(plate, len(shots))]
    for material, grid in zip(materials[1:], grids[1:], strict=True):
        thicker = np.maximum(0.0, material.together - materials[0].together)
        half = 0.5 * own[0] * grids[0].spacing + DEEP * core.bounding_radius + thicker * steep
        count = 2 * (np.ceil(half / grid.spacing).astype(np.int64) + 2 * len(grid.taps) + 3)
        own.append(count if material.weakens or burst else np.zeros_like(own[0]))
    return np.stack([own[material.laminate] for material in materials])


def block_window(cells: int) -> int:
    """Nodes of the window of a block that holds so many in each direction; 0 if none does."""
    return next((size for size in SIZES if size >= cells**2), 0)
