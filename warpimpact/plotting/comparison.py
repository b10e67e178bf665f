"""Figures of a comparison: measures and differences of plates with intervals, and targets against their weight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine
from pandas import DataFrame

from warpimpact.analysis.comparison import Comparison, hits_used
from warpimpact.analysis.effectiveness import PIERCED
from warpimpact.analysis.numbers import rows_of
from warpimpact.plotting.style import BLUE, GREY, VERMILION, Figure, bars, finish, hide_sides, in_style
from warpimpact.results.measures import Measure

# Markers differ for a print in grey.
_AVERAGE = ("mean, or share", "o", BLUE, -0.12)
_STYLES = {  # by the kind of a measure; the last number is the distance from the line of its plate
    **dict.fromkeys(("mean", "share", "probability", "target"), _AVERAGE),
    "quantile": ("quantile", "v", BLUE, 0.0),
    "worst_tenth": ("worst tenth", "s", VERMILION, 0.12),
    "worst_point": ("worst hit", "x", "#000000", 0.12),
}
_WEIGHED = ("mean", "share", "quantile", "worst_tenth", "worst_point")
"""Kinds of measures that are drawn against the weight."""
_AGAINST_WEIGHT = ("base_perforated", "base_depth", "limit_velocity")
_THICKNESS, _NEEDED = "limit_thickness", "limit_areal_density"
_WIDE = 40
"""Most characters in a line of the weights of a plate."""
_ROW, _MARGIN, _LINE = 0.42, 0.75, 0.15
"""Height of a row, of the margin of a panel, and of a line of the label of a row [inch]."""


@in_style
def comparison_figure(comparison: Comparison, *, every: bool = False) -> Figure:
    """The deciding measure: its value for every plate on the left, and the differences from the best plate on the
    right, with intervals.

    A hollow marker means that the interval of a difference contains 0: the plates cannot be told apart.

    Args:
        every: whether to draw every measure, and the differences of all pairs.
    """
    decides, measures = comparison.deciding(), comparison.measures.values()
    quantities = [list(alike) for _, alike in groupby(measures, key=_quantity)]
    if decides is not None and not every:
        quantities = [alike for alike in quantities if _quantity(alike[0]) == _quantity(decides)]
    shown = [_shown_differences(comparison, alike, every=every or decides is None) for alike in quantities]
    pairs = max((len(table) for tables in shown for table in tables.values()), default=0)
    labels = [f"{plate.Index}\n{fill(plate.weights, _WIDE)}" for plate in rows_of(comparison.plates)]
    label_height = _LINE * (1 + max(label.count("\n") + 1 for label in labels))
    heights = [
        _MARGIN + max(len(labels) * max(row, label_height), pairs * row)
        for row in (_ROW * (1.5 if len(alike) > 1 else 1.0) for alike in quantities)
    ]
    figure = Figure(figsize=(12.0, sum(heights)), layout=ConstrainedLayoutEngine(h_pad=0.12))
    panels = figure.subplots(len(quantities), 2, squeeze=False, height_ratios=heights)
    for alike, tables, (left, right) in zip(quantities, shown, panels, strict=True):
        _draw_plates(left, comparison, alike)
        _furnish(left, labels)
        _draw_differences(right, comparison, alike, tables)
    title = "Plates compared" if decides is None or every else f"Plates by {decides.label}"
    together = f"intervals hold together at {comparison.confidence:.0%}; hollow marker: cannot be told apart"
    finish(figure, together, *hits_used(comparison), title=title, legend=True, columns=4)
    return figure


def _shown_differences(comparison: Comparison, measures: Sequence[Measure], *, every: bool) -> dict[str, DataFrame]:
    """Differences in measures by the label of their line: of all pairs, or from the best plate where plates rank."""
    tables = {}
    for text in (measure.text for measure in measures if comparison.is_ranked(measure.text)):
        table = comparison.differences[text] if every else comparison.from_best(text).reset_index()
        tables[text] = table.set_axis(table.one + " − " + table.other)
    return tables


def _quantity(measure: Measure) -> tuple[str, bool]:
    """Key of the panel of a measure: its quantity, and whether it is a share."""
    return measure.name, measure.is_binary


def _draw_plates(axes: Axes, comparison: Comparison, measures: Sequence[Measure]) -> None:
    """Draw the measures of one quantity, a line per plate."""
    for measure in measures:
        label, marker, colour, offset = _STYLES[measure.kind]
        for line, score in enumerate(rows_of(comparison.scores[measure.text])):
            _draw_interval(axes, line + offset, score, (marker, colour), label=label)
            if measure is measures[0] and not math.isnan(score.solid):
                solid = f"{comparison.reference} of equal weight"
                axes.plot(score.solid, line + offset, "D", color=GREY, fillstyle="none", markersize=10.0, label=solid)
    axes.set_title(f"{measures[0].axis}; {measures[0].better}", fontsize="medium", loc="left")


def _draw_differences(
    axes: Axes, comparison: Comparison, measures: Sequence[Measure], tables: Mapping[str, DataFrame]
) -> None:
    """Draw the differences in one quantity, a line per pair of plates."""
    lines = list(dict.fromkeys(line for table in tables.values() for line in table.index))
    if not lines:
        axes.set_axis_off()
        axes.set_title("not ranked", fontsize="medium", loc="left")
        return
    for text, table in tables.items():
        _, marker, colour, offset = _STYLES[comparison.measures[text].kind]
        for pair in rows_of(table):
            place, hollow = lines.index(pair.Index) + offset, not pair.significant
            _draw_interval(axes, place, pair, (marker, colour), hollow=hollow)
    axes.axvline(0.0, color=GREY, linewidth=1.0)
    _furnish(axes, lines)
    by_ratio = measures[0].text in comparison.by_ratio
    difference = f"difference of the ratios to the {comparison.reference}s;\n" if by_ratio else "difference; "
    better = measures[0].higher_is_better
    side = "neither is" if better is None else f"{'right' if better else 'left'} of 0 the first plate is"
    axes.set_title(f"{difference}{side} better", fontsize="medium", loc="left")


def _draw_interval(
    axes: Axes, line: float, number: Any, style: tuple[str, str], *, label: str | None = None, hollow: bool = False
) -> None:
    """Draw a row of a table with its interval."""
    value, (marker, colour) = number.value, style
    axes.errorbar(
        value,
        line,
        xerr=bars(value, number.low, number.high),
        fmt=marker,
        color=colour,
        markerfacecolor="white" if hollow else colour,
        markersize=6.5,
        capsize=3.0,
        label=label,
        zorder=3,
    )


def _furnish(axes: Axes, lines: Sequence[str]) -> None:
    axes.set_yticks(range(len(lines)), lines, fontsize="small")
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=5)
    axes.ticklabel_format(axis="x", useOffset=False)
    hide_sides(axes, "top", "right", "left")
    axes.tick_params(axis="y", length=0.0)


@in_style
def weight_figure(comparison: Comparison) -> Figure | None:
    """Measures of the base, or limits, against the areal density of the whole target, with their 95 % intervals; None
    if the plates have none of them.

    A limit thickness is drawn at the areal density that the target then has. A hollow diamond is the solid reference of
    the same areal density; a line is the need of a target with it."""
    known = {one.name for one in comparison.measures.values() if one.kind in ("mean", "share", "quantile")}
    wanted = [name for name in (*_AGAINST_WEIGHT, _THICKNESS) if name in known]
    if _NEEDED not in known:
        wanted = [name for name in wanted if name != _THICKNESS]
    if not wanted:
        return None
    figure = Figure(figsize=(1.2 + 5.2 * len(wanted), 5.4), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(wanted), squeeze=False)[0], wanted, strict=True):
        (_draw_needed if name == _THICKNESS else _draw_against_weight)(axes, comparison, _by_kind(comparison, name))
    title = "Targets against their weight, with intervals"
    finish(figure, *_solid_plates(comparison), title=title, legend=True, columns=4)
    return figure


def _solid_plates(comparison: Comparison) -> list[str]:
    """Descriptions of the solid plates, a line for each material."""
    solids = [solid.partition(" mm of ") for solid in comparison.plates.solid if solid]
    thicknesses = {
        material: ", ".join(thickness for thickness, _, of in solids if of == material) for _, _, material in solids
    }
    return [f"{comparison.reference}s: {thickness} mm of {material}" for material, thickness in thicknesses.items()]


def _by_kind(comparison: Comparison, name: str) -> dict[str, Measure]:
    """The measures of a quantity, one of each kind that has a style; the first one is that which ranks."""
    measures = [one for one in comparison.measures.values() if one.name == name and one.kind in _WEIGHED]
    by_kind: dict[str, Measure] = {}
    for measure in measures:
        by_kind.setdefault(measure.kind, measure)
    return by_kind


def _draw_against_weight(axes: Axes, comparison: Comparison, measures: Mapping[str, Measure]) -> None:
    """One effect of every target, over its areal density."""
    densities, (first, *_) = comparison.plates.areal_density.tolist(), measures.values()
    middle, places = 0.5 * (min(densities) + max(densities)), dict[tuple[str, str], list[Any]]()
    for kind, measure in measures.items():
        for density, score in zip(densities, rows_of(comparison.scores[measure.text]), strict=True):
            _draw_point(axes, density, score, _STYLES[kind])
            if measure is first and not math.isnan(score.solid):
                solid: dict[str, Any] = {"color": GREY, "fillstyle": "none", "markersize": 11.0, "linestyle": "none"}
                axes.plot(density, score.solid, "D", label=f"{comparison.reference} of the same weight", **solid)
            if measure is first:  # a figure shows some plates at one place
                places.setdefault((f"{density:.3g}", f"{score.value:.2g}"), [density, score.value]).append(score.Index)
    for density, value, *names in places.values():
        _name(axes, ", ".join(names), (density, value), middle)
    _furnish_weight(axes, first, "areal density of the whole target [kg/m²]")
    if first.name == "base_depth" and PIERCED in comparison.scores and comparison.scores[PIERCED]["value"].max() > 0.0:
        axes.set_title("lower bounds: cores pierce a base, and count with its thickness", fontsize="medium", loc="left")


def _draw_needed(axes: Axes, comparison: Comparison, measures: Mapping[str, Measure]) -> None:
    """Draw the limit thickness over the resulting areal density of the target, and the need of a solid plate."""
    weights, (first, *_) = _by_kind(comparison, _NEEDED), measures.values()
    needed = comparison.scores[weights[first.kind].text]
    middle = 0.5 * float(needed["value"].min() + needed["value"].max())
    for kind in (kind for kind in measures if kind in weights):
        tables = (comparison.scores[weights[kind].text], comparison.scores[measures[kind].text])
        for density, score in zip(*(rows_of(table) for table in tables), strict=True):
            across = None if math.isnan(density.low) else (density.low, density.high)
            _draw_point(axes, density.value, score, _STYLES[kind], across)
            if measures[kind] is first:
                _name(axes, density.Index, (density.value, score.value), middle)
    for solid in needed["solid"].dropna().unique().tolist():
        axes.axvline(solid, color=GREY, linestyle="--", label=f"what the {comparison.reference} needs")
    _furnish_weight(axes, first, "areal density that the target needs [kg/m²]")


def _draw_point(
    axes: Axes,
    density: float,
    measure: Any,
    style: tuple[str, str, str, float],
    across: tuple[float, float] | None = None,
) -> None:
    """Draw a measure over an areal density, with its interval, and the interval of the density where it follows from
    one."""
    label, marker, colour, _ = style
    ends = bars(measure.value, measure.low, measure.high)
    horizontal = None if across is None else bars(density, *across)
    point: dict[str, Any] = {"color": colour, "markersize": 6.5, "capsize": 3.0, "zorder": 3}
    axes.errorbar(density, measure.value, yerr=ends, xerr=horizontal, fmt=marker, label=label, **point)


def _name(axes: Axes, name: str, place: tuple[float, float], middle: float) -> None:
    """The name of a target beside its point, towards the middle of the figure."""
    left = place[0] <= middle
    side, ha = (7, "left") if left else (-7, "right")
    axes.annotate(name, place, xytext=(side, 6), textcoords="offset points", ha=ha, fontsize="small")


def _furnish_weight(axes: Axes, measure: Measure, label: str) -> None:
    axes.set(xlabel=label, ylabel=measure.axis)
    axes.set_title(measure.better, fontsize="medium", loc="left")
    if measure.most == 1.0:
        axes.set_ylim(-0.04, 1.04)
    axes.grid(color="0.92")
    axes.margins(x=0.18)
    axes.ticklabel_format(axis="both", useOffset=False)
    hide_sides(axes, "top", "right")
