"""Figure of bursts: what a plate lets through hit by hit, and by the distance to an earlier hit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from matplotlib.figure import Figure

from warpimpact.analysis.bursts import PASSED_ALONE, Bursts, bursts
from warpimpact.plotting.cell import shots_text
from warpimpact.plotting.heading import inscribe
from warpimpact.plotting.style import BLUE, GREY, VERMILION, all_bars, hide_sides
from warpimpact.scene.display import MM

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from warpimpact.analysis.bursts import Group
    from warpimpact.results.measures import Measure


def bursts_figure(dataset: xarray.Dataset) -> Figure:
    """Mean of every measure by the order of the hit (left), and by the distance to the nearest earlier hit (right),
    each with its 95 % interval. A measure that is the same for all groups has no panel."""
    result = bursts(dataset)
    shown = [measure for measure in result.measures if _varies(result, measure)] or [result.measures[0]]
    figure = Figure(figsize=(10.0, 1.3 + 2.9 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 2, squeeze=False, sharex="col", sharey="row", width_ratios=[1.0, 1.9])
    for (left, right), measure in zip(panels, shown, strict=True):
        _draw(left, [float(group.name) for group in result.orders], result.orders, measure)
        _draw_distances(right, result, measure)
        left.set_ylabel(measure.axis)
    panels[0, 1].legend(loc="best", fontsize="small")
    below_left, below_right = panels[-1]
    below_left.set_xlabel("hit of the burst")
    below_left.set_xticks(range(1, len(result.orders) + 1))
    below_left.margins(x=0.1)
    below_right.set_xlabel("distance to the nearest earlier hit [mm]")
    inscribe(figure, dataset, f"{shots_text(dataset)}; 95 % intervals; {PASSED_ALONE}")
    return figure


def _varies(result: Bursts, measure: Measure) -> bool:
    values = [group.estimates[measure].value for group in (*result.orders, *result.distances)]
    return float(np.nanmax(values) - np.nanmin(values)) > 0.0 if np.isfinite(values).any() else False


def _draw(axes: Axes, places: Sequence[float], groups: Sequence[Group], measure: Measure) -> None:
    """Draw the estimates of some groups with their intervals."""
    values, low, high = (np.array([getattr(g.estimates[measure], n) for g in groups]) for n in ("value", "low", "high"))
    style: dict[str, Any] = {"fmt": "o", "color": BLUE, "markersize": 4.5, "capsize": 2.5, "zorder": 3}
    axes.errorbar(places, values, yerr=all_bars(values, low, high), **style)
    axes.grid(color="0.92")
    hide_sides(axes, "top", "right")


def _draw_distances(axes: Axes, result: Bursts, measure: Measure) -> None:
    """Draw the bins of distance, the first hits as a band, and the distance beyond which no difference shows."""
    low, middle, high = np.array([group.distance for group in result.distances]).T * MM
    _draw(axes, list(middle), result.distances, measure)
    values = [group.estimates[measure].value for group in result.distances]
    axes.hlines(values, low, high, color=BLUE, lw=1.0, alpha=0.5)
    first = result.orders[0].estimates[measure]
    axes.axhspan(first.low, first.high, color=VERMILION, alpha=0.25, lw=0.0)
    axes.axhline(first.value, color=VERMILION, lw=1.0, label="first hits")
    within = result.noticed_within(measure) * MM
    if 0.0 < within < math.inf:
        axes.axvline(within, color=GREY, lw=1.0, ls="--", label="differs from first hits up to here")
    axes.set_xlim(left=0.0)
