"""How deep cores go into the base: the last layer of a target, which the others protect."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed

if TYPE_CHECKING:
    from warpimpact.results.table import Result

Array = NDArray[np.float64]

NEEDED = (v.STATUS, v.STOPPED_IN, v.DEPTH, v.LAYER_THICKNESS, *v.LAYER_FACES)
"""Variables that say so."""


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

    A core that stops before the base or bounces off it counts 0. A core that pierces or passes the base counts with the
    thickness of the base, which is the least that it could go into a thicker one. NaN where the result has no depth, as
    that of a single plate.
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
    depth = base_depth(dataset)
    return np.where(np.isnan(depth), np.nan, depth >= base_thickness(dataset) if has_base(dataset) else np.nan)


def solid_plate(dataset: Result) -> str:
    """Thickness and material of the solid plate of equal areal density, as a phrase; empty where that is not told."""
    told = dataset.attrs
    material = json.loads(told.get(attr.MATERIAL, "{}"))
    if not {"resistance", "density"} <= material.keys() or attr.AREAL_DENSITY not in told:
        return ""
    thickness = 1e3 * float(told[attr.AREAL_DENSITY]) / material["density"]
    return f"{thickness:.3g} mm of {1e-9 * material['resistance']:.3g} GPa, {_weakens(material)}"


def _weakens(material: dict[str, Any]) -> str:
    if not (share := material.get("degradation", 1.0)) < 1.0:
        return "which does not weaken"
    by_path = material.get("degradation_distance") is not None
    unit = (
        f"{1e3 * material['degradation_distance']:.3g} mm of path"
        if by_path
        else f"{1e6 * material['degradation_interval']:.3g} µs of contact"
    )
    at_once = "" if material.get("degradation_depth") is not None else ", through its whole thickness at once,"
    return f"which weakens{at_once} to {share:.3g} in {unit}"


def solid_note(dataset: Result) -> str:
    """What the solid plate beside a result is, and what keeps it from being the best plate of that weight; empty where
    the result has none."""
    plate = solid_plate(dataset)
    if not plate or not {*v.SOLID_VARIABLES, *v.SOLID_LIMIT_VARIABLES} & dataset.variables.keys():
        return ""
    note = f"The solid plate is {plate}, the material of the plate in front."
    material = json.loads(dataset.attrs[attr.MATERIAL])
    if not material.get("degradation", 1.0) < 1.0 or material.get("degradation_depth") is not None:
        return note
    note += " A thick plate that weakens as a whole holds less than a real one, so a ratio to it flatters the target."
    if material.get("degradation_distance") is not None:
        return note
    return (
        f"{note} Weakening by time, it stops no core, however slow; give degradation_distance in the place of "
        "degradation_interval for a solid plate that may stop cores."
    )
