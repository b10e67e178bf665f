"""The inputs of the kernels (kernels/structs.py, Inputs): a prepared scene, copied to a device once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.scene import Core
from warpimpact.solver.grid import Grid
from warpimpact.solver.prepare import Prepared
from warpimpact.solver.rings import Rings, azimuths_of
from warpimpact.solver.tile import Tile

Array = NDArray[np.float64]

LARGEST_ONSET = 0.02
"""Largest onset speed, as a share of the impact velocity."""


@dataclass(frozen=True)
class ToDevice:
    """Puts values on the named device, by default in the floating-point type `real` of the kernels.

    On a CPU, values of this type are not copied, unless they shall be `aligned`, which is fastest for loops over
    patches.
    """

    device: str
    real: Any

    def __call__(self, values: NDArray[Any], dtype: Any = None, *, aligned: bool = False) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype or self.real, device=self.device, copy=aligned)


def filled(struct: Any, **members: Any) -> Any:
    """A struct with these members."""
    instance = struct()
    for name, value in members.items():
        setattr(instance, name, value)
    return instance


def empty(struct: Any, device: Any, *shapes: tuple[int, ...]) -> Any:
    """A struct of empty arrays on a device. `shapes` has one shape for each number of dimensions."""
    arrays = {name: variable.type for name, variable in struct.vars.items()}
    return filled(
        struct,
        **{name: wp.empty(shapes[kind.ndim - 1], dtype=kind.dtype, device=device) for name, kind in arrays.items()},
    )


def inputs_of(stage: Any, prepared: Prepared, put: ToDevice) -> tuple[Any, list[Any]]:
    """The Inputs of a build of the march, and the Plates that must be kept alive with them: an array of structs does
    not keep the arrays that its members point to."""
    free = prepared.scene.interaction.free_surface
    surface, sections = prepared.surface, {} if prepared.surface.sections is None else vars(prepared.surface.sections)
    shots = {name: put(prepared.conditions[name], variable.type.dtype) for name, variable in stage.Shots.vars.items()}
    target, plates = _target_of(stage, prepared, put)
    of_edges = {} if free is None else {"cover": free.cover, "attack": free.attack}
    inputs = filled(
        stage.Inputs,
        surface=surface_of(stage.Surface, prepared.scene.core, surface.rings, surface.around, put),
        sections=filled(stage.Sections, **{name: put(values, aligned=True) for name, values in sections.items()}),
        target=target,
        law=filled(stage.Law, onset_limit=LARGEST_ONSET, **of_edges),
        shots=filled(stage.Shots, **shots),
        rows=prepared.rows,
    )
    return inputs, plates


def _target_of(stage: Any, prepared: Prepared, put: ToDevice) -> tuple[Any, list[Any]]:
    """The Target, and its Plates, which must be kept alive."""
    target, materials = stage.Target(), prepared.materials
    target.count, plates = len(materials), [plate_of(stage.Plate, grid, put) for grid in prepared.grids]
    is_layered = prepared.variant.layered
    target.plates = wp.array(plates, dtype=stage.Plate, device=put.device) if is_layered else plates[0]
    for name, dtype in {"weakens": wp.bool, "by_path": wp.bool}.items():
        setattr(target, name, put(np.array([getattr(material, name) for material in materials]), dtype))
    target.slowing, target.slide = prepared.resolution.slowing, prepared.slide
    for name, variable in stage.Target.vars.items():
        if getattr(variable.type, "ndim", 1) == 2:
            columns = prepared.stretch if name == "stretch" else [getattr(material, name) for material in materials]
            setattr(target, name, put(np.stack(np.broadcast_arrays(*columns)), variable.type.dtype))
    return target, plates


@lru_cache(maxsize=64)
def surface_of(struct: Any, core: Core, rings: Rings, around: int, put: ToDevice) -> Any:
    """The Surface (kernels/structs.py) of a core in rings of `around` patches, cached, because no kernel changes it."""
    surface, area = struct(), np.hypot(rings.area_axial, rings.area_radial)
    azimuth_of = np.resize(azimuths_of(around), len(area) * around)  # of even and odd rings in turn
    of_rings = np.stack(
        [
            *(rings.station, rings.radius, area, rings.area_axial / area, rings.area_radial / area),
            *(rings.half_axial, rings.half_radial, rings.turn_axial, rings.turn_radial),
        ]
    )
    values = {
        "of_rings": of_rings.ravel(),
        "of_patches": np.repeat(of_rings, around),
        "cosine": np.cos(azimuth_of),
        "sine": np.sin(azimuth_of),
    }
    for name, array in values.items():
        setattr(surface, name, put(array, aligned=True))
    surface.rings, surface.around = len(area), around
    surface.max_radius, surface.bounding_radius = core.max_radius, core.bounding_radius
    return surface


def plate_of(struct: Any, grid: Grid, put: ToDevice) -> Any:
    """The Plate (kernels/structs.py) of a grid."""
    plate = struct()
    plate.tile, plate.clear = _on_device(grid.tile, put, "material", "clearance")
    plate.tile_y, plate.tile_z = grid.tile.shape
    plate.period_y, plate.period_z = grid.period
    plate.half_y, plate.half_z = grid.half_size
    plate.spacing = grid.spacing
    plate.taps, plate.reach = put(grid.taps, aligned=True), grid.reach
    if grid.cover is not None:
        (plate.cover,) = _on_device(grid.cover, put, "material")
        plate.cover_y, plate.cover_z = grid.cover.shape
        plate.radii, plate.directions = grid.cover.radii, grid.cover.directions
        plate.cover_per_y, plate.cover_per_z = 1.0 / grid.cover.dy, 1.0 / grid.cover.dz
        plate.cover_per_row, plate.cover_per_column = (
            count / cells for count, cells in zip(grid.cover.shape, grid.tile.shape, strict=True)
        )
    return plate


_ON_DEVICE: WeakKeyDictionary[Tile, dict[ToDevice, tuple[Any, ...]]] = WeakKeyDictionary()


def _on_device(tile: Tile, put: ToDevice, *names: str) -> tuple[Any, ...]:
    """Arrays of a tile, cached as long as the tile is, because no kernel changes them."""
    kept = _ON_DEVICE.setdefault(tile, {})
    if put not in kept:
        kept[put] = tuple(put(getattr(tile, name).reshape(-1)) for name in names)
    return kept[put]
