"""The layers of a replayed hit as slabs: faces, and where each layer is solid beside the hit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Slab(NamedTuple):
    """One layer: its front and rear face [m], and whether it is solid at each point of the section."""

    front: float
    rear: float
    solid: NDArray[np.bool_]


def slabs(history: xarray.Dataset, view: str) -> list[Slab]:
    """The plate and the layers behind it, along y or z as `view` says, through the hit point."""
    if v.LAYER_FRONT not in history:
        return [Slab(0.0, history.attrs[attr.PLATE_THICKNESS], history[v.SOLID_ALONG[view]].values == 1)]
    faces = zip(history[v.LAYER_FRONT].values.tolist(), history[v.LAYER_REAR].values.tolist(), strict=True)
    solid = history[v.LAYER_SOLID_ALONG[view]].values == 1
    return [Slab(front, rear, here) for (front, rear), here in zip(faces, solid, strict=True)]


def depth_of(history: xarray.Dataset) -> float:
    """Distance from the front face of the target to the rear face of its last layer [m]."""
    return slabs(history, "y")[-1].rear


def runs_of(solid: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last places of the parts of a section that are solid."""
    edges = np.diff(np.concatenate([[0], solid.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


class LayerField(NamedTuple):
    """Resistance left in a layer: its number, 0 the plate, the cells of its window [m], and the remaining share of
    the resistance in them at every snapshot, shape [snapshots, cells_y, cells_z]."""

    number: int
    cell_y: NDArray[np.float64]
    cell_z: NDArray[np.float64]
    share: NDArray[np.float64]


def plate_field(history: xarray.Dataset) -> LayerField:
    """The LayerField of the plate."""
    return LayerField(0, *(history[name].values for name in (v.CELL_Y, v.CELL_Z, v.RESISTANCE_SHARE)))


def fields_behind(history: xarray.Dataset) -> list[LayerField]:
    """The LayerFields of the layers behind the plate that weaken and that the core reached."""
    slabs = []
    for number in range(history.sizes["layer"]) if v.LAYER_RESISTANCE_SHARE in history else ():
        y, z = (history[name].values[number] for name in (v.LAYER_CELL_Y, v.LAYER_CELL_Z))
        rows, columns = (int((cells == cells).sum()) for cells in (y, z))  # smaller windows are filled up with NaN
        if rows:
            share = history[v.LAYER_RESISTANCE_SHARE].values[:, number, :rows, :columns]
            slabs.append(LayerField(number, y[:rows], z[:columns], share))
    return slabs
