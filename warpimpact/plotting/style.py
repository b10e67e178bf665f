"""What figures share: colours, the sides of a panel, and the bars of an interval."""

from __future__ import annotations

import math
from base64 import b64encode
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
"""Colours of Okabe and Ito: they differ in every kind of colour blindness."""
GREY = "0.55"
MAP_SIDE = 4.2
"""Longer side of a map on paper [inch]."""


def data_url(figure: Figure, dpi: int = 110) -> str:
    """A figure as a PNG picture in an address, for a page."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return png_url(buffer.getvalue())


def png_url(picture: bytes) -> str:
    """A PNG picture as an address."""
    return f"data:image/png;base64,{b64encode(picture).decode()}"


def hide_sides(axes: Axes, *sides: str) -> None:
    """Hide sides of the frame of a panel: "top", "right", "left"."""
    for side in sides:
        axes.spines[side].set_visible(False)


def bars(value: float, low: float, high: float) -> list[list[float]] | None:
    """The two bars of an interval about a value, as `errorbar` takes them; None where there is no interval."""
    if math.isnan(low) or math.isnan(high):
        return None
    return [[max(0.0, value - low)], [max(0.0, high - value)]]


def all_bars(values: Array, low: Array, high: Array) -> Array:
    """The bars of many intervals, shape [2, points]; 0 where there is no interval."""
    return np.asarray(np.nan_to_num([values - low, high - values]).clip(0.0))
