"""The plate and the target of a design as lines for the page, to scale in mm, with draggable handles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.analysis.plate_text import plate_numbers
from warpimpact.analysis.slabs import runs_of
from warpimpact.plotting.plate import Dimension, drawn_extent, hole_dimensions, smallest_ligament
from warpimpact.plotting.style import fire_of
from warpimpact.scene import NoPattern
from warpimpact.scene.display import MM
from warpimpact.scene.patterns.lattice import LatticePattern
from warpimpact.view import svg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpimpact.campaign.campaign import Campaign
    from warpimpact.scene import Target

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
