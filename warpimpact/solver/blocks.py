"""The block layout (kernels/block.py): what it computes, and the window that a block can hold."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpimpact.scene import Core, Shots

SIZES = (1024, 2048, 3072, 4096, 6144)
"""Windows that blocks have [nodes]; each is compiled by itself. Two fields of float32 of the largest fill the 48 KiB of
shared memory that a block of every CUDA device has."""
WINDOW_SLACK, NODAL_SLACK = 1.6, 1.2
"""Half the width of a first window for a straight shot, in radii of the core. It is smaller for the literal scheme: on
its fine grid, large windows cost more time than the repetition of some shots."""


def first_window(core: Core, shots: Shots, thickness: float, spacing: float, reach: int, *, nodal: bool) -> int:
    """Nodes of a window, in each direction, that holds the footprint of a core that keeps its attitude through the
    plate.

    Args:
        thickness: of the plate, or of the laminate that it begins [m]. Layers farther away have windows of their own.
        spacing, reach: of the plate's grid [m] and of its filter [nodes].
    """
    slack = NODAL_SLACK if nodal else WINDOW_SLACK
    steepest = float(shots.obliquity.max())
    turned = min(1.0, float(np.sin(np.hypot(shots.pitch, shots.yaw)).max()))
    half = slack * core.max_radius / math.cos(steepest) + thickness * math.tan(steepest) + core.bounding_radius * turned
    return 2 * (math.ceil(half / spacing) + 2 * reach + 3)


def block_window(cells: int) -> int:
    """Nodes of the window of a block that holds so many in each direction; 0 if none does."""
    return next((size for size in SIZES if size >= cells**2), 0)
