"""The direction of fire in a drawing of a plate or a map of hits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.patheffects import withStroke

from warpimpact.results import variables as v

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from warpimpact.results.table import Result

_LENGTH, _CORNER = 30.0, (0.92, 0.08)
"""Length of the arrow [points], and the place of its head in the axes, as shares of their sides."""
_ONE_DIRECTION = 1e-3
"""Largest difference of angles that are one direction [rad]."""


def common_fire(dataset: Result) -> Fire | None:
    """The direction of fire of the shots of a result; None where they differ."""
    angles = [np.radians(np.asarray(dataset[name].values, dtype=float)) for name in (v.OBLIQUITY, v.AZIMUTH)]
    if any(np.ptp(angle) > _ONE_DIRECTION for angle in angles):
        return None
    return fire_of(float(angles[0].flat[0]), float(angles[1].flat[0]))


class Fire(NamedTuple):
    """Direction of flight in the plane of the plate, seen from behind it: unit vector (y, z), and words. Along the
    normal, shots fly at the reader, and `along` is (0, 0)."""

    along: tuple[float, float]
    text: str


def fire_of(obliquity: float, azimuth: float) -> Fire:
    """The direction of fire for a drawing; angles in radians."""
    if abs(math.sin(obliquity)) < _ONE_DIRECTION:
        return Fire((0.0, 0.0), "⊙ fire")
    sign = math.copysign(1.0, obliquity)
    along = sign * math.cos(azimuth), sign * math.sin(azimuth)
    return Fire(along, f"fire {math.degrees(abs(obliquity)):.3g}°")


def draw_fire(axes: Axes, fire: Fire) -> None:
    """Draw an arrow with its angle, or along the normal a point in a circle."""
    middle: dict[str, Any] = {"xy": _CORNER, "xycoords": "axes fraction", "annotation_clip": False, "zorder": 6}
    outline = [withStroke(linewidth=2.5, foreground="white")]
    if fire.along == (0.0, 0.0):
        axes.annotate(fire.text, ha="center", va="center", fontsize="small", path_effects=outline, **middle)
        return
    tail = tuple(-_LENGTH * np.array(fire.along))
    arrow = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.5, "path_effects": outline}
    axes.annotate("", xytext=tail, textcoords="offset points", arrowprops=arrow, **middle)
    above: dict[str, Any] = {"xytext": (6.0, 9.0), "textcoords": "offset points", "ha": "right", "va": "bottom"}
    axes.annotate(fire.text, fontsize="small", path_effects=outline, **above, **middle)
