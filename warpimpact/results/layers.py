"""Layers of a target in a Dataset: faces, scattered quantities, where they are solid, and outlines."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene import Plate, Scene, Shots, Target
from warpimpact.scene.input_files import parsed
from warpimpact.scene.quantities import BY_LAYER


def own_columns(target: Target, shots: Shots) -> dict[str, NDArray[Any]]:
    """Quantities that differ from shot to shot, under the names of a result. A quantity that every layer has is named
    as `thickness` for the plate, and as `layer_thickness` for all layers if a layer behind the plate differs."""
    columns: dict[str, NDArray[Any]] = {name: values for name, values in shots.columns.items() if name not in BY_LAYER}
    for name in BY_LAYER:
        values = [shots.layer_value(target, name, k) for k in range(len(target.layers))]
        if shots.varies(name, 0):
            columns[name] = values[0]
        if any(shots.varies(name, k) for k in range(1, len(values))):
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


def outlines(dataset: xarray.Dataset, layer: int = 0) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes of a layer (0 is the plate) [m], each of shape (vertex,), by the axis "y" and "z", with a
    NaN between two outlines, as the campaign of the result has them; empty where it has none, or they are swept."""
    try:
        tables = parsed(str(dataset.attrs.get(attr.CAMPAIGN, "")), "the campaign in the result")
        pattern = [tables["plate"], *tables.get("layer", ())][layer].get("pattern")
        holes = {} if pattern is None else {"pattern": pattern}
        plate = Plate.model_validate({"thickness": 1.0, "resistance": 0.0, **holes})
    except (AttributeError, LookupError, ValueError):
        return dict.fromkeys(v.OUTLINE, np.empty(0))
    if any("pattern" in key or key.startswith(("plate", "layer")) for key in tables.get("sweep", ())):
        return dict.fromkeys(v.OUTLINE, np.empty(0))
    offsets = {axis: f"layer_offset_{axis}" for axis in v.OUTLINE}
    offset = {of: float(np.median(dataset[at][..., layer])) if at in dataset else 0.0 for of, at in offsets.items()}
    sides = zip(dataset.attrs[attr.PLATE_PERIOD], offset.values(), strict=True)
    vertices = outlines_in(plate, *((-0.5 * float(side) - at, 0.5 * float(side) - at) for side, at in sides))
    return {axis: vertices[name] + offset[axis] for axis, name in v.OUTLINE.items()}


def outlines_in(
    plate: Plate, y_range: tuple[float, float], z_range: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes in a rectangle [m], by OUTLINE_VARIABLES, with a NaN between two outlines."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    vertices = np.concatenate(rows[1:]) if rows else np.empty((0, 2))
    return {v.OUTLINE_Y: vertices[:, 0], v.OUTLINE_Z: vertices[:, 1]}
