"""Layers of a target in a Dataset: their faces, their scattered quantities, and where they are solid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.results import variables as v
from warpimpact.scene.quantities import BY_LAYER

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray

    from warpimpact.scene import Scene, Shots, Target


def own_columns(target: Target, shots: Shots) -> dict[str, NDArray[Any]]:
    """Quantities that differ from shot to shot, under the names of a result. A quantity that every layer has is named
    as `thickness` for the plate, and as `layer_thickness` for all layers if a layer behind the plate differs."""
    columns: dict[str, NDArray[Any]] = {name: values for name, values in shots.columns.items() if name not in BY_LAYER}
    for name in BY_LAYER:
        values = [shots.own_of(target, name, k) for k in range(len(target.layers))]
        if shots.differs(name, 0):
            columns[name] = values[0]
        if any(shots.differs(name, k) for k in range(1, len(values))):
            columns[f"layer_{name}"] = np.stack(np.broadcast_arrays(*values, np.empty(len(shots)))[:-1], axis=1)
    return columns


def values_of(target: Target, hit: xarray.Dataset, name: str) -> list[float]:
    """The values of a quantity in all layers for one hit of a result, which has them under the names of
    `own_columns`."""
    if f"layer_{name}" in hit:
        return [float(value) for value in hit[f"layer_{name}"]]
    values = [target.value(name, k) for k in range(len(target.layers))]
    return [float(hit[name]), *values[1:]] if name in hit else values


def faces(target: Target) -> dict[str, NDArray[np.float64]]:
    """Faces of the layers; empty if the plate stands alone."""
    return dict(zip(v.LAYER_FACES, target.faces.T, strict=True)) if len(target.layers) > 1 else {}


def labels(target: Target) -> dict[str, Any]:
    """Number, name and material of the layers; empty if the plate stands alone."""
    if len(target.layers) == 1:
        return {}
    names = [name for name, _ in target.named]
    materials = [layer.material or "" for layer in target.layers]
    return {v.LAYER: np.arange(len(names), dtype=np.int8), v.LAYER_NAME: names, v.LAYER_MATERIAL: materials}


def sections(scene: Scene, hit: xarray.Dataset, section: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Faces of the layers for one hit, and where each layer is solid along y and z through the hit point; empty for a
    single plate."""
    target, hit_y, hit_z = scene.target, float(hit[v.HIT_Y]), float(hit[v.HIT_Z])
    if len(target.layers) == 1:
        return {}
    thickness, offset_y, offset_z = (values_of(target, hit, name) for name in ("thickness", "offset_y", "offset_z"))
    front = np.array(target.fronts([np.array(value) for value in thickness]))
    places = list(zip(target.layers, offset_y, offset_z, strict=True))
    along_y = [plate.is_solid(hit_y - y + section, np.array(hit_z - z)) for plate, y, z in places]
    along_z = [plate.is_solid(np.array(hit_y - y), hit_z - z + section) for plate, y, z in places]
    return {
        v.LAYER_FRONT: front,
        v.LAYER_REAR: front + np.array(thickness),
        v.LAYER_SOLID_ALONG_Y: np.array(along_y).astype(np.int8),
        v.LAYER_SOLID_ALONG_Z: np.array(along_z).astype(np.int8),
    }
