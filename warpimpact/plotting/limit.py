"""Figure of limits: their map, and the share of the hits that perforate."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from warpimpact.analysis.effectiveness import reference_name
from warpimpact.analysis.estimates import estimated
from warpimpact.analysis.hit_map import hit_points
from warpimpact.plotting.cell import draw_map, map_size, shown, to_scale
from warpimpact.plotting.style import BLUE, GREY, VERMILION, Figure, finish, in_style
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.references import reference
from warpimpact.studies.limit_view import inclination, measures_of, promise_line, shown_unit

_CURVE = {
    "velocity": ("impact velocity", "share of the hits that perforate"),
    "thickness": ("thickness of {}", "share of the hits whose limit is thinner"),
}
_LOW_SHARE = 0.15
"""Largest share whose name stands above its point."""


@in_style
def limit_figure(dataset: xarray.Dataset) -> Figure:
    """The map of the limits beside their cumulative distribution, with V50 and V05 and their 95 % intervals. For hits
    at one place, the limits against the obliquity."""
    if len(dataset[v.OBLIQUITY]) > 1 and not np.ptp(hit_points(dataset), axis=0).any():
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        _draw_over_obliquity(figure.subplots(), dataset)
    else:
        column = shown(dataset, v.LIMITS[dataset.attrs[attr.LIMIT]].value)
        column = column._replace(values=np.where(np.isinf(column.values), np.nan, column.values), title="")
        width, height = map_size(dataset)
        figure = Figure(figsize=(width + 7.6, max(height + 1.2, 4.4)), layout="constrained")
        at, curve = figure.subplots(1, 2, width_ratios=[width + 1.4, 5.2])
        to_scale(at, dataset)
        figure.colorbar(draw_map(at, dataset, column), ax=at, label=column.label)
        _draw_curve(curve, dataset)
    finish(figure, f"{dataset.sizes['hit']} hits, {promise_line(dataset)}", result=dataset)
    return figure


def _draw_over_obliquity(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw the limits of hits at one place against the obliquity, beside the secant law through the least oblique hit.
    If all hits have one obliquity, draw them against the inclination of the core."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value, obliquity = dataset[v.LIMITS[quantity].value].values, dataset[v.OBLIQUITY].values
    yawed = np.ptp(obliquity) == 0.0
    along = np.degrees(inclination(dataset)) if yawed else obliquity
    axes.plot(along, factor * value, "o", color=BLUE, label=f"limit {quantity}")
    first = int(np.argmin(obliquity))
    if not yawed and np.isfinite(value[first]):
        angles = np.linspace(obliquity.min(), obliquity.max())
        growth = np.cos(np.radians(obliquity[first])) / np.cos(np.radians(angles))
        law, label = (growth, "as 1/cos") if quantity == "velocity" else (1.0 / growth, "as cos")
        axes.plot(angles, factor * value[first] * law, color="0.5", linewidth=1.0, label=f"{label}(obliquity)")
    if (of_solid := reference(dataset, "solid")) is not None:
        solid = np.broadcast_to(of_solid[v.LIMITS[quantity].value].values, value.shape)
        axes.plot(along, factor * solid, "D", color=GREY, fillstyle="none", label=_solid_label(dataset))
    across = "between axis and line of fire on impact" if yawed else "obliquity"
    _furnish(axes, xlabel=f"{across} [°]", ylabel=f"limit {quantity} [{unit}]")


def _furnish(axes: Axes, **labels: Any) -> None:
    axes.set(**labels)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize="small", framealpha=1.0, edgecolor="none")


def _solid_label(dataset: xarray.Dataset) -> str:
    """Label of the solid reference."""
    if dataset.attrs[attr.LIMIT] == "thickness":
        return "with the solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"
    solid = reference(dataset, "solid")
    several = ", mean" if solid is not None and solid.sizes["hit"] > 1 else ""
    return f"{reference_name(dataset)} of equal areal density{several}"


def _draw_curve(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw the cumulative share of the limits, with the references and measures. Limits beyond the largest value tried
    keep it below 1."""
    quantity, layer = dataset.attrs[attr.LIMIT], int(dataset.attrs[attr.LIMIT_LAYER])
    unit, factor = shown_unit(quantity)
    values = dataset[v.LIMITS[quantity].value].values
    values = factor * np.sort(values[~np.isnan(values)])
    finite = values[np.isfinite(values)]
    if len(finite):
        margin = 0.05 * max(np.ptp(finite), 0.02 * finite.max())
        share = np.arange(len(finite) + 1) / len(values)
        ends = finite[0] - margin, finite[-1] + margin
        axes.step([ends[0], *finite, ends[1]], [*share, share[-1]], where="post", color=BLUE, linewidth=1.5)
        axes.set_xlim(ends)
    for name, label, style in (("solid", _solid_label(dataset), "--"), ("base_alone", "base alone", "-.")):
        known = reference(dataset, name)
        mean = np.nan if known is None else factor * float(np.nanmean(known[v.LIMITS[quantity].value].values))
        if np.isfinite(mean):
            axes.axvline(mean, linewidth=1.2, color=GREY, linestyle=style, label=label)
            low, high = axes.get_xlim()
            axes.set_xlim(min(low, mean - 0.03 * (high - low)), max(high, mean + 0.03 * (high - low)))
    _mark_measures(axes, dataset, unit)
    whose, share_label = _CURVE[quantity]
    whose = whose.format(f"layer {layer}" if layer else "the plate")
    _furnish(axes, xlabel=f"{whose} [{unit}]", ylabel=share_label, ylim=(0.0, 1.02))


def _mark_measures(axes: Axes, dataset: xarray.Dataset, unit: str) -> None:
    """Draw the measures with their intervals on the curve, their names above it or, where there is no room, below."""
    middle = 0.5 * sum(axes.get_xlim())
    for measure, estimate in estimated(dataset, measures_of(dataset)).items():
        level, value, ends = measure.share, estimate.value, [estimate.low, estimate.high]
        if not np.isfinite(value):
            continue
        axes.plot(ends, [level, level], color=VERMILION, linewidth=4, alpha=0.4, solid_capstyle="butt")
        axes.plot(value, level, "o", color=VERMILION, markersize=5)
        on_right = value < middle
        place: dict[str, Any] = {
            "xytext": (8 if on_right else -8, -12 if on_right and level > _LOW_SHARE else 5),
            "textcoords": "offset points",
            "ha": "left" if on_right else "right",
        }
        axes.annotate(f"{measure.text} = {value:.4g} {unit}", (value, level), **place)
