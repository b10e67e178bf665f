"""Figure of limits: their map, and the share of the hits that perforate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpimpact.analysis.estimates import estimated
from warpimpact.analysis.hit_map import hit_points
from warpimpact.analysis.plate_text import reference_name
from warpimpact.analysis.proxy import inclination
from warpimpact.plotting.cell import draw_values, map_size, scale_of, shown
from warpimpact.plotting.style import BLUE, GREY, VERMILION, inscribe
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.references import reference
from warpimpact.studies.limit_view import measures_of, promise_line, shown_unit

_CURVE = {
    "velocity": ("impact velocity", "share of the hits that perforate"),
    "thickness": ("thickness of {}", "share of the hits whose limit is thinner"),
}
_LOW_SHARE = 0.15
"""Largest share whose name stands above its point."""


def limit_figure(dataset: xarray.Dataset) -> Figure:
    """The map of the limits beside their cumulative distribution, with V50 and V05 and their 95 % intervals. For hits
    at one place, the limits against the obliquity."""
    quantity = dataset.attrs[attr.LIMIT]
    if len(dataset[v.OBLIQUITY]) > 1 and not np.ptp(hit_points(dataset), axis=0).any():
        return _over_obliquity(dataset, quantity)
    column = shown(dataset, v.LIMITS[quantity].value)
    values = np.where(np.isinf(column.values), np.nan, column.values)
    width, height = map_size(dataset)
    figure = Figure(figsize=(width + 7.6, max(height + 2.2, 5.2)), layout="constrained")
    at, curve = figure.subplots(1, 2, width_ratios=[width + 1.4, 5.2])
    artist = draw_values(at, dataset, values, scale_of([values], signed=False))
    figure.colorbar(artist, ax=at, label=column.label)
    _draw_curve(curve, dataset, quantity)
    inscribe(figure, dataset, f"{dataset.sizes['hit']} hits, {promise_line(dataset)}")
    return figure


def _over_obliquity(dataset: xarray.Dataset, quantity: str) -> Figure:
    """Draw the limits of hits at one place against the obliquity, beside the secant law through the least oblique hit.
    If all hits have one obliquity, draw them against the inclination of the core."""
    unit, factor = shown_unit(quantity)
    figure = Figure(figsize=(7.4, 5.2), layout="constrained")
    axes = figure.subplots()
    value, obliquity = dataset[v.LIMITS[quantity].value].values, dataset[v.OBLIQUITY].values
    yawed = np.ptp(obliquity) == 0.0
    along = np.degrees(inclination(dataset)) if yawed else obliquity
    axes.plot(along, factor * value, "o", color=BLUE, label=f"limit {quantity}")
    first = int(np.argmin(obliquity))
    if np.ptp(obliquity) > 0.0 and np.isfinite(value[first]):
        angles = np.linspace(obliquity.min(), obliquity.max())
        growth = np.cos(np.radians(obliquity[first])) / np.cos(np.radians(angles))
        law = growth if quantity == "velocity" else 1.0 / growth
        label = "as 1/cos(obliquity)" if quantity == "velocity" else "as cos(obliquity)"
        axes.plot(angles, factor * value[first] * law, color="0.5", linewidth=1.0, label=label)
    across = "between axis and line of fire on impact" if yawed else "obliquity"
    if (of_solid := reference(dataset, "solid")) is not None:
        solid = np.broadcast_to(of_solid[v.LIMITS[quantity].value].values, value.shape)
        axes.plot(along, factor * solid, "D", color=GREY, fillstyle="none", label=_solid_label(dataset, quantity))
    axes.set(xlabel=f"{across} [°]", ylabel=f"limit {quantity} [{unit}]")
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.legend(frameon=False)
    inscribe(figure, dataset, f"{dataset.sizes['hit']} hits, {promise_line(dataset)}")
    return figure


def _solid_label(dataset: xarray.Dataset, quantity: str) -> str:
    """Label of the solid reference."""
    solid = reference(dataset, "solid")
    several = ", mean" if solid is not None and solid.sizes["hit"] > 1 and quantity == "velocity" else ""
    if quantity == "velocity":
        return f"{reference_name(dataset)} of equal areal density{several}"
    return "with the solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"


def _draw_upright(axes: Axes, at: float, **style: Any) -> None:
    """Draw a vertical line, and widen the axes to it."""
    axes.axvline(at, linewidth=1.2, **style)
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, at - 0.03 * (high - low)), max(high, at + 0.03 * (high - low)))


def _mark_measures(axes: Axes, dataset: xarray.Dataset, factor: float, unit: str) -> None:
    """Draw the measures with their intervals on the curve, their names above it or, where there is no room, below."""
    low, high = axes.get_xlim()
    for measure, estimate in estimated(dataset, measures_of(dataset)).items():
        level, value = measure.share, factor * estimate.value
        if not np.isfinite(value):
            continue
        ends = factor * np.array([estimate.low, estimate.high])
        axes.plot(ends, [level, level], color=VERMILION, linewidth=4, alpha=0.4, solid_capstyle="butt")
        axes.plot(value, level, "o", color=VERMILION, markersize=5)
        in_left_half = value < 0.5 * (low + high)
        beside = (8, -12) if in_left_half and level > _LOW_SHARE else (8, 5) if in_left_half else (-8, 5)
        style: dict[str, Any] = {"xytext": beside, "textcoords": "offset points"}
        axes.annotate(
            f"{measure.text} = {value:.4g} {unit}", (value, level), ha="left" if in_left_half else "right", **style
        )


def _draw_curve(axes: Axes, dataset: xarray.Dataset, quantity: str) -> None:
    """Draw the cumulative share of the limits. Limits beyond the largest value tried keep it below 1."""
    unit, factor = shown_unit(quantity)
    limits_found = dataset[v.LIMITS[quantity].value].values
    limits_found = np.sort(limits_found[~np.isnan(limits_found)])
    share = np.arange(1, len(limits_found) + 1) / len(limits_found)
    finite = np.isfinite(limits_found)
    if finite.any():
        margin = 0.05 * max(np.ptp(limits_found[finite]), 0.02 * limits_found[finite].max())
        ends = limits_found[finite][0] - margin, limits_found[finite][-1] + margin
        steps = [ends[0], *limits_found[finite], ends[1]], [0.0, *share[finite], share[finite][-1]]
        axes.step(factor * np.array(steps[0]), steps[1], where="post", color=BLUE, linewidth=1.5)
        axes.set_xlim(*(factor * np.array(ends)))
    for name, label, style in (
        ("solid", _solid_label(dataset, quantity), "--"),
        ("base_alone", "base alone", "-."),
    ):
        known = reference(dataset, name)
        mean = math.nan if known is None else factor * float(np.nanmean(known[v.LIMITS[quantity].value].values))
        if np.isfinite(mean):
            _draw_upright(axes, mean, color=GREY, linestyle=style, label=label)
    _mark_measures(axes, dataset, factor, unit)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", fontsize="small", framealpha=1.0, edgecolor="none")
    layer = int(dataset.attrs[attr.LIMIT_LAYER])
    whose, share_label = _CURVE[quantity]
    label = whose.format(f"layer {layer}" if layer else "the plate")
    axes.set(xlabel=f"{label} [{unit}]", ylabel=share_label, ylim=(0.0, 1.02))
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
