"""SVG drawings to scale for notebooks, reports and the page of a design: plates with holes and hits.

Points are in metres, the first axis to the right and the second up; the SVG is in millimetres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEEL = "#b8b8b8"
_DRAWING_PIXELS = 260.0
"""Longer side of a drawing without a scale of its own."""
_BAR = 10.0
"""Length of a bar for the scale [mm]."""


class Shape(NamedTuple):
    """Closed outlines [m], each of shape [points, 2], with their colours; an outline within another is a hole."""

    outlines: Iterable[Array]
    fill: str = STEEL
    edge: str = "none"


def path(outlines: Iterable[Array]) -> str:
    """Closed outlines [m] as the data of an SVG path in millimetres."""
    rings = ("L".join(f"{x:.3f},{-y:.3f}" for x, y in 1e3 * outline) for outline in outlines if len(outline))
    return " ".join(f"M{ring}Z" for ring in rings)


def rings(first: Array, second: Array) -> list[Array]:
    """Outlines of which a file has the coordinates, with a NaN between one and the next."""
    points = np.column_stack([first, second])
    parts = np.split(points, np.flatnonzero(np.isnan(points[:, 0])))
    return [ring for part in parts if len(ring := part[~np.isnan(part[:, 0])])]


def plate(holes: Iterable[Array], low: Array, high: Array) -> Shape:
    """The part of a plate between two corners [m], with its holes."""
    return Shape([np.array([low, (high[0], low[1]), high, (low[0], high[1])]), *holes])


def drawing(
    shapes: Sequence[Shape],
    low: Array,
    high: Array,
    label: str,
    *,
    scale: float | None = None,
    bar: bool = False,
) -> str:
    """An SVG drawing of what lies between two corners [m].

    Args:
        label: what it shows, for those who do not see it.
        scale: pixels per millimetre; without it the longer side has 260 pixels.
        bar: whether a bar of 10 mm stands below.
    """
    (width, height), (left, top) = 1e3 * (np.asarray(high) - low), (1e3 * low[0], -1e3 * high[1])
    scale, room = scale or _DRAWING_PIXELS / max(width, height), 2.0 if bar else 0.0
    frame = f'x="{left:.4f}" y="{top:.4f}" width="{width:.4f}" height="{height:.4f}"'
    parts = [
        f'<path d="{path(shape.outlines)}" fill="{shape.fill}" fill-rule="evenodd" stroke="{shape.edge}" '
        'stroke-width="0.1"/>'
        for shape in shapes
    ]
    if bar:  # holes go on beyond the frame, which an inner svg clips
        parts = [f'<svg {frame} viewBox="{left:.4f} {top:.4f} {width:.4f} {height:.4f}">', *parts, "</svg>"]
        parts.append(f'<path d="M{left:.4f},{top + height + 1.2:.4f}h{_BAR:g}" stroke="black" stroke-width="0.5"/>')
    return (
        f'<svg role="img" aria-label="{escape(label)}" width="{scale * width:.0f}" '
        f'height="{scale * (height + room):.0f}" viewBox="{left:.4f} {top:.4f} {width:.4f} {height + room:.4f}">'
        f"{''.join(parts)}</svg>"
    )
