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
