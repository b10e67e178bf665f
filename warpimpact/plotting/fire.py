"""The direction of fire in a drawing of a plate or a map of hits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patheffects import withStroke

from warpimpact.results import variables as v

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warpimpact.results.table import Result

_LENGTH, _CORNER = 30.0, (0.92, 0.08)
"""Length of the arrow [points], and the place of its middle in the axes, as shares of their sides."""
_ONE_DIRECTION = 1e-3
"""Largest difference of angles that are one direction [rad]."""


def direction_of(dataset: Result) -> tuple[float, float] | None:
    """Obliquity and azimuth of the shots of a result [rad]; None where they differ."""
    angles = [np.radians(np.asarray(dataset[name].values, dtype=float)) for name in (v.OBLIQUITY, v.AZIMUTH)]
    if any(np.ptp(angle) > _ONE_DIRECTION for angle in angles):
        return None
    return float(angles[0].flat[0]), float(angles[1].flat[0])


def draw_fire(axes: Axes, obliquity: float, azimuth: float) -> None:
    """Draw where the shots fly in the plane of the plate, seen from behind it: an arrow with its angle, or along the
    normal a point in a circle, which flies at the reader."""
    middle: dict[str, Any] = {"xy": _CORNER, "xycoords": "axes fraction", "annotation_clip": False, "zorder": 6}
    outline = [withStroke(linewidth=2.5, foreground="white")]
    if abs(math.sin(obliquity)) < _ONE_DIRECTION:
        axes.annotate("⊙ fire", ha="center", va="center", fontsize="small", path_effects=outline, **middle)
        return
    along = 0.5 * _LENGTH * math.copysign(1.0, obliquity) * np.array([math.cos(azimuth), math.sin(azimuth)])
    arrow = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.5, "path_effects": outline}
    axes.annotate("", xytext=tuple(-2.0 * along), textcoords="offset points", arrowprops=arrow, **middle)
    text = f"fire {math.degrees(abs(obliquity)):.3g}°"
    above: dict[str, Any] = {"xytext": (6.0, 9.0), "textcoords": "offset points", "ha": "right", "va": "bottom"}
    axes.annotate(text, fontsize="small", path_effects=outline, **above, **middle)
