"""Layers of a target in a Dataset: faces, scattered quantities, where they are solid, and outlines."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene import Plate, Shots, Target
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


def outlines(dataset: xarray.Dataset, layer: int = 0) -> NDArray[np.float64]:
    """Outlines of the holes of a layer (0 is the plate) along y and z [m], shape (2, vertices), with a NaN between two
    outlines, as the campaign of the result has them; empty where it has none, or they are swept."""
    try:
        tables = parsed(str(dataset.attrs.get(attr.CAMPAIGN, "")), "the campaign in the result")
        pattern = [tables["plate"], *tables.get("layer", ())][layer].get("pattern")
        holes = {} if pattern is None else {"pattern": pattern}
        plate = Plate.model_validate({"thickness": 1.0, "resistance": 0.0, **holes})
    except (AttributeError, LookupError, ValueError):
        return np.empty((2, 0))
    if any("pattern" in key or key.startswith(("plate", "layer")) for key in tables.get("sweep", ())):
        return np.empty((2, 0))
    columns = (f"layer_offset_{axis}" for axis in "yz")
    offset = np.array([float(np.median(dataset[at][..., layer])) if at in dataset else 0.0 for at in columns])
    half = 0.5 * np.array(dataset.attrs[attr.PLATE_PERIOD], dtype=float)
    return np.asarray(outlines_in(plate, *zip(-half - offset, half - offset, strict=True)).T + offset[:, None])


def outlines_in(plate: Plate, y_range: tuple[float, float], z_range: tuple[float, float]) -> NDArray[np.float64]:
    """Outlines of the holes in a rectangle [m], shape (vertices, 2), with a NaN between two outlines."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    return np.concatenate(rows[1:]) if rows else np.empty((0, 2))
