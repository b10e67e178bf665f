"""Changes of a design beyond one value: another threat, material or shape of hole, a layer more or less."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

from warpimpact.campaign.catalogued import catalogue_of
from warpimpact.campaign.text import CampaignError
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.design.designs import ROOT, Shelf, Tables, ValidDesign
from warpimpact.scene import Plate
from warpimpact.scene.patterns.lattice import LatticePattern
from warpimpact.scene.units import quoted

_SIZES: Mapping[str, Callable[[float], dict[str, float]]] = {
    "circle": lambda area: {"diameter": math.sqrt(4.0 * area / math.pi)},
    "slot": lambda area: _oblong(math.sqrt(area / (2.0 + math.pi / 4.0)), 3.0),
    "ellipse": lambda area: _oblong(math.sqrt(2.0 * area / math.pi), 2.0),
    "triangle": lambda area: {"side": math.sqrt(4.0 * area / math.sqrt(3.0))},
    "square": lambda area: {"side": math.sqrt(area)},
    "hexagon": lambda area: {"width": math.sqrt(2.0 * area / math.sqrt(3.0))},
}
"""Lengths [m] of a hole with a given area [m²], by shape."""
SHAPES = ("none", *_SIZES)
_SPACING = (8e-3, 16e-3)
_OPEN = 0.25
"""Cell [m] and open area of the first holes of a plate."""
_BASE = {"gap": "100 mm", "thickness": "10 mm"}
"""A layer that is added. Its material is that of the layer in front."""
_SMALLER, _TRIES = 0.85, 24
_OF_A_MATERIAL = ("resistance", "shear_coefficient", "density")


def _oblong(width: float, slender: float) -> dict[str, float]:
    return {"length": slender * width, "width": width}


def choices(design: Tables) -> dict[str, list[str]]:
    """Names that each choice offers. Threats whose core is unknown are left out."""
    catalogue = catalogue_of(design, "design", ROOT)
    threats = [name for name, threat in catalogue.all(Threat).items() if threat.shape is not None]
    return {"threat": threats, "material": list(catalogue.all(Material)), "shape": list(SHAPES)}


def changed(design: ValidDesign, shelf: Shelf, what: str, layer: int, value: str) -> Tables:
    """The tables of a design after a change.

    Args:
        what: "threat", "material", "shape", "add layer" or "remove layer".
        layer: number of the changed layer, 0 the plate.
        value: the chosen name; "" is a core or a material of one's own.

    Raises:
        CampaignError: there is no such change.
    """
    tables = deepcopy(design.tables)
    if not 0 <= layer < len(design.campaign.target.layers):
        raise CampaignError(f"got layer {layer}, but the design has layers 0 to {len(design.campaign.layer)}")
    match what:
        case "threat":
            _take_threat(tables, design, value)
        case "material":
            _take_material(_plate(tables, layer), design.campaign.target.layers[layer], value)
            if not value:
                tables["interaction"] = design.campaign.interaction.model_dump(exclude_none=True)
        case "shape":
            _take_shape(tables, design, shelf, layer, value)
        case "add layer":
            front = design.campaign.target.layers[-1]
            of_front = {"material": front.material} if front.material else _own(front)
            tables["layer"] = [*tables.get("layer", []), _BASE | of_front]
        case "remove layer" if layer > 0:
            tables["layer"] = [table for place, table in enumerate(tables["layer"]) if place != layer - 1]
            if not tables["layer"]:
                del tables["layer"]
        case _:
            raise CampaignError(
                f"got the change {quoted(what)}, but it must be threat, material, shape, add layer or remove layer"
            )
    return tables


def _plate(tables: Tables, layer: int) -> Tables:
    plate: Tables = tables["layer"][layer - 1] if layer else tables["plate"]
    return plate


def _own(plate: Plate) -> dict[str, Any]:
    """The numbers of a material as keys of a plate."""
    return {
        "resistance": f"{plate.resistance / 1e6:.6g} MPa",
        "shear_coefficient": plate.shear_coefficient,
        "density": f"{plate.density:.6g} kg/m^3",
    }


def _take_threat(tables: Tables, design: ValidDesign, name: str) -> None:
    """Take the core of a threat, and its velocity if the catalogue has one; an empty name keeps the core as numbers."""
    impact, core = tables.setdefault("impact", {}), design.campaign.core
    if name:
        tables["core"] = {"threat": name}
        known = catalogue_of(tables, "design", ROOT).all(Threat).get(name)
        if known is not None and known.velocities:
            impact.pop("velocity", None)
        else:
            impact["velocity"] = f"{design.campaign.impact.velocity:.6g} m/s"
        return
    labels = ("threat", "standard", "velocity_tolerance")
    shape = core.model_dump(mode="json", exclude_none=True, exclude=set(labels))
    shape |= {key: table for key, table in tables["core"].items() if key not in labels}
    tables["core"] = shape
    impact.setdefault("velocity", f"{design.campaign.impact.velocity:.6g} m/s")


def _take_material(table: Tables, plate: Plate, name: str) -> None:
    if name:
        for key in _OF_A_MATERIAL:
            table.pop(key, None)
        table["material"] = name
    else:
        table.pop("material", None)
        table |= _own(plate)


def _take_shape(tables: Tables, design: ValidDesign, shelf: Shelf, layer: int, shape: str) -> None:
    """Take holes of another shape with the same area, or with the largest area that leaves ligaments."""
    table, old = _plate(tables, layer), design.campaign.target.layers[layer].pattern
    if shape == "none":
        table.pop("pattern", None)
        return
    if shape not in _SIZES:
        raise CampaignError(f"got the shape {quoted(shape)}, but it must be one of {', '.join(SHAPES)}")
    lattice = isinstance(old, LatticePattern)
    spacing = old.spacing if isinstance(old, LatticePattern) else _SPACING
    area = old.hole_area if isinstance(old, LatticePattern) else _OPEN * math.prod(_SPACING)
    kept = {
        key: value for key, value in table.get("pattern", {}).items() if lattice and key in ("staggered", "rotation")
    }
    for _ in range(_TRIES):
        sizes = {key: _mm(length) for key, length in _SIZES[shape](area).items()}
        table["pattern"] = {"shape": shape, **sizes, "spacing": [_mm(side) for side in spacing], **kept}
        try:
            shelf.checked(tables)
        except CampaignError:
            area *= _SMALLER
        else:
            return


def _mm(length: float) -> str:
    return f"{round(1e3 * length, 1):g} mm"
