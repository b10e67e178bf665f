"""Figures of several designs: a comparison of plates with intervals, and the front of a search."""

import json
import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import Formatter, PercentFormatter, ScalarFormatter
from pandas import DataFrame

from warpimpact.analysis.comparison import Comparison, deciding_measure
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import parsed
from warpimpact.errors import CampaignError
from warpimpact.measures.measure import Measure
from warpimpact.optimisation.design import Constraints
from warpimpact.plotting.plate import draw_plate
from warpimpact.plotting.style import (
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    Figure,
    bars,
    distinct_marks,
    finish,
    furnish,
    in_style,
)
from warpimpact.scene.model import Array

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
    places, across = _impact_places([*comparisons])
    for name, marks in zip(names, distinct_marks(len(names)), strict=True):
        shown = DataFrame([table.reindex([name]).iloc[0] for table in tables], index=places).sort_index()
        style: dict[str, Any] = {"linestyle": "-" if across else "none", "label": name, **marks}
        axes.errorbar(shown.index, shown["value"], yerr=bars(shown["value"], shown["low"], shown["high"]), **style)
    if not across:
        axes.margins(x=0.2)
    axes.set_xticks(places, [*comparisons])
    axes.set_xlabel(across)
    axes.set_ylabel(f"{measure.title}\n{measure.better}")
    axes.yaxis.set_major_formatter(_ticks(measure))
    return finish(figure, title="Plates by impact", legend=True, columns=4)


def _impact_places(impacts: Sequence[str]) -> tuple[list[float], str]:
    """Places of impacts along an axis, and its label: their angles or velocities, else their numbers and no label."""
    for unit, label in (("°", "obliquity"), (" m/s", "impact velocity [m/s]")):
        if all(re.fullmatch(rf"[\d.+e-]+{unit}", impact) for impact in impacts):
            return [float(impact.removesuffix(unit)) for impact in impacts], label
    return [float(place) for place in range(len(impacts))], ""


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
    bounds, variables = _not_on_axes(dataset, confirmed)
    if len(bounds) + len(variables):
        left, right = rows[-1].subfigures(1, 2, width_ratios=(1.7, 1.0))
        _draw_variables(right, dataset, confirmed, bounds, variables)
    else:
        left = rows[-1]
    _draw_front(left.subplots(), dataset, names)
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


class _Axis(NamedTuple):
    """Values along an axis of a front: of all designs, of the front and of the references, with label, limits, and the
    options of a choice."""

    designs: Array
    front: Array
    references: Array
    label: str
    limits: Sequence[float] = ()
    options: Sequence[str] = ()


def _goal_axis(dataset: xarray.Dataset, goal: int) -> _Axis:
    """The axis of an objective or bound, with the limits of bounds and constraints on its quantity."""
    label, name = (str(dataset[key].values[goal]) for key in ("goal_label", "goal"))
    limits = dataset.goal_limit.values
    bounds = limits[(dataset.goal_label.values == label) & np.isfinite(limits)].tolist()
    text = str(dataset.attrs["design_file"])
    constraints = Constraints.model_validate(parsed(text, "the design file").get("constraints", {}))
    ends = [getattr(constraints, f"{end}_{name}", None) for end in ("smallest", "largest")]
    if np.isnan(limits[goal]):
        label += f", {'less' if dataset.goal_sign.values[goal] > 0 else 'more'} is better"
    designs, front, references = (
        dataset[name].values[:, goal] for name in ("result", "front_result", "reference_result")
    )
    return _Axis(designs, front, references, label, [*bounds, *(end for end in ends if end is not None)])


def _front_axes(dataset: xarray.Dataset) -> tuple[_Axis, int]:
    """The axis across, and the number of the goal upwards: two objectives; or of a single one, a bound or else a
    variable across."""
    limits = dataset.goal_limit.values
    goals, bounds = (np.flatnonzero(which).tolist() for which in (np.isnan(limits), np.isfinite(limits)))
    if len(goals) > 1:
        return _goal_axis(dataset, goals[0]), goals[1]
    for bound in bounds:
        if dataset.goal_label.values[bound] != dataset.goal_label.values[goals[0]]:
            return _goal_axis(dataset, bound), goals[0]
    values = dataset.value.values
    variable = int(np.argmax(np.isfinite(values).sum(axis=0)))  # counts in most designs
    of_front = values[dataset.front_design.values.astype(int), variable]
    unknown = np.full(dataset.sizes.get("reference", 0), np.nan)
    options = json.loads(str(dataset.variable_labels.values[variable]) or "[]")
    label = _variable_label(dataset, variable)
    return _Axis(values[:, variable], of_front, unknown, label, options=options), goals[0]


def _draw_front(axes: Axes, dataset: xarray.Dataset, names: dict[int, str]) -> None:
    """Draw the front with limits as lines; fresh hits of a third objective colour the points."""
    x, up = _front_axes(dataset)
    y, labels = _goal_axis(dataset, up), dataset.goal_label.values
    goals = np.flatnonzero(np.isnan(dataset.goal_limit.values))
    axes.plot(x.designs, y.designs, ".", color="0.82", ms=3, zorder=1, label="other designs")
    for draw, limits in ((axes.axvline, x.limits), (axes.axhline, y.limits)):
        for limit in limits:
            draw(limit, color="black", linestyle="--", linewidth=1.2, label=f"bound, {limit:.4g}")
    confirmed, count = dataset.front_confirmed.values == 1, dataset.sizes.get("front", 0)
    of_fresh = np.stack([dataset[f"front_result{end}"].values[:, up] for end in ("", "_low", "_high")])
    groups = ((confirmed, "front, fresh hits, 95 %", BLUE), (~confirmed, "not on the front by fresh hits", "white"))
    for which, label, face in groups:
        if which.any():
            style: dict[str, Any] = {"color": BLUE, "markerfacecolor": face, "markersize": 6, "capsize": 2, "zorder": 4}
            axes.errorbar(x.front[which], y.front[which], yerr=bars(*of_fresh[:, which]), fmt="o", label=label, **style)
    if count:
        links = axes.scatter(x.front, y.front, s=60, alpha=0.01, zorder=7)
        links.set_urls([f"#{file}" for file in dataset.front_file.values])
    if count and len(goals) == 3:
        third = dataset.front_result.values[:, goals[2]]
        drawn = axes.scatter(x.front, y.front, c=third, s=36, zorder=5, cmap="viridis")
        axes.figure.colorbar(drawn, ax=axes, label=str(labels[goals[2]]))
    ends = [dataset[name].values[:, up] for name in ("reference_result_low", "reference_result_high")]
    for name, mark, across, at, low, high in zip(
        dataset.reference.values, 4 * _MARKS, x.references, y.references, *ends, strict=False
    ):
        if np.isnan(across):  # a reference has no value of a variable
            axes.axhline(at, color=VERMILION, linewidth=1.2, label=str(name))
            continue
        point: dict[str, Any] = {"color": VERMILION, "markersize": 11, "zorder": 5}
        axes.errorbar(across, at, yerr=bars(at, low, high), fmt=mark, label=str(name), **point)
    for number, (place, letter) in enumerate(names.items()):
        at, above = (x.front[place], y.front[place]), number % 2 == 0  # neighbours may lie close together
        axes.annotate(letter, at, xytext=(6, 6 if above else -15), textcoords="offset points", weight="bold", zorder=6)
    if x.options:
        axes.set_xticks(range(len(x.options)), x.options)
    furnish(axes, xlabel=x.label, ylabel=fill(y.label, _LONGEST_LABEL))
    axes.spines[["top", "right"]].set_visible(False)


def _not_on_axes(dataset: xarray.Dataset, places: Any) -> tuple[list[int], list[int]]:
    """Bounds, and variables that count somewhere on the front, that stand on no axis of the front."""
    values, labels = dataset.value.values[dataset.front_design.values[places]], dataset.goal_label.values
    x, up = _front_axes(dataset)
    bounds = np.flatnonzero(np.isfinite(dataset.goal_limit.values)).tolist() if len(places) else []
    variables = np.flatnonzero(np.isfinite(values).any(axis=0)).tolist()
    return (
        [bound for bound in bounds if labels[bound] != labels[up] and not x.label.startswith(labels[bound])],
        [place for place in variables if x.label != _variable_label(dataset, place)],
    )


def _variable_label(dataset: xarray.Dataset, place: int) -> str:
    """Name of a variable with its unit."""
    name, unit = str(dataset.variable.values[place]), str(dataset.variable_unit.values[place])
    return f"{name} [{unit}]" if unit else name


def _draw_variables(
    figure: SubFigure, dataset: xarray.Dataset, places: Any, bounds: Sequence[int], shown: Sequence[int]
) -> None:
    """Draw values of some bounds and variables of designs of the front over the first objective."""
    values = dataset.value.values[dataset.front_design.values[places]]
    panels = figure.subplots(len(bounds) + len(shown), 1, sharex=True, squeeze=False)[:, 0]
    over = dataset.front_result.values[places, 0]
    for bound, axes in zip(bounds, panels, strict=False):
        axes.plot(over, dataset.front_result.values[places, bound], "o-", color=BLUE, markersize=4, linewidth=0.8)
        axes.axhline(dataset.goal_limit.values[bound], color="black", linestyle="--", linewidth=1.2)
        axes.set_title(f"{dataset.goal_label.values[bound]}, line: bound", fontsize="small", loc="left", pad=2)
    for place, axes in zip(shown, panels[len(bounds) :], strict=True):
        axes.plot(over, values[:, place], "o-", color=GREEN, markersize=4, linewidth=0.8)
        labels = json.loads(str(dataset.variable_labels.values[place]) or "[]")
        if labels:
            axes.set_yticks(range(len(labels)), labels)
        name = _variable_label(dataset, place).removeprefix("plate.").removeprefix("pattern.")
        axes.set_title(name, fontsize="small", loc="left", pad=2)
    for axes in panels:
        axes.tick_params(labelsize="small")
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel(str(dataset.goal_label.values[0]))
