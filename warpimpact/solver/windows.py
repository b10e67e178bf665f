"""Windows: the parts of the layers about a hit whose nodes remember what has weakened them."""

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
"""Numbers of a window's cells along y and z."""
Counts = NDArray[np.int64]

SIZES = (1024, 2048, 3072, 4096, 6144)
"""Sizes of windows in the block layout [nodes]; each is compiled by itself. Two float32 fields of the largest fill the
48 KiB of shared memory that a block has on every CUDA device."""
SLACK, NODAL_SLACK = 1.6, 1.2
"""Half the width of a first window for a straight shot, in radii of the core. It is smaller in the literal scheme, on
whose fine grid large windows cost more time than the repetition of some shots."""
WIDER_BEHIND = 0.6
"""Half of the difference between the widths of the first windows of a layer and of the plate, in largest distances of
the core's surface from its centre of mass: the core arrives turned."""


def first_windows(
    core: Core, shots: Shots, material: Materials, plates: Sequence[Sequence[Grid]], which: Counts, *, nodal: bool
) -> Counts:
    """Nodes, in each direction, of a window that holds the footprint of a core that keeps its attitude through the
    plate; shape [shots]. Layers behind it have windows of their own.

    Args:
        material: material of the plate.
        plates: sets of grids of all layers.
        which: number of the set that each shot uses, shape [1] or [shots].
    """
    slack = NODAL_SLACK if nodal else SLACK
    turned = np.minimum(1.0, np.sin(np.hypot(shots.pitch, shots.yaw)))
    half = (
        slack * core.max_radius / np.cos(shots.obliquity)
        + material.thickness * np.tan(shots.obliquity)
        + core.bounding_radius * turned
    )
    spacing, reach = (np.array([getattr(grids[0], name) for grids in plates])[which] for name in ("spacing", "reach"))
    return np.asarray(2 * (np.ceil(half / spacing).astype(np.int64) + 2 * reach + 3))


def windows_behind(
    core: Core,
    shots: Shots,
    materials: Sequence[Materials],
    plates: Sequence[Sequence[Grid]],
    which: Counts,
    plate: Counts,
) -> Counts:
    """Nodes of the windows of all layers, in each direction, shape [layers, shots]; 0 where a layer keeps no field.

    Args:
        plate: nodes of the plate's windows in each direction, shape [1] or [shots].
    """
    steep, counts = np.tan(shots.obliquity), [np.broadcast_to(plate, len(shots))]
    wide = np.array([grids[0].spacing for grids in plates])[which]
    for k, material in enumerate(materials[1:], start=1):
        spacing = np.array([grids[k].spacing for grids in plates])[which]
        taps = np.array([len(grids[k].taps) for grids in plates])[which]
        thicker = np.maximum(0.0, material.thickness - materials[0].thickness)
        half = 0.5 * counts[0] * wide + WIDER_BEHIND * core.bounding_radius + thicker * steep
        count = 2 * (np.ceil(half / spacing).astype(np.int64) + 2 * taps + 3)
        counts.append(count if material.weakens else np.zeros_like(counts[0]))
    return np.stack(counts)


def block_window(cells: int) -> int:
    """Nodes of the smallest block window that holds cells × cells nodes; 0 if none does."""
    return next((size for size in SIZES if size >= cells**2), 0)
