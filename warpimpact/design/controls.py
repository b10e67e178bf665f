"""The controls of a design on the page: sliders with their ranges and the meaning of their keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.design.designs import Tables, ValidDesign
from warpimpact.plotting.cell import words
from warpimpact.scene import NoPattern, Plate
from warpimpact.scene.model import Model
from warpimpact.scene.units import reader_in, typed

Place = list[str | int]


_UNITS = {"m": ("mm", 1e3), "Pa": ("MPa", 1e-6), "kg": ("g", 1e3), "rad": ("deg", math.degrees(1.0))}
"""Units in which the page writes, and their size. Others are written as they are."""
_RANGES: Mapping[tuple[str, str], tuple[float, float, float]] = {
    ("plate", "thickness"): (0.5, 30.0, 0.1),
    ("plate", "areal_density"): (2.0, 240.0, 0.5),
    ("plate", "gap"): (0.0, 300.0, 1.0),
    ("plate", "resistance"): (100.0, 8000.0, 10.0),
    ("pattern", "spacing"): (1.0, 60.0, 0.1),
    ("pattern", "corner_radius"): (0.0, 5.0, 0.05),
    ("pattern", "rotation"): (-90.0, 90.0, 1.0),
    ("core", "length"): (5.0, 80.0, 0.1),
    ("core", "diameter"): (3.0, 20.0, 0.05),
    ("core", "cone_length"): (1.0, 40.0, 0.1),
    ("core", "crh"): (0.5, 6.0, 0.1),
    ("core", "mass"): (0.5, 80.0, 0.05),
    ("core", "density"): (2000.0, 20000.0, 50.0),
    ("impact", "velocity"): (100.0, 1500.0, 5.0),
    ("impact", "obliquity"): (0.0, 75.0, 1.0),
    ("impact", "azimuth"): (0.0, 360.0, 5.0),
    ("impact", "pitch"): (-20.0, 20.0, 0.5),
    ("impact", "yaw"): (-20.0, 20.0, 0.5),
}
"""Lowest and highest value and step of sliders, in the unit of a campaign file, by table and key."""
_HOLE = (0.5, 30.0, 0.1)
"""Range of any other length of a hole."""
_SHOT = ("velocity", "obliquity", "azimuth", "yaw", "pitch")
_AXES = ("along y", "along z")


def groups(design: ValidDesign) -> list[dict[str, Any]]:
    """The controls of a design, by the parts that they change."""
    campaign, tables = design.campaign, design.tables
    threat = campaign.core.threat
    shot = [*_choice("threat", ["core", "threat"], threat), *([] if threat else _of_core(campaign, tables))]
    shot += [_slider(campaign, tables, ["impact", name], "impact") for name in _SHOT]
    groups: list[dict[str, Any]] = [{"name": "Shot", "controls": shot}]
    for number, layer in enumerate(campaign.target.layers):
        table: Place = ["layer", number - 1] if number else ["plate"]
        name = f"Layer {number}" if number else "Plate"
        groups.append({"name": name, "layer": number, "controls": list(_of_plate(campaign, tables, table, layer))})
    return groups


def _of_core(campaign: Campaign, tables: Tables) -> Iterator[dict[str, Any]]:
    for name in type(campaign.core).model_fields:
        if ("core", name) in _RANGES and getattr(campaign.core, name) is not None:
            yield _slider(campaign, tables, ["core", name], "core")


def _of_plate(campaign: Campaign, tables: Tables, table: Place, plate: Plate) -> Iterator[dict[str, Any]]:
    weighed = "areal_density" in (_value(tables, table) or {})
    if table[0] == "layer":
        yield _slider(campaign, tables, [*table, "gap"], "plate")
    yield _slider(campaign, tables, [*table, "areal_density" if weighed else "thickness"], "plate")
    yield from _choice("material", [*table, "material"], plate.material)
    if plate.material is None:
        yield _slider(campaign, tables, [*table, "resistance"], "plate")
    pattern, place = plate.pattern, [*table, "pattern"]
    shape = "none" if isinstance(pattern, NoPattern) else str(getattr(pattern, "shape", "none"))
    yield from _choice("shape", place, shape)
    for name, field in type(pattern).model_fields.items():
        reader = reader_in(typed(field))
        if reader is not None and reader.unit in ("m", "rad"):
            yield _slider(campaign, tables, [*place, name], "pattern")
    if hasattr(pattern, "spacing"):
        if isinstance(_value(tables, [*place, "spacing"]), list):
            for axis, label in enumerate(_AXES):
                slider = _slider(campaign, tables, [*place, "spacing", axis], "pattern", "spacing")
                yield slider | {"label": f"spacing {label}"}
        else:
            pitch = pattern.spacing[1] * _UNITS["m"][1]
            yield _slider(campaign, tables, [*place, "spacing"], "pattern", "spacing", pitch) | {"label": "pitch"}
    if hasattr(pattern, "staggered"):
        meaning = pattern.meanings().get("staggered", "")
        path = [*place, "staggered"]
        yield {"kind": "switch", "path": path, "label": "staggered", "value": pattern.staggered, "meaning": meaning}


def _choice(what: str, path: Place, value: str | None) -> Iterator[dict[str, Any]]:
    yield {"kind": "choice", "what": what, "path": path, "label": what, "value": value or ""}


def _slider(
    campaign: Campaign, tables: Tables, path: Place, table: str, key: str | None = None, value: float | None = None
) -> dict[str, Any]:
    """A slider for the value at a place.

    Args:
        table: table of its range.
        key: key of its declaration, if it is not the last key of the place.
        value: value in the unit of the slider, if the campaign does not have it at this place.
    """
    name = key or str(path[-1])
    owner: Model = _value(campaign, path[:-1] if key is None else path[: path.index(key)])
    field = type(owner).model_fields.get(name)
    reader = None if field is None else reader_in(typed(field))
    si = "m" if name == "spacing" else "kg/m^2" if name == "areal_density" else reader.unit if reader else ""
    unit, size = _UNITS.get(si, (si, 1.0))
    if value is None:
        held = _value(campaign, path)
        value = 0.0 if held is None else float(held) * size
    low, high, step = _RANGES.get((table, name), _HOLE)
    return {
        "kind": "slider",
        "path": path,
        "label": words(name),
        "unit": unit,
        "value": float(f"{value:.6g}"),
        "low": low,
        "high": max(high, value),
        "step": step,
        "scatters": isinstance(_value(tables, path), dict),
        "meaning": owner.meanings().get(name, ""),
    }


def _value(holder: Any, path: Place) -> Any:
    """The value at a place in models or in tables; None if there is none."""
    for part in path:
        if isinstance(holder, dict):
            holder = holder.get(part)
        elif isinstance(holder, list | tuple):
            holder = holder[part] if isinstance(part, int) and part < len(holder) else None
        else:
            holder = getattr(holder, str(part), None)
    return holder
