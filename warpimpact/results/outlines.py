"""Outlines of the holes of a plate, in memory and in a file.

In a file they are a group of their own. In memory they follow from the attributes, or are attributes themselves: along
"vertex" their number differs from plate to plate, so results with such variables could not be joined.
"""

from __future__ import annotations

import json
from dataclasses import replace
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
    NaN between two outlines.

    They follow from the plate. Where they do not, as in files of version 0.1 with holes from an image, the outlines of
    the plate are an attribute. They are empty if they are unknown.
    """
    if not layer and v.OUTLINE_Y in dataset.attrs:
        return {axis: np.atleast_1d(dataset.attrs[name]) for axis, name in v.OUTLINE.items()}
    fields = json.loads(dataset.attrs.get(attr.LAYERS, "{}")).get(str(layer), {})
    offset = fields.get("offset", (0.0, 0.0))
    text = json.dumps({name: fields[name] for name in Plate.model_fields if name in fields}) if layer else None
    try:
        plate = Plate.model_validate_json(text or dataset.attrs.get(attr.PLATE, ""))
    except ValueError:  # without a plate, or with holes from an image
        return dict.fromkeys(v.OUTLINE, np.empty(0))
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
    """A map of hits without outlines along "vertex". Outlines that do not follow from its plate become attributes."""
    if not set(v.OUTLINE_VARIABLES) <= set(dataset.coords):
        return dataset
    stored = {name: dataset[name].values for name in v.OUTLINE_VARIABLES}
    bare = dataset.drop_vars(v.OUTLINE_VARIABLES)
    follow = outlines(bare)
    if all(np.array_equal(follow[axis], stored[name], equal_nan=True) for axis, name in v.OUTLINE.items()):
        return bare
    return bare.assign_attrs({str(name): values for name, values in stored.items()})


def in_a_file(table: HitTable) -> HitTable:
    """A map of hits with its outlines along "vertex"."""
    if v.HIT not in table.sizes or attr.PLATE_PERIOD not in table.attrs or attr.SWEEP in table.attrs:
        return table
    columns = {str(name): (name.dims, outlines(table)[axis], name.attributes) for axis, name in v.OUTLINE.items()}
    attributes = {name: value for name, value in table.attrs.items() if name not in v.OUTLINE_VARIABLES}
    return replace(table.assign_coords(columns), attrs=attributes)
