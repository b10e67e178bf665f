"""Figure of a comparison: measures and differences of plates with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine
from pandas import DataFrame

from warpimpact.analysis.comparison import Comparison
from warpimpact.analysis.plates_by_impact import deciding_measure
from warpimpact.plotting.style import BLUE, GREY, VERMILION, Figure, bars, finish, hide_sides, in_style
from warpimpact.results.measures import Measure

_STYLES = {
    **dict.fromkeys(("mean", "share", "probability", "target"), ("mean, or share", "o", BLUE, -0.12)),
    "quantile": ("quantile", "v", BLUE, 0.0),
    "worst_tenth": ("worst tenth", "s", VERMILION, 0.12),
    "worst_point": ("worst hit", "x", "#000000", 0.12),
}
"""Label, marker, colour, and distance from the line of a plate, by the kind of a measure."""
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
    every = every or decides is None
    quantities = [list(alike) for _, alike in groupby(measures, key=_quantity)]
    if decides is not None and not every:
        quantities = [alike for alike in quantities if _quantity(alike[0]) == _quantity(decides)]
    shown = [_shown_differences(comparison, alike, every=every) for alike in quantities]
    pairs = max((len(table) for tables in shown for table in tables.values()), default=0)
    labels = [f"{name}\n{fill(weights, _WIDE)}" for name, weights in comparison.plates["weights"].items()]
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
        _draw_differences(right, comparison, alike[0], tables)
    title = "Plates compared" if decides is None or every else f"Plates by {decides.label}"
    together = f"intervals hold together at {comparison.confidence:.0%}; hollow marker: cannot be told apart"
    return finish(figure, together, *comparison.hits_used, title=title, legend=True, columns=4)


@in_style
def impact_figure(comparisons: Mapping[str, Comparison]) -> Figure:
    """The deciding measure of every plate, with intervals, against the impacts."""
    figure, measure = Figure(figsize=(8.0, 4.5), layout="constrained"), deciding_measure(comparisons)
    if measure is None:
        return finish(figure, title="No measure ranks these plates under every impact")
    axes, tables = figure.subplots(), [comparison.scores[measure.text] for comparison in comparisons.values()]
    names = list(dict.fromkeys(name for table in tables for name in table.index))
    for place, name in enumerate(names):
        shown = DataFrame({k: table.loc[name] for k, table in enumerate(tables) if name in table.index}).T
        aside, ends = 0.1 * (place - 0.5 * (len(names) - 1)), bars(shown["value"], shown["low"], shown["high"])
        axes.errorbar(shown.index + aside, shown["value"], yerr=ends, fmt="o-", capsize=3.0, label=name)
    axes.set_xticks(range(len(comparisons)), [*comparisons])
    axes.set_ylabel(f"{measure.title}\n{measure.better}")
    return finish(figure, title="Plates by impact", legend=True, columns=4)


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
    """Draw the measures of one quantity, a line per plate, and the solid references as hollow diamonds."""
    lines = np.arange(len(comparison.plates))
    for measure in measures:
        _draw_intervals(axes, comparison.scores[measure.text], lines, measure.kind, label=_STYLES[measure.kind][0])
    solid = comparison.scores[measures[0].text]["solid"].to_numpy()
    if (there := np.isfinite(solid)).any():
        places, label = lines[there] + _STYLES[measures[0].kind][3], "solid, same weight"
        axes.plot(solid[there], places, "D", label=label, color=GREY, fillstyle="none", markersize=10.0)
    axes.set_title(f"{measures[0].axis}; {measures[0].better}", fontsize="medium", loc="left")


def _draw_differences(axes: Axes, comparison: Comparison, measure: Measure, tables: Mapping[str, DataFrame]) -> None:
    """Draw the differences in one quantity, a line per pair of plates."""
    lines = list(dict.fromkeys(line for table in tables.values() for line in table.index))
    if not lines:
        axes.set_axis_off()
        axes.set_title("not ranked", fontsize="medium", loc="left")
        return
    for text, table in tables.items():
        for significant, part in table.groupby("significant"):
            style = {} if significant else {"markerfacecolor": "white"}
            places = np.array([lines.index(line) for line in part.index])
            _draw_intervals(axes, part, places, comparison.measures[text].kind, **style)
    axes.axvline(0.0, color=GREY, linewidth=1.0)
    _furnish(axes, lines)
    better = measure.higher_is_better
    side = "neither is" if better is None else f"{'right' if better else 'left'} of 0 the first plate is"
    axes.set_title(f"difference; {side} better", fontsize="medium", loc="left")


def _draw_intervals(axes: Axes, table: DataFrame, lines: Any, kind: str, **style: Any) -> None:
    """Draw the rows of a table with their intervals, each on its line."""
    _, marker, colour, offset = _STYLES[kind]
    drawn: dict[str, Any] = {"fmt": marker, "color": colour, "markersize": 6.5, "capsize": 3.0, "zorder": 3} | style
    axes.errorbar(table["value"], lines + offset, xerr=bars(table["value"], table["low"], table["high"]), **drawn)


def _furnish(axes: Axes, lines: Sequence[str]) -> None:
    axes.set_yticks(range(len(lines)), lines, fontsize="small")
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=5)
    axes.ticklabel_format(axis="x", useOffset=False)
    hide_sides(axes, "top", "right", "left")
    axes.tick_params(axis="y", length=0.0)
