"""HTML of a model for a notebook: a drawing to scale if it has a shape, and its values with units.

The models import this file, so it recognises cores, plates and targets by their attributes.
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Any, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from warpimpact.view import svg

from .units import reader_in, typed

Array = NDArray[np.float64]

UNIT_CELLS = 3
"""Unit cells of an unbounded plate along each side of a drawing."""
_HOLES_DRAWN = 2000
_CORE_COLOUR = "#D55E00"


def html_of(model: BaseModel) -> str:
    """The drawings of a model and of its parts, and a table of the given values."""
    parts = [model, *(getattr(model, name) for name in type(model).model_fields)]
    if (target := getattr(model, "target", None)) is not None:
        parts = [target if part is getattr(model, "plate", None) else part for part in parts]
    drawings = "".join(f'<span style="margin-right: 1em">{drawing}</span>' for drawing in map(_drawn, parts) if drawing)
    rows = "".join(
        f'<tr><th style="text-align: left">{escape(name)}</th><td style="text-align: left">{escape(value)}</td></tr>'
        for name, value in values_of(model)
    )
    return f"<div><b>{type(model).__name__}</b><div>{drawings}</div><table>{rows}</table></div>"


def values_of(model: BaseModel, place: str = "") -> Iterator[tuple[str, str]]:
    """Dotted names and texts of the values that were given to a model, with their units."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if name not in model.model_fields_set or value is None:
            continue
        several = value if isinstance(value, tuple) and value and isinstance(value[0], BaseModel) else None
        if isinstance(value, BaseModel):
            yield from values_of(value, f"{place}{name}.")
        elif several is not None:
            for number, part in enumerate(several):
                yield from values_of(part, f"{place}{name}[{number}].")
        else:
            yield f"{place}{name}", _text(value, typed(field))


def _text(value: Any, kind: Any) -> str:
    if isinstance(value, tuple):
        inner = next((option for option in (kind, *get_args(kind)) if get_origin(option) is tuple), tuple[Any, ...])
        kinds = [item for item in get_args(inner) if item is not Ellipsis] or [Any]
        return ", ".join(_text(item, kinds[min(place, len(kinds) - 1)]) for place, item in enumerate(value))
    reader = reader_in(kind)
    return str(value) if reader is None or not isinstance(value, int | float) else reader.text(value)


def _drawn(part: Any) -> str:
    if hasattr(part, "breaks"):
        return _core(part)
    if isinstance(getattr(part, "layers", None), tuple):
        return _holes(part.layers[0]) + (_section(part) if len(part.layers) > 1 else "")
    return _holes(part) if hasattr(part, "pattern") else ""


def _holes(plate: Any) -> str:
    """A plate from the front, y to the right and z up."""
    cell = np.array(plate.sampled_cell)
    whole = plate.size is not None and np.prod(np.array(plate.size) / cell) <= _HOLES_DRAWN
    half = 0.5 * (np.array(plate.size) if whole else UNIT_CELLS * cell)
    outlines = plate.pattern.outlines((-half[0], half[0]), (-half[1], half[1]))
    return svg.drawing([svg.plate(outlines, -half, half)], -half, half, "plate")


def _core(core: Any) -> str:
    """A core from the side, its nose to the right."""
    stations = np.union1d(np.linspace(0.0, core.length, 101), core.breaks)
    radius = core.radius(stations)
    along = np.concatenate([-stations, -stations[::-1]])
    shape = np.column_stack([along, np.concatenate([radius, -radius[::-1]])])
    return svg.drawing([svg.Shape([shape], _CORE_COLOUR)], shape.min(axis=0), shape.max(axis=0), "core")


def _section(target: Any) -> str:
    """The layers of a target from the side, to scale along the line of fire."""
    depth = target.depth
    shapes = [
        np.array([(front, 0.0), (rear, 0.0), (rear, 0.3 * depth), (front, 0.3 * depth)]) for front, rear in target.faces
    ]
    return svg.drawing([svg.Shape(shapes)], np.zeros(2), np.array([depth, 0.3 * depth]), "layers")
