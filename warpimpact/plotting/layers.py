"""Figure of a replayed hit: the resistance left in the layers behind the plate."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from warpimpact.analysis.slabs import LayerField, fields_behind
from warpimpact.plotting.style import inscribe_hit
from warpimpact.results import variables as v

_MM, _US = 1e3, 1e6
_ROOM_ABOUT = 2.0
"""Margin about the part that the core weakened [mm]."""


def layers(dataset: xarray.Dataset) -> Figure:
    """Resistance left in every layer behind the plate that weakens, a row each, seen from behind.

    Each cell shows the share of its initial resistance; holes are white.
    """
    fields, times = fields_behind(dataset), dataset[v.SNAPSHOT].values
    figure = Figure(figsize=(2.5 * len(times) + 1.6, 2.9 * len(fields) + 0.9), layout="constrained")
    inscribe_hit(figure, dataset, "resistance left in the layers, seen from behind")
    panels = figure.subplots(len(fields), len(times), squeeze=False, sharex="row", sharey="row")
    for row, layer in zip(panels, fields, strict=True):
        for place, (axes, time) in enumerate(zip(row, times, strict=True)):
            image = draw_left(axes, layer, place)
            axes.set(title=f"{time * _US:.0f} µs", xlabel="y [mm]")
        row[0].set_ylabel(f"layer {layer.number}, z [mm]")
    figure.colorbar(image, ax=panels, label="share of the resistance left")
    return figure


def draw_left(axes: Axes, layer: LayerField, snapshot: int) -> AxesImage:
    """Draw the share of its initial resistance that each cell has left, in the range that the core weakens."""
    first, share = layer.share[0], layer.share[snapshot]
    left = np.where(first >= 0.5, share / np.maximum(first, 0.5), np.nan)
    extent = (*_edges(layer.cell_y), *_edges(layer.cell_z))
    style: dict[str, Any] = {"cmap": "viridis", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
    image = axes.imshow(left.T, origin="lower", extent=extent, **style)
    y, z = weakened_ranges(layer)
    axes.set(xlim=y, ylim=z)
    return image


def weakened_ranges(layer: LayerField) -> list[tuple[float, float]]:
    """Ranges along y and z [mm] that the core weakened, with a margin; the whole window if it weakened nothing."""
    weaker, ranges = layer.share[-1] < layer.share[0], []
    for axis, cells in enumerate((layer.cell_y, layer.cell_z)):
        low, high = _edges(cells)
        there = cells[weaker.any(axis=1 - axis)] * _MM
        inside = (max(low, there.min() - _ROOM_ABOUT), min(high, there.max() + _ROOM_ABOUT)) if there.size else None
        ranges.append(inside or (low, high))
    return ranges


def _edges(cells: NDArray[np.float64]) -> tuple[float, float]:
    """Outer edges of evenly spaced cells [mm]."""
    half = 0.5 * (cells[1] - cells[0])
    return float((cells[0] - half) * _MM), float((cells[-1] + half) * _MM)
