"""Layers on a device: the windows of those behind the plate, the scratch of the march, and how the cores left them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.solver.grid import AT_A_TIME, WHOLE

if TYPE_CHECKING:
    from warpimpact.kernels.variant import Variant
    from warpimpact.scene import Plate
    from warpimpact.solver.prepare import Prepared

Array = NDArray[np.float64]

THROUGH = 16
"""Depths at which the mean through a layer is taken."""
DEEP = 0.6
"""Half of what the first window of a layer behind the plate is wider than that of the plate, in largest distances of
the core's surface from its centre of mass: the core arrives turned."""


def deep_cells(arrays: Prepared, layer: int, cells: int) -> tuple[int, int]:
    """Cells of the window of a layer behind the plate, if the plate's has so many; 0 if the layer keeps no field."""
    plate, material = arrays.materials[0], arrays.materials[layer]
    if not material.weakens:
        return 0, 0
    grid = arrays.grids[layer]
    thicker = max(0.0, float(material.together.max() - plate.together.max()))
    aslant = thicker * math.tan(float(arrays.shots.obliquity.max()))
    half = 0.5 * cells * arrays.grid.spacing + DEEP * arrays.scene.core.bounding_radius + aslant
    count = 2 * (math.ceil(half / grid.spacing) + 2 * len(grid.taps) + 3)
    return count, count


def nodes_of(arrays: Prepared, cells: Sequence[tuple[int, int]]) -> list[int]:
    """Nodes in the windows of all layers, if they have so many cells; 0 for those that share the field of another."""
    return [
        grid.planes.number * y * z if material.laminate == layer else 0
        for layer, (material, grid, (y, z)) in enumerate(zip(arrays.materials, arrays.grids, cells, strict=True))
    ]


def firsts_of(arrays: Prepared, nodes: Sequence[int]) -> NDArray[np.int64]:
    """The first node of every layer's field among those of its slot, if the layers have so many of their own."""
    before = np.cumsum([0, *nodes[:-1]])
    return np.asarray(before[[material.laminate for material in arrays.materials]])


class Weakened(NamedTuple):
    """What is left of a layer behind the plate, in the window where a core reached it.

    Attributes:
        cell_y, cell_z: centres of the cells in the plane of the plate [m], shapes [cells_y] and [cells_z].
        material: share of material in each cell, shape [cells_y, cells_z].
        share: resistance left, as a share of Y, the mean through the thickness; 0 in holes.
    """

    cell_y: Array
    cell_z: Array
    material: Array
    share: Array


def weakened(
    arrays: Prepared, plates: Sequence[Plate], hit: tuple[float, float], scratch: tuple[Any, ...], cells: Sequence[Any]
) -> dict[int, Weakened]:
    """The layers behind the plate that weaken and that the last shot reached, after a march of one slot.

    Args:
        plates: of the target, in order.
        hit: hit point of the shot (y, z) [m].
        scratch: fields, touches, stack, … of the slot.
        cells: of the windows of all layers.
    """
    fields, _, stack, *_ = scratch
    is_open, homes, exposure = stack.open.numpy(), stack.home.numpy(), fields.exposure.numpy()
    found = {}
    for k, (size, material) in enumerate(zip(cells, arrays.materials, strict=True)):
        if k > 0 and math.prod(size) and is_open[k]:
            spacing, place = arrays.grids[k].spacing, (float(homes[k][1]), float(homes[k][2]))
            y, z = nodes_about((hit[0] + place[0], hit[1] + place[1]), size, spacing)
            offset = float(material.offset_y[-1]), float(material.offset_z[-1])
            solid = material_about(plates[k], y - offset[0], z - offset[1], spacing)
            found[k] = Weakened(y, z, solid, solid * share_left(arrays, k, exposure, cells))
    return found


def share_left(arrays: Prepared, layer: int, exposure: NDArray[Any], cells: Sequence[tuple[int, int]]) -> Array:
    """Share of the resistance that is left of a layer in its window, the mean through its thickness, of the last shot.

    Args:
        exposure: of one slot.
        cells: of the windows of all layers.
    """
    materials, leader = arrays.materials, arrays.materials[layer].laminate
    planes = arrays.grids[layer].planes if materials[layer].deep[-1] else WHOLE
    first = firsts_of(arrays, nodes_of(arrays, cells))[layer]
    field = exposure[first : first + planes.number * math.prod(cells[layer])].reshape(planes.number, *cells[layer])
    depth = materials[layer].front[-1] - materials[leader].front[-1]
    depth = depth + materials[layer].thickness[-1] * (np.arange(THROUGH) + 0.5) / THROUGH
    place = depth / planes.spacing + (planes.number > 1)  # a plane to spare before the first face
    below = np.floor(place).astype(int)
    share = np.zeros(field.shape[1:])
    for at, low in zip(place - below, below, strict=True):
        exposed = (1.0 - at) * field[low] + at * field[min(low + 1, planes.number - 1)]
        share += np.exp(materials[layer].decay_rate[-1] * np.maximum(exposed, 0.0))
    return share / THROUGH


def nodes_about(home: tuple[float, float], cells: Sequence[int], spacing: float) -> tuple[Array, Array]:
    """Coordinates of the nodes of a window about its home, along y and z [m]."""
    y, z = (np.asarray(at + (np.arange(n) - n // 2) * spacing) for at, n in zip(home, cells, strict=True))
    return y, z


def material_about(plate: Plate, y: Array, z: Array, spacing: float) -> Array:
    """Share of material about every node, shape [nodes_y, nodes_z]; points are taken where an edge may be."""
    samples = 16
    fine = ((np.arange(samples) + 0.5) / samples - 0.5) * spacing
    share, rows = np.empty((len(y), len(z))), max(1, AT_A_TIME // len(z))
    for first in range(0, len(y), rows):
        along_y = y[first : first + rows, None]
        share[first : first + rows] = plate.is_solid(along_y, z)
        row, column = np.nonzero(plate.has_edge(along_y, z, spacing))
        points = along_y[row, :, None] + fine[:, None], z[column, None, None] + fine
        share[first + row, column] = plate.is_solid(*points).mean(axis=(1, 2))
    return share


class Passages:
    """How the cores of some shots left each layer (kernels/layers.py), on the device.

    Args:

    Attributes:
        filled: the struct that the march fills; empty if the plate stands alone.
        free: whether a core flies free at each stand-off behind each layer, shape [layers, stand-offs].
    """

    def __init__(self, stage: Any, shots: int, free: NDArray[np.bool_], variant: Variant, device: Any) -> None:
        self._stage, self.free, self._layered, self._device = stage, free, variant.layered, device
        self._layers, standoffs = free.shape
        self.filled = stage.Passage()
        shapes = (shots,), (shots, self._layers), (shots, self._layers, standoffs)
        for name, variable in stage.Passage.vars.items() if self._layered else ():
            kind = variable.type
            setattr(self.filled, name, wp.empty(shapes[kind.ndim - 1], dtype=kind.dtype, device=device))

    def stack(self, slots: int) -> Any:
        """Scratch of some slots."""
        stack = self._stage.Stack()
        for name, variable in self._stage.Stack.vars.items() if self._layered else ():
            setattr(stack, name, wp.empty(slots * self._layers, dtype=variable.type.dtype, device=self._device))
        return stack
