"""Inputs of the kernels: the arrays of a scene and its shots, put on one device once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import march
from warpimpact.solver.grid import Grid, Tile
from warpimpact.solver.prepare import Prepared
from warpimpact.solver.rings import Rings

if TYPE_CHECKING:
    from warpimpact.scene import Core

Array = NDArray[np.float64]

LARGEST_ONSET = 0.02
"""Bound of the onset speed, as a share of the impact velocity."""


@dataclass(frozen=True)
class Put:
    """Puts values on the named device, by default in the floating-point type `real` of the kernels."""

    device: str
    real: Any

    def __call__(self, values: NDArray[Any], dtype: Any = None) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype or self.real, device=self.device)


class Inputs:
    """The structs of the march (kernels/march.py), filled.

    Attributes:
        stage: the build of the march that the scene needs.
        put: puts values on the device.
        plates: structs of the plates of all layers.
        count: number of shots.
        surface, sections, target, law, shots, pace: structs on the device.
    """

    def __init__(self, arrays: Prepared, device: Any) -> None:
        self.stage, self.put = march.build(arrays.variant), Put(device.alias, arrays.variant.real)
        self.surface = surface_of(self.stage.Surface, arrays.scene.core, arrays.rings, arrays.azimuths, self.put)
        self.plates = [plate_of(self.stage.Plate, grid, self.put) for grid in arrays.grids]
        self.target = self._target(arrays)
        self.sections = self._sections(arrays)
        self.shots = self._shots(arrays)
        self.count = len(arrays.conditions["hit_y"])
        self.law = self.stage.Law()
        self.law.onset_share, self.law.onset_limit = arrays.scene.interaction.onset, LARGEST_ONSET
        self.pace = self.stage.Pace()
        self.pace.time_step, self.pace.way_along = arrays.resolution.time_step or 0.0, arrays.resolution.way_along
        self.pace.rows = arrays.rows

    def give_up_after(self, way: float) -> None:
        """Give up the last shot after this distance [m] at impact velocity."""
        longest_way = self.shots.longest_way.numpy()
        ways = np.resize(longest_way, max(len(longest_way), self.count))
        ways[-1] = way
        self.shots.longest_way = self.put(ways, wp.float64)

    def _target(self, arrays: Prepared) -> Any:
        """The Target (kernels/target.py)."""
        target, materials = self.stage.Target(), arrays.materials
        target.count = len(materials)
        if arrays.variant.layered:
            target.plates = wp.array(self.plates, dtype=self.stage.Plate, device=self.put.device)
        else:
            target.plates = self.plates[0]
        target.weakens = self.put(np.array([one.weakens for one in materials]), wp.bool)
        target.laminate = self.put(np.array([one.laminate for one in materials]), wp.int32)
        target.by_path = self.put(np.array([one.by_path for one in materials]), wp.bool)
        target.a2 = self.put(np.array([one.a2 for one in materials]))
        record = arrays.scene.record
        target.standoffs, target.ahead = self.put(np.array(record.layer_standoffs)), record.ahead(arrays.scene.core)
        for name, variable in self.stage.Target.vars.items():
            if getattr(variable.type, "ndim", 1) == 2:
                rows = np.broadcast_arrays(*(getattr(one, name) for one in materials))
                setattr(target, name, self.put(np.stack(rows), variable.type.dtype))
        return target

    def _sections(self, arrays: Prepared) -> Any:
        struct = self.stage.Sections()
        if arrays.sections is not None:
            for name in self.stage.Sections.vars:
                setattr(struct, name, self.put(getattr(arrays.sections, name)))
        return struct

    def _shots(self, arrays: Prepared) -> Any:
        shots = self.stage.Shots()
        for name, variable in self.stage.Shots.vars.items():
            setattr(shots, name, self.put(arrays.conditions[name], variable.type.dtype))
        return shots


def surface_of(struct: Any, core: Core, rings: Rings, azimuths: Array, put: Put) -> Any:
    """The Surface (kernels/core_surface.py) of a core in rings of patches."""
    surface, area, around = struct(), np.hypot(rings.area_axial, rings.area_radial), len(azimuths) // 2
    azimuth = np.resize(azimuths, len(area) * around)  # of even and of odd rings in turn
    values = {name: getattr(rings, name) for name in _OF_A_RING} | {
        "area": area,
        "normal_axial": rings.area_axial / area,
        "normal_radial": rings.area_radial / area,
        "cosine": np.cos(azimuth),
        "sine": np.sin(azimuth),
    }
    values["patches"] = np.repeat(np.stack([values[name] for name in _OF_A_PATCH]), around)
    for name, array in values.items():
        setattr(surface, name, put(array))
    surface.rings, surface.around = len(area), around
    surface.max_radius, surface.bounding_radius = core.max_radius, core.bounding_radius
    return surface


_OF_A_PATCH = (
    "station",
    "radius",
    "area",
    "normal_axial",
    "normal_radial",
    "half_axial",
    "half_radial",
    "turn_axial",
    "turn_radial",
)
_OF_A_RING = ("station", "radius", "half_axial", "half_radial", "turn_axial", "turn_radial")


def plate_of(struct: Any, grid: Grid, put: Put) -> Any:
    """The Plate (kernels/plate_grid.py) of a grid."""
    plate = struct()
    plate.tile, plate.clear = _on_device(grid.tile, put)
    plate.tile_y, plate.tile_z = grid.tile.material.shape
    plate.period_y, plate.period_z = grid.period
    plate.half_y, plate.half_z = grid.half_size
    plate.spacing = grid.spacing
    plate.taps, plate.reach = put(grid.taps), grid.reach
    plate.planes, plate.per_plane, plate.plane_reach = grid.planes.number, 1.0 / grid.planes.spacing, grid.planes.reach
    return plate


@lru_cache(maxsize=16)
def _on_device(tile: Tile, put: Put) -> tuple[Any, Any]:
    """Material and clearance of a tile. No kernel changes them, so they are kept for later shots at the same plate."""
    return put(tile.material.reshape(-1)), put(tile.clearance.reshape(-1))
