"""The block layout (kernels/block.py): what it computes, and the window that a block can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpimpact.scene import Shots
    from warpimpact.solver.arrays import Arrays

SIZES = (1024, 2048, 3072, 4096, 6144)
"""Windows that blocks have [nodes]; each is compiled by itself. Two fields of float32 of the largest fill the 48 KiB of
shared memory that a block of every CUDA device has."""
WINDOW_SLACK, NODAL_SLACK = 1.6, 1.2
"""Half the width of a first window for a straight shot, in radii of the core. It is smaller for the literal scheme: on
its fine grid, large windows cost more time than the repetition of some shots."""
SIMPLE_ONLY: Mapping[str, str] = {
    "nodal": "the nodal scheme",
    "double": "double precision",
    "bends": "the bending moment",
    "layered": "layers",
    "burst": "several shots at one plate",
    "deep": "a plate thicker than its degradation_depth",
}
"""What only the simple layout computes: members of `Variant`, and what they are called."""


def check_layout(**wanted: bool) -> None:
    """Refuse what the block layout does not compute.

    Args:
        wanted: whether each of SIMPLE_ONLY is asked for.

    Raises:
        ValueError: names all of it.
    """
    found = [SIMPLE_ONLY[name] for name, asked in wanted.items() if asked]
    if found:
        raise ValueError(
            f'got numerics.layout = "block" beside {" and ".join(found)}, but it must be "simple" for that: a block '
            "computes one hit at a single plate, in single precision"
        )


def first_window(arrays: Arrays, shots: Shots) -> int:
    """Nodes of a window, in each direction, that holds the footprint of a core that keeps its attitude through the
    plate."""
    slack = NODAL_SLACK if arrays.variant.nodal else WINDOW_SLACK
    steepest = float(shots.obliquity.max())
    turned = min(1.0, float(np.sin(np.hypot(shots.pitch, shots.yaw)).max()))
    half = (
        slack * arrays.core.max_radius / math.cos(steepest)
        + float((arrays.materials[-1].front + arrays.materials[-1].thickness).max()) * math.tan(steepest)
        + arrays.core.bounding_radius * turned
    )
    return 2 * (math.ceil(half / arrays.grid.spacing) + 2 * arrays.grid.reach + 3)


def in_blocks(arrays: Arrays, shots: Shots) -> Arrays:
    """The arrays for the block layout; as they are if the window does not fit a block."""
    nodes = first_window(arrays, shots) ** 2
    window = next((size for size in SIZES if size >= nodes), 0)
    return replace(arrays, variant=replace(arrays.variant, window=window))
