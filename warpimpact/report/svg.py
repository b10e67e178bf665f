"""Drawings of a plate to scale as SVG. Points are in metres, the first axis to the right; the SVG is in millimetres."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from warpimpact.scene.model import Array

_BAR = 10.0
"""Length of a bar for the scale [mm]."""


def path(outlines: Iterable[Array]) -> str:
    """Closed outlines [m] as the data of an SVG path in millimetres."""
    rings = ("L".join(f"{x:.3f},{-y:.3f}" for x, y in 1e3 * outline) for outline in outlines if len(outline))
    return " ".join(f"M{ring}Z" for ring in rings)


def rings(first: Array, second: Array) -> list[Array]:
    """Outlines of which a file has the coordinates, with a NaN between one and the next."""
    points = np.column_stack([first, second])
    parts = np.split(points, np.flatnonzero(np.isnan(points[:, 0])))
    return [ring for part in parts if len(ring := part[~np.isnan(part[:, 0])])]


def drawing(holes: Iterable[Array], half: Array, label: str, scale: float) -> str:
    """A cell of a plate with its holes, above a bar of 10 mm.

    Args:
        half: half the sides of the cell [m], around the origin.
        label: what it shows, for those who do not see it.
        scale: pixels per millimetre.
    """
    outline = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    y, z = 1e3 * half
    frame = f'x="{-y:.4f}" y="{-z:.4f}" width="{2 * y:.4f}" height="{2 * z:.4f}"'
    return (
        f'<svg role="img" aria-label="{escape(label)}" width="{scale * 2 * y:.0f}" height="{scale * (2 * z + 2):.0f}" '
        f'viewBox="{-y:.4f} {-z:.4f} {2 * y:.4f} {2 * z + 2:.4f}">'
        # Holes go on beyond the frame, which an inner svg clips.
        f'<svg {frame} viewBox="{-y:.4f} {-z:.4f} {2 * y:.4f} {2 * z:.4f}">'
        f'<path d="{path([outline, *holes])}" fill="#b8b8b8" fill-rule="evenodd"/></svg>'
        f'<path d="M{-y:.4f},{z + 1.2:.4f}h{_BAR:g}" stroke="black" stroke-width="0.5"/></svg>'
    )
