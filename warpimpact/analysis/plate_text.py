"""A plate in numbers, the weights of its target, and the solid reference, as text."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.references import references_of


def plate_numbers(open_area: float, ligament: float, weights: Mapping[str, float]) -> dict[str, str]:
    """Numbers of a plate as text with units, by name.

    Args:
        open_area: share of holes.
        ligament: the smallest one [m]; inf if there is none, and then it is left out.
        weights: as `Target.weights`.
    """
    numbers = {"open area": f"{open_area:.1%}"}
    if math.isfinite(ligament):
        numbers["smallest ligament"] = f"{1e3 * ligament:.2f} mm"
    return numbers | {name: f"{weight:.1f} kg/m²" for name, weight in weights.items()}


def weights_of(dataset: xarray.Dataset) -> dict[str, float]:
    """`Target.weights` of the target of a result; only the whole weight if the file does not separate add-on and
    base."""
    whole = float(dataset.attrs[attr.AREAL_DENSITY])
    if attr.ADD_ON_DENSITY not in dataset.attrs:
        return {"whole target" if v.LAYER_STATUS in dataset else "areal density": whole}
    add_on = float(dataset.attrs[attr.ADD_ON_DENSITY])
    return {"add-on": add_on, "base": whole - add_on, "whole target": whole}


def weights_text(weights: Mapping[str, float]) -> str:
    """Weights as one phrase."""
    return ", ".join(f"{name} {weight:.1f} kg/m²" for name, weight in weights.items())


def plate_text(dataset: xarray.Dataset) -> str:
    """Weights and open area, where a result carries them."""
    if attr.AREAL_DENSITY not in dataset.attrs:
        return ""
    weights = ", ".join(f"{name} {weight:.4g} kg/m²" for name, weight in weights_of(dataset).items())
    return f", {weights.removeprefix('areal density ')}, {dataset.attrs[attr.OPEN_AREA]:.1%} open"


def reference_name(dataset: xarray.Dataset) -> str:
    """Name of the reference with which a target is compared."""
    return "solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"


def common_name(references: Iterable[str]) -> str:
    """The name that several references share, or a general one."""
    names = {*references}
    return names.pop() if len(names) == 1 else "solid reference"


def solid_plate(dataset: xarray.Dataset) -> str:
    """Thickness and material of the solid reference as a phrase; empty where unknown."""
    attributes, solid = dataset.attrs, references_of(dataset).get("solid")
    if solid is None or attr.CAMPAIGN not in solid.attrs:
        return ""
    campaign = json.loads(solid.attrs[attr.CAMPAIGN])
    plates = [campaign["plate"], *campaign["layer"]]
    plates = plates[:-1] or plates  # the last of several layers is the base
    if attr.CONTINUUM in attributes:
        materials = json.loads(attributes[attr.CONTINUUM])["materials"]
        pairs = zip(plates, materials, strict=False)
        return " and ".join(f"{1e3 * plate['thickness']:.3g} mm of {name} by finite elements" for plate, name in pairs)
    names = [f"{plate['material']}, " if plate.get("material") else "" for plate in plates]
    return " and ".join(
        f"{1e3 * plate['thickness']:.3g} mm of {name}{1e-9 * plate['resistance']:.3g} GPa, {_weakens(plate)}"
        for plate, name in zip(plates, names, strict=True)
    )


def _weakens(material: Mapping[str, Any]) -> str:
    if not (share := material.get("degradation", 1.0)) < 1.0:
        return "which does not weaken"
    by_path = material.get("degradation_distance") is not None
    unit = (
        f"{1e3 * material['degradation_distance']:.3g} mm of path"
        if by_path
        else f"{1e6 * material['degradation_interval']:.3g} µs of contact"
    )
    return f"which weakens, through its whole thickness at once, to {share:.3g} in {unit}"


def solid_note(dataset: xarray.Dataset) -> str:
    """A sentence about the solid plate beside a result, and why it may not be the best plate of its weight; empty where
    the result has none."""
    plate = solid_plate(dataset)
    if not plate:
        return ""
    what = "the material of the plate in front"
    if attr.ADD_ON_DENSITY in dataset.attrs:
        what = f"as heavy as the add-on ({dataset.attrs[attr.ADD_ON_DENSITY]:.4g} kg/m²), before the same base"
    note = f"The {reference_name(dataset)} is {plate}, {what}."
    material = json.loads(dataset.attrs[attr.MATERIAL])
    if attr.CONTINUUM in dataset.attrs:
        return note
    if not material.get("degradation", 1.0) < 1.0:
        return note
    note += " A thick plate that weakens as a whole holds less than a real one, so a ratio to it flatters the target."
    if material.get("degradation_distance") is not None:
        return note
    return (
        f"{note} Weakening by time, it stops no core, however slow; give degradation_distance in the place of "
        "degradation_interval for a solid plate that may stop cores."
    )
