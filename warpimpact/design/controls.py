"""What the page shows of a design: sliders with the meaning of their keys, and plate and target as lines to scale."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from pydantic import BaseModel

from warpimpact.analysis.effectiveness import plate_numbers
from warpimpact.analysis.replay_geometry import runs_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.design.designs import ValidDesign
from warpimpact.plotting.cell import words
from warpimpact.plotting.plate import Dimension, drawn_extent, hole_dimensions, smallest_ligament
from warpimpact.plotting.style import fire_of
from warpimpact.scene import NoPattern, Plate, Target
from warpimpact.scene.model import Array, Model
from warpimpact.scene.pattern import LatticePattern
from warpimpact.scene.units import MM, reader_in, typed

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
    core, threat = design.campaign.core, design.campaign.core.threat
    shot = [_choice("threat", ["core", "threat"], threat)]
    if not threat:
        keys = (name for name in type(core).model_fields if ("core", name) in _RANGES)
        shot += [_slider(design, ["core", name]) for name in keys if getattr(core, name) is not None]
    shot += [_slider(design, ["impact", name]) for name in _SHOT]
    groups: list[dict[str, Any]] = [{"name": "Shot", "controls": shot}]
    for number, layer in enumerate(design.campaign.target.layers):
        table: Place = ["layer", number - 1] if number else ["plate"]
        name = f"Layer {number}" if number else "Plate"
        groups.append({"name": name, "layer": number, "controls": list(_of_plate(design, table, layer))})
    return groups


def _of_plate(design: ValidDesign, table: Place, plate: Plate) -> Iterator[dict[str, Any]]:
    weighed = "areal_density" in (_value(design.tables, table) or {})
    if table[0] == "layer":
        yield _slider(design, [*table, "gap"])
    yield _slider(design, [*table, "areal_density" if weighed else "thickness"])
    yield _choice("material", [*table, "material"], plate.material)
    if plate.material is None:
        yield _slider(design, [*table, "resistance"])
    pattern, place = plate.pattern, [*table, "pattern"]
    yield _choice("shape", place, getattr(pattern, "shape", "none"))
    for name, field in type(pattern).model_fields.items():
        reader = reader_in(typed(field))
        if reader is not None and reader.unit in ("m", "rad"):
            yield _slider(design, [*place, name])
    if hasattr(pattern, "spacing"):
        spacing = [*place, "spacing"]
        if isinstance(_value(design.tables, spacing), list):
            for axis, label in enumerate(_AXES):
                yield _slider(design, [*spacing, axis]) | {"label": f"spacing {label}"}
        else:
            yield _slider(design, spacing, pattern.spacing[1]) | {"label": "pitch"}
    if hasattr(pattern, "staggered"):
        meaning, path = pattern.meanings().get("staggered", ""), [*place, "staggered"]
        yield {"kind": "switch", "path": path, "label": "staggered", "value": pattern.staggered, "meaning": meaning}


def _choice(what: str, path: Place, value: str | None) -> dict[str, Any]:
    return {"kind": "choice", "what": what, "path": path, "label": what, "value": value or ""}


def _slider(design: ValidDesign, path: Place, value: float | None = None) -> dict[str, Any]:
    """A slider for the value at a place; `value` is in SI, by default that of the campaign."""
    *tables, name = (part for part in path if isinstance(part, str))
    table = "plate" if tables == ["layer"] else tables[-1]
    owner: Model = _value(design.campaign, path[: path.index(name)])
    field = type(owner).model_fields.get(name)
    reader = None if field is None else reader_in(typed(field))
    si = "m" if name == "spacing" else "kg/m^2" if name == "areal_density" else reader.unit if reader else ""
    unit, size = _UNITS.get(si, (si, 1.0))
    shown = float(f"{size * (_value(design.campaign, path) or 0.0 if value is None else value):.6g}")
    low, high, step = _RANGES.get((table, name), _HOLE)
    return {
        "kind": "slider",
        "path": path,
        "label": words(name),
        "unit": unit,
        "value": shown,
        "low": low,
        "high": max(high, shown),
        "step": step,
        "scatters": isinstance(_value(design.tables, path), dict),
        "meaning": owner.meanings().get(name, ""),
    }


def _value(holder: Any, path: Place) -> Any:
    """The value at a place in models or in tables; None if there is none."""
    for part in path:
        try:
            holder = getattr(holder, part) if isinstance(part, str) and isinstance(holder, BaseModel) else holder[part]
        except (AttributeError, KeyError, IndexError, TypeError):
            return None
    return holder


_ACROSS, _ALONG = ("width", "diameter", "side"), ("length",)
"""Lengths of a hole across its direction, and along it."""
_PAGE_SECTION = 801
_COORDINATE_DIGITS = 3


def plate_drawing(campaign: Campaign) -> dict[str, Any]:
    """Plate, section of the target and numbers of a campaign."""
    plate, core, target = campaign.plate, campaign.core, campaign.target
    extent = drawn_extent(plate, core) * MM
    half = extent / MM / 2
    rings = plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    outlines = ("L".join(f"{y:.3f},{-z:.3f}" for y, z in ring * MM) for ring in rings)
    ligament = smallest_ligament(plate)
    cell = None if isinstance(plate.pattern, NoPattern) else _rounded(np.array(plate.pattern.period) * MM)
    return {
        "extent": _rounded(extent),
        "path": " ".join(f"M{outline}Z" for outline in outlines),
        "cell": cell,
        "core": round(core.max_radius * MM, _COORDINATE_DIGITS),
        "dimensions": [_line(hole_dimension) for hole_dimension in hole_dimensions(plate, ligament)],
        "ligament": None if ligament is None else _line(ligament),
        "fire": fire_of(campaign.impact.obliquity, campaign.impact.azimuth)._asdict(),
        "handles": list(_handles(campaign)),
        "section": _section(target, half[1]),
        "numbers": plate_numbers(plate.open_area, plate.ligament, target.weights),
        "thickness": f"{plate.thickness * MM:.4g} mm",
    }


def _line(dimension: Dimension) -> dict[str, Any]:
    start, end, text = dimension
    return {"start": _rounded(start * MM), "end": _rounded(end * MM), "text": text}


def _handles(campaign: Campaign) -> Iterator[dict[str, Any]]:
    """Handles of the plate. Dragging one changes its value by `gain` times the way along `direction`."""
    pattern = campaign.plate.pattern
    if not isinstance(pattern, LatticePattern):
        return
    turn = float(pattern.rotation)
    across = np.array([math.cos(turn), math.sin(turn)])
    along = np.array([-across[1], across[0]])
    half = np.array(pattern.period) / 2
    rings = pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    place = np.zeros(2) if pattern.holes is None else np.array(pattern.holes[0][:2])
    ring = min(rings, key=lambda outline: float(np.linalg.norm(outline.mean(axis=0) - place)), default=None)
    for names, direction in ((_ACROSS, across), (_ALONG, along)):
        name = next((name for name in names if name in type(pattern).model_fields), None)
        if name is not None and ring is not None:
            reach = float(((ring - place) @ direction).max())
            value = float(getattr(pattern, name))
            yield _handle(["plate", "pattern", name], place + reach * direction, direction, value / reach)
    for axis, direction in enumerate(np.array([[1.0, 0.0], [0.0, -1.0]])):  # where no dimension stands
        at = pattern.period[axis] / 2
        yield _handle(["plate", "pattern", "spacing", axis], at * direction, direction, pattern.spacing[axis] / at)


def _handle(path: Place, at: Array, direction: Array, gain: float) -> dict[str, Any]:
    return {"path": path, "at": _rounded(at * MM), "direction": _rounded(direction, 6), "gain": round(gain, 6)}


def _section(target: Target, half: float) -> dict[str, Any]:
    """The layers in the section y = 0, and the faces that can be dragged along x."""
    z = np.linspace(-half, half, _PAGE_SECTION)
    layers, handles = [], list[dict[str, Any]]()
    for number, (layer, (front, rear)) in enumerate(zip(target.layers, target.faces * MM, strict=True)):
        offset = [target.value(f"offset_{axis}", number) for axis in "yz"]
        runs = runs_of(layer.is_solid(np.array(-offset[0]), z - offset[1]))
        parts = [_rounded(z[list(run)] * MM) for run in runs]
        name = "plate" if number == 0 else f"layer {number}"
        text = f"{name}, {layer.thickness * MM:.4g} mm"
        layers.append({"front": float(front), "rear": float(rear), "parts": parts, "text": text})
        table: Place = ["plate"] if number == 0 else ["layer", number - 1]
        along = np.array([1.0, 0.0])
        handles.append(_handle([*table, "thickness"], np.array([rear / MM, 0.0]), along, 1.0))
        if number:
            handles.append(_handle([*table, "gap"], np.array([front / MM, 0.0]), along, 1.0))
    return {"half": round(half * MM, _COORDINATE_DIGITS), "layers": layers, "handles": handles}


def _rounded(values: Array, digits: int = _COORDINATE_DIGITS) -> list[float]:
    return [float(value) for value in np.round(values, digits)]
