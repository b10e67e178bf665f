"""Layers on a device: the windows of those behind the plate, the scratch of the march, and how the cores left them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warpimpact.kernels.variant import Variant
    from warpimpact.solver.arrays import Arrays

DEEP = 0.6
"""Half of what the first window of a layer behind the plate is wider than that of the plate, in largest distances of
the core's surface from its centre of mass: the core arrives turned."""


def deep_cells(arrays: Arrays, layer: int, cells: int) -> tuple[int, int]:
    """Cells of the window of a layer behind the plate, if the plate's has so many; 0 if the layer keeps no field."""
    if not arrays.materials[layer].weakens:
        return 0, 0
    grid = arrays.grids[layer]
    half = 0.5 * cells * arrays.grid.spacing + DEEP * arrays.core.bounding_radius
    count = 2 * (math.ceil(half / grid.spacing) + 2 * len(grid.taps) + 3)
    return count, count


class Passages:
    """How the cores of some shots left each layer (kernels/layers.py), on the device.

    Args:
        free: whether a core flies free at each stand-off behind each layer, shape [layers, stand-offs].

    Attributes:
        filled: the struct that the march fills; empty if the plate stands alone.
    """

    def __init__(self, stage: Any, shots: int, free: NDArray[np.bool_], variant: Variant, device: Any) -> None:
        self._stage, self._free, self._layered, self._device = stage, free, variant.layered, device
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

    def columns(self) -> dict[str, NDArray[Any]]:
        """What was filled, by the names of `LayeredOutcomes`."""
        if not self._layered:
            return {}
        values = {name: getattr(self.filled, name).numpy() for name in self._stage.Passage.vars}
        at_standoffs = {
            f"layer_{name}": np.where(self._free, values[name].astype(np.float64), np.nan)
            for name in ("standoff_tilt", "standoff_pitch", "standoff_yaw")
        }
        return at_standoffs | {
            "layer_status": values["status"].astype(np.int8),
            "layer_residual_velocity": values["velocity"].astype(np.float64),
            "layer_tilt": values["tilt"].astype(np.float64),
            "layer_time": values["time"].astype(np.float64),
            "layer_deflection": values["deflection"].astype(np.float64),
            "stopped_in": values["stopped_in"].astype(np.int8),
            "depth": values["depth"].astype(np.float64),
        }
