"""Outlines of the holes of a plate: a group of their own in a file; in memory they follow from the attributes.

Along "vertex" their number differs from plate to plate, so results with such variables could not be joined.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene import Plate

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray

    from warpimpact.results.table import HitTable


def outlines(dataset: xarray.Dataset | HitTable, layer: int = 0) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes of a layer (0 is the plate) [m], each of shape (vertex,), by the axis "y" and "z", with a
    NaN between two outlines. They are empty if no attribute tells the layer."""
    layers = {"0": json.loads(dataset.attrs.get(attr.PLATE, "{}")), **json.loads(dataset.attrs.get(attr.LAYERS, "{}"))}
    fields = layers.get(str(layer), {})
    given = {name: fields[name] for name in ("size", "margin", "pattern") if name in fields}
    try:
        plate = Plate.model_validate({"thickness": 1.0, "resistance": 0.0, **given})  # the given ones may scatter
    except ValueError:
        return dict.fromkeys(v.OUTLINE, np.empty(0))
    offset = fields.get("offset", (0.0, 0.0))
    halves = [0.5 * float(side) for side in dataset.attrs[attr.PLATE_PERIOD]]
    vertices = outlines_in(plate, *((-half - at, half - at) for half, at in zip(halves, offset, strict=True)))
    return {axis: vertices[name] + at for (axis, name), at in zip(v.OUTLINE.items(), offset, strict=True)}


def outlines_in(
    plate: Plate, y_range: tuple[float, float], z_range: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """Outlines of the holes in a rectangle [m], by OUTLINE_VARIABLES, with a NaN between two outlines."""
    gap = np.full((1, 2), np.nan)
    rows = [row for outline in plate.pattern.outlines(y_range, z_range) for row in (gap, outline)]
    vertices = np.concatenate(rows[1:]) if rows else np.empty((0, 2))
    return {v.OUTLINE_Y: vertices[:, 0], v.OUTLINE_Z: vertices[:, 1]}


def in_memory(dataset: xarray.Dataset) -> xarray.Dataset:
    """A map of hits without outlines along "vertex"."""
    return dataset.drop_vars([name for name in v.OUTLINE_VARIABLES if name in dataset.coords])


def in_a_file(table: HitTable) -> HitTable:
    """A map of hits with its outlines along "vertex"."""
    if v.HIT not in table.sizes or attr.PLATE_PERIOD not in table.attrs or attr.SWEEP in table.attrs:
        return table
    found = outlines(table)
    columns = {str(name): (name.dims, found[axis], name.attributes) for axis, name in v.OUTLINE.items()}
    return table.assign_coords(columns)
