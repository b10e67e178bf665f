"""How deep cores go into the base: the last layer of a target, which the others protect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed

if TYPE_CHECKING:
    from warpimpact.results.table import Result

Array = NDArray[np.float64]

DEPTH_VARIABLES = (v.STATUS, v.STOPPED_IN, v.DEPTH, v.LAYER_THICKNESS, *v.LAYER_FACES)
"""Variables from which the depth in the base follows."""


def has_base(dataset: Result) -> bool:
    """Whether there are layers behind the plate."""
    return v.STOPPED_IN in dataset


def base_thickness(dataset: Result) -> Array:
    """Thickness of the base [m]: one number, or shape [hits] where it scatters."""
    if v.LAYER_THICKNESS in dataset:
        return np.asarray(dataset[v.LAYER_THICKNESS].values[:, -1])
    return np.asarray(dataset[v.LAYER_REAR].values[-1] - dataset[v.LAYER_FRONT].values[-1])


def base_depth(dataset: Result) -> Array:
    """How deep every core goes into the base [m], shape [hits]; NaN where the computation failed.

    A core that stops before the base or bounces off it counts as 0. A core that pierces or passes the base counts as
    the thickness of the base, the least depth that it could reach in a thicker one. NaN where the result has no depth,
    as for a single plate.
    """
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    thickness = base_thickness(dataset)
    depth = np.where(rests, np.minimum(dataset[v.DEPTH].values, thickness), 0.0)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), thickness, depth))


def is_pierced(dataset: Result) -> Array:
    """1 where a core comes out of the rear face of the base, whether it rests in the base or passes it, else 0; shape
    [hits]. NaN as in `base_depth`."""
    margin = piercing_margin(dataset)
    return np.where(np.isnan(margin), np.nan, margin >= 0.0)


def piercing_margin(dataset: Result) -> Array:
    """Distance of every core's foremost point behind the rear face of the base [m], negative before it, shape [hits].
    Infinite for a core that passes the base, minus infinity for one that rests before it; NaN as in `base_depth`."""
    if not has_base(dataset):
        return np.full(dataset.sizes["hit"], np.nan)
    rests = dataset[v.STOPPED_IN].values == dataset.sizes["layer"] - 1
    beyond = np.where(rests, dataset[v.DEPTH].values - base_thickness(dataset), -np.inf)
    return np.where(failed(dataset), np.nan, np.where(passed(dataset), np.inf, beyond))
