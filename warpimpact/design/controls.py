"""What the page shows of a design: sliders with the meaning of their keys, and plate and target as lines to scale."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.analysis.effectiveness import plate_numbers
from warpimpact.analysis.replay_geometry import runs_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.design.designs import Tables, ValidDesign
from warpimpact.plotting.cell import words
from warpimpact.plotting.plate import Dimension, drawn_extent, hole_dimensions, smallest_ligament
from warpimpact.plotting.style import fire_of
from warpimpact.report import svg
from warpimpact.scene import NoPattern, Plate, Target
from warpimpact.scene.display import MM
from warpimpact.scene.model import Model
from warpimpact.scene.patterns.pattern import LatticePattern
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
    shot = [_choice("threat", ["core", "threat"], threat), *([] if threat else _of_core(campaign, tables))]
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
    yield _choice("material", [*table, "material"], plate.material)
    if plate.material is None:
        yield _slider(campaign, tables, [*table, "resistance"], "plate")
    pattern, place = plate.pattern, [*table, "pattern"]
    shape = "none" if isinstance(pattern, NoPattern) else str(getattr(pattern, "shape", "none"))
    yield _choice("shape", place, shape)
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


def _choice(what: str, path: Place, value: str | None) -> dict[str, Any]:
    return {"kind": "choice", "what": what, "path": path, "label": what, "value": value or ""}


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


_ACROSS, _ALONG = ("width", "diameter", "side"), ("length",)
"""Lengths of a hole across its direction, and along it."""
_PAGE_SECTION = 801
_COORDINATE_DIGITS = 3


def drawn(campaign: Campaign) -> dict[str, Any]:
    """Plate, section of the target and numbers of a campaign."""
    plate, core, target = campaign.plate, campaign.core, campaign.target
    extent = drawn_extent(plate, core) * MM
    half = extent / MM / 2
    rings = plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    ligament = smallest_ligament(plate)
    cell = None if isinstance(plate.pattern, NoPattern) else _rounded(np.array(plate.pattern.unit_cell) * MM)
    return {
        "extent": _rounded(extent),
        "path": svg.path(rings),
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
    ends = [_rounded(end * MM) for end in (dimension.start, dimension.end)]
    return {"start": ends[0], "end": ends[1], "text": dimension.text}


def _handles(campaign: Campaign) -> Iterator[dict[str, Any]]:
    """Handles of the plate. Dragging one changes its value by `gain` times the way along `direction`."""
    pattern = campaign.plate.pattern
    if not isinstance(pattern, LatticePattern):
        return
    turn = float(pattern.rotation)
    across = np.array([math.cos(turn), math.sin(turn)])
    along = np.array([-across[1], across[0]])
    half = np.array(pattern.unit_cell) / 2
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
        at = pattern.unit_cell[axis] / 2
        key: list[str | int] = ["plate", "pattern", "spacing", axis]
        yield _handle(key, at * direction, direction, pattern.spacing[axis] / at)


def _handle(
    path: list[str | int], at: NDArray[np.float64], direction: NDArray[np.float64], gain: float
) -> dict[str, Any]:
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
        table: list[str | int] = ["plate"] if number == 0 else ["layer", number - 1]
        along = np.array([1.0, 0.0])
        handles.append(_handle([*table, "thickness"], np.array([rear / MM, 0.0]), along, 1.0))
        if number:
            handles.append(_handle([*table, "gap"], np.array([front / MM, 0.0]), along, 1.0))
    return {"half": round(half * MM, _COORDINATE_DIGITS), "layers": layers, "handles": handles}


def _rounded(values: NDArray[np.float64], digits: int = _COORDINATE_DIGITS) -> list[float]:
    return [float(value) for value in np.round(values, digits)]
