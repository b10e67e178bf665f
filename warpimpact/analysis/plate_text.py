"""A plate in numbers, and the solid plate that has the areal density of its whole target, as text."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v

if TYPE_CHECKING:
    from warpimpact.results.table import Result


def plate_numbers(open_area: float, ligament: float, areal_density: float, resolution: float = 0.0) -> dict[str, str]:
    """Numbers of a plate as text with units, by name.

    Args:
        open_area: share of holes.
        ligament: the smallest one [m]; inf if there is none, and then it is left out.
        areal_density: [kg/m²].
        resolution: resolution of the ligament [m]; 0 if it is exact.
    """
    numbers = {"open area": f"{open_area:.1%}"}
    if math.isfinite(ligament):
        numbers["smallest ligament"] = f"{1e3 * ligament:.2f} mm"
        if resolution:
            numbers["smallest ligament"] += f" (resolved to {1e3 * resolution:g} mm)"
    return numbers | {"areal density": f"{areal_density:.1f} kg/m²"}


def plate_text(dataset: Result) -> str:
    """Areal density and open area, where a result carries them."""
    attributes = dataset.attrs
    if attr.AREAL_DENSITY not in attributes:
        return ""
    return f", {attributes[attr.AREAL_DENSITY]:.4g} kg/m², {attributes[attr.OPEN_AREA]:.1%} open"


def solid_plate(dataset: Result) -> str:
    """Thickness and material of the solid plate of equal areal density, as a phrase; empty where that is not told."""
    attributes = dataset.attrs
    material = json.loads(attributes.get(attr.MATERIAL, "{}"))
    if not {"resistance", "density"} <= material.keys() or attr.AREAL_DENSITY not in attributes:
        return ""
    thickness = 1e3 * float(attributes[attr.AREAL_DENSITY]) / material["density"]
    if attr.CONTINUUM in attributes:
        return f"{thickness:.3g} mm of {json.loads(attributes[attr.CONTINUUM])['materials'][0]} by finite elements"
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
    if attr.CONTINUUM in dataset.attrs:
        return note
    if not material.get("degradation", 1.0) < 1.0 or material.get("degradation_depth") is not None:
        return note
    note += " A thick plate that weakens as a whole holds less than a real one, so a ratio to it flatters the target."
    if material.get("degradation_distance") is not None:
        return note
    return (
        f"{note} Weakening by time, it stops no core, however slow; give degradation_distance in the place of "
        "degradation_interval for a solid plate that may stop cores."
    )
