"""Figures of several designs: a comparison of plates with intervals, and the front of a search."""

import json
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import Formatter, PercentFormatter, ScalarFormatter
from pandas import DataFrame

from warpimpact.analysis.comparison import Comparison, deciding_measure
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.plotting.plate import draw_plate
from warpimpact.plotting.style import BLUE, GREEN, GREY, VERMILION, Figure, bars, finish, furnish, in_style
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
MOST_DRAWN = 6
"""Most plates that are drawn."""
_LONGEST_LABEL = 60
"""Most characters of a line that stands upright beside the axes."""
THUMBNAIL = 30.0
"""Side of the drawn part of a plate [mm]."""
_LETTERS = "ABCDEFGHIJ"
_MARKS: tuple[Any, ...] = ("*", "P", "X", "^", "v")


@in_style
def comparison_figure(comparison: Comparison, *, every: bool = False) -> Figure:
    """The deciding measure: its value for every plate on the left, and the differences from the best plate on the
    right, with intervals.

    A hollow marker means that the interval of a difference contains 0: it is not significant.

    Args:
        every: whether to draw every measure, and the differences of all pairs.
    """
    decides, measures = deciding_measure(comparison), comparison.measures.values()
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
        _furnish(left, labels, alike[0])
        _draw_differences(right, comparison, alike[0], tables)
    title = "Plates compared" if decides is None or every else f"Plates by {decides.label}"
    together = f"intervals hold together at {comparison.confidence:.0%}; hollow marker: no significant difference"
    return finish(figure, together, *comparison.hits_used, title=title, legend=True, columns=4)


@in_style
def impact_figure(comparisons: Mapping[str, Comparison], *, every: bool = False) -> Figure:
    """The deciding measure of every plate, with intervals, against the impacts; of one impact `comparison_figure`."""
    if len(comparisons) == 1:
        return comparison_figure(*comparisons.values(), every=every)
    figure, measure = Figure(figsize=(8.0, 4.5), layout="constrained"), deciding_measure(*comparisons.values())
    if measure is None:
        return finish(figure, title="No measure ranks these plates under every impact")
    axes, tables = figure.subplots(), [comparison.scores[measure.text] for comparison in comparisons.values()]
    names = list(dict.fromkeys(name for table in tables for name in table.index))
    for place, name in enumerate(names):
        shown = DataFrame({k: table.loc[name] for k, table in enumerate(tables) if name in table.index}).T
        offset, ends = 0.1 * (place - 0.5 * (len(names) - 1)), bars(shown["value"], shown["low"], shown["high"])
        axes.errorbar(shown.index + offset, shown["value"], yerr=ends, fmt="o-", capsize=3.0, label=name)
    axes.set_xticks(range(len(comparisons)), [*comparisons])
    axes.set_ylabel(f"{measure.title}\n{measure.better}")
    axes.yaxis.set_major_formatter(_ticks(measure))
    return finish(figure, title="Plates by impact", legend=True, columns=4)


def _shown_differences(comparison: Comparison, measures: Sequence[Measure], *, every: bool) -> dict[str, DataFrame]:
    """Differences in measures by the label of their line: of all pairs, or from the best plate where plates rank."""
    ranked, every_pair = [one.text for one in measures if comparison.is_ranked(one.text)], comparison.differences
    tables = {text: every_pair[text] if every else comparison.from_best(text).reset_index() for text in ranked}
    return {text: table.set_axis(table.one + " − " + table.other) for text, table in tables.items()}


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
    axes.set_title(f"{measures[0].column.title}; {measures[0].better}", fontsize="medium", loc="left")


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
    _furnish(axes, lines, measure)
    better = measure.higher_is_better
    side = "neither is" if better is None else f"{'right' if better else 'left'} of 0 the first plate is"
    axes.set_title(f"difference; {side} better", fontsize="medium", loc="left")


def _draw_intervals(axes: Axes, table: DataFrame, lines: Any, kind: str, **style: Any) -> None:
    """Draw the rows of a table with their intervals, each on its line."""
    _, marker, colour, offset = _STYLES[kind]
    drawn: dict[str, Any] = {"fmt": marker, "color": colour, "markersize": 6.5, "capsize": 3.0, "zorder": 3} | style
    axes.errorbar(table["value"], lines + offset, xerr=bars(table["value"], table["low"], table["high"]), **drawn)


def _ticks(measure: Measure) -> Formatter:
    return PercentFormatter(1.0) if measure.display.stored == "1" else ScalarFormatter(useOffset=False)


def _furnish(axes: Axes, lines: Sequence[str], measure: Measure) -> None:
    axes.set_yticks(range(len(lines)), lines, fontsize="small")
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=5)
    axes.xaxis.set_major_formatter(_ticks(measure))
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0.0)


@in_style
def front_figure(dataset: xarray.Dataset, folder: Path = Path()) -> Figure:
    """The front of a search by fresh hits with 95 % intervals, beside all computed designs; plates along it; and their
    variables. `folder` has the files that the design file names. In an SVG, a point of the front links to its file."""
    confirmed = np.flatnonzero(dataset.front_confirmed.values)
    places = np.linspace(0, len(confirmed) - 1, min(MOST_DRAWN, len(confirmed)))
    drawn = confirmed[np.round(places).astype(int)]
    names = {int(place): _LETTERS[number] for number, place in enumerate(drawn)}
    figure = Figure(figsize=(12.0, 8.0 if names else 5.6), layout="constrained")
    rows = figure.subfigures(2 if names else 1, 1, height_ratios=(1.0, 2.4) if names else None, squeeze=False)[:, 0]
    if names:
        _draw_designs(rows[0], dataset, names, folder)
    left, right = rows[-1].subfigures(1, 2, width_ratios=(1.7, 1.0))
    _draw_front(left.subplots(), dataset, names)
    _draw_variables(right, dataset, confirmed)
    return finish(figure, f"of each plate {THUMBNAIL:g} mm × {THUMBNAIL:g} mm" if names else "", result=dataset)


def _draw_designs(figure: SubFigure, dataset: xarray.Dataset, names: dict[int, str], folder: Path) -> None:
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for axes, (place, letter) in zip(panels, names.items(), strict=True):
        campaign = campaign_at(dataset, place, folder)
        axes.set(xticks=[], yticks=[])
        if campaign is None:
            axes.set_axis_off()
            continue
        plate = campaign.plate
        draw_plate(axes, plate, (THUMBNAIL / 2, THUMBNAIL / 2))
        axes.set_title(f"{letter}: {1e3 * plate.thickness:.3g} mm, {plate.open_area:.0%} open", fontsize="medium")


def campaign_at(dataset: xarray.Dataset, place: int, folder: Path) -> Campaign | None:
    """The campaign of a design of the front; None if a file that it names is gone."""
    try:
        return Campaign.from_text(str(dataset.front_campaign.values[place]), name="front", folder=folder)
    except CampaignError:
        return None


def _draw_front(axes: Axes, dataset: xarray.Dataset, names: dict[int, str]) -> None:
    """Draw the second objective over the first; fresh hits of a third one colour the points."""
    labels, signs = dataset.goal_label.values, dataset.goal_sign.values
    goals = np.flatnonzero(np.isnan(dataset.goal_limit.values))
    across, up = goals[0], goals[min(1, len(goals) - 1)]
    axes.plot(*dataset.result.values[:, [across, up]].T, ".", color="0.82", ms=3, zorder=1, label="other designs")
    confirmed, fresh = dataset.front_confirmed.values == 1, dataset.front_result.values
    of_fresh = np.stack([dataset[f"front_result{end}"].values[:, up] for end in ("", "_low", "_high")])
    groups = ((confirmed, "front, fresh hits, 95 %", BLUE), (~confirmed, "not on the front by fresh hits", "white"))
    for which, label, face in groups:
        if which.any():
            style: dict[str, Any] = {"color": BLUE, "markerfacecolor": face, "markersize": 6, "capsize": 2, "zorder": 4}
            ends = bars(*of_fresh[:, which])
            axes.errorbar(fresh[which, across], fresh[which, up], yerr=ends, fmt="o", label=label, **style)
    if len(fresh):
        links = axes.scatter(fresh[:, across], fresh[:, up], s=60, alpha=0.01, zorder=7)
        links.set_urls([f"#{file}" for file in dataset.front_file.values])
    if len(fresh) and len(goals) == 3:
        drawn = axes.scatter(fresh[:, across], fresh[:, up], c=fresh[:, goals[2]], s=36, zorder=5, cmap="viridis")
        axes.figure.colorbar(drawn, ax=axes, label=str(labels[goals[2]]))
    of_references = [
        dataset[name].values for name in ("reference_result", "reference_result_low", "reference_result_high")
    ]
    for name, mark, at, low, high in zip(dataset.reference.values, 4 * _MARKS, *of_references, strict=False):
        point: dict[str, Any] = {"color": VERMILION, "markersize": 11, "zorder": 5}
        axes.errorbar(at[across], at[up], yerr=bars(at[up], low[up], high[up]), fmt=mark, label=str(name), **point)
    for number, (place, letter) in enumerate(names.items()):
        at, above = (fresh[place, across], fresh[place, up]), number % 2 == 0  # neighbours may lie close together
        axes.annotate(letter, at, xytext=(6, 6 if above else -15), textcoords="offset points", weight="bold", zorder=6)
    titles = [f"{labels[goal]}, {'less' if signs[goal] > 0 else 'more'} is better" for goal in (across, up)]
    furnish(axes, xlabel=titles[0], ylabel=fill(titles[1], _LONGEST_LABEL))
    axes.spines[["top", "right"]].set_visible(False)


def _draw_variables(figure: SubFigure, dataset: xarray.Dataset, places: Any) -> None:
    """Values over the first objective of the variables that count somewhere on the front."""
    names, values = dataset.variable.values, dataset.value.values[dataset.front_design.values[places]]
    shown = np.flatnonzero(np.isfinite(values).any(axis=0))
    if not len(shown):
        return
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    over = dataset.front_result.values[places, 0]
    for place, axes in zip(shown, panels, strict=True):
        axes.plot(over, values[:, place], "o-", color=GREEN, markersize=4, linewidth=0.8)
        labels, unit = (
            json.loads(str(dataset.variable_labels.values[place]) or "[]"),
            str(dataset.variable_unit.values[place]),
        )
        if labels:
            axes.set_yticks(range(len(labels)), labels)
        name = str(names[place]).removeprefix("plate.").removeprefix("pattern.")
        axes.set_title(f"{name} [{unit}]" if unit else name, fontsize="small", loc="left", pad=2)
        axes.tick_params(labelsize="small")
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel(str(dataset.goal_label.values[0]))
