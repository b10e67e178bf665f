"""Figure of a replayed hit: the resistance left in the layers behind the plate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray
from matplotlib.figure import Figure

from warpimpact.analysis.slabs import LayerField, fields_behind
from warpimpact.plotting.heading import inscribe
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MM, _US = 1e3, 1e6
_ROOM_ABOUT = 2.0
"""Margin about the part that the core weakened [mm]."""


def layers(dataset: xarray.Dataset) -> Figure:
    """Resistance left in every layer behind the plate that weakens, a row each, seen from behind.

    Each cell shows the share of its initial resistance; holes are white.
    """
    fields, times = fields_behind(dataset), dataset[v.SNAPSHOT].values
    figure = Figure(figsize=(2.5 * len(times) + 1.6, 2.9 * len(fields) + 0.9), layout="constrained")
    inscribe(figure, dataset, title=f"hit {dataset.attrs[attr.HIT]}: resistance left in the layers, seen from behind")
    panels = figure.subplots(len(fields), len(times), squeeze=False, sharex="row", sharey="row")
    for row, layer in zip(panels, fields, strict=True):
        extent = [*_edges(layer.cell_y), *_edges(layer.cell_z)]
        y, z = (_touched(layer, axis) for axis in (0, 1))
        for axes, share, time in zip(row, layer.share, times, strict=True):
            left = np.where(layer.share[0] >= 0.5, share / np.maximum(layer.share[0], 0.5), np.nan)
            style = {"origin": "lower", "cmap": "viridis", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
            image = axes.imshow(left.T, extent=extent, **style)
            axes.set(xlim=y, ylim=z, title=f"{time * _US:.0f} µs", xlabel="y [mm]")
        row[0].set_ylabel(f"layer {layer.number}, z [mm]")
    figure.colorbar(image, ax=panels, label="share of the resistance left")
    return figure


def _edges(cells: NDArray[np.float64]) -> tuple[float, float]:
    half = 0.5 * (cells[1] - cells[0])
    return float((cells[0] - half) * _MM), float((cells[-1] + half) * _MM)


def _touched(layer: LayerField, axis: int) -> tuple[float, float]:
    """Range [mm] that the core weakened, with a margin; the whole window if it weakened nothing."""
    cells = (layer.cell_y, layer.cell_z)[axis]
    low, high = _edges(cells)
    there = cells[(layer.share[-1] < layer.share[0]).any(axis=1 - axis)] * _MM
    return (max(low, there.min() - _ROOM_ABOUT), min(high, there.max() + _ROOM_ABOUT)) if there.size else (low, high)
