"""Figure of a search for designs: the front with its plates, references, and variables along it."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.plotting.plate import draw_plate
from warpimpact.plotting.style import BLUE, GREEN, VERMILION, Figure, bars, finish, furnish, hide_sides, in_style
from warpimpact.results import front as f

MOST_DRAWN = 6
"""Most plates that are drawn."""
_LONGEST_LABEL = 60
"""Most characters of a line that stands upright beside the axes."""
THUMBNAIL = 30.0
"""Side of the drawn part of a plate [mm]."""
_LETTERS = "ABCDEFGHIJ"
_MARKS: tuple[Any, ...] = ("*", "P", "X", "^", "v")


@in_style
def front_figure(dataset: xarray.Dataset, folder: Path = Path()) -> Figure:
    """The front of a search by fresh hits with 95 % intervals, beside all computed designs; plates along it; and their
    variables. `folder` has the files that the design file names. In an SVG, a point of the front links to its file."""
    confirmed = np.flatnonzero(dataset[f.CONFIRMED].values)
    places = np.linspace(0, len(confirmed) - 1, min(MOST_DRAWN, len(confirmed)))
    drawn = confirmed[np.round(places).astype(int)]
    names = {int(place): _LETTERS[number] for number, place in enumerate(drawn)}
    figure = Figure(figsize=(12.0, 8.0 if names else 5.6), layout="constrained")
    rows = figure.subfigures(2 if names else 1, 1, height_ratios=(1.0, 2.4) if names else None, squeeze=False)[:, 0]
    if names:
        _draw_plates(rows[0], dataset, names, folder)
    left, right = rows[-1].subfigures(1, 2, width_ratios=(1.7, 1.0))
    _draw_front(left.subplots(), dataset, names)
    _draw_variables(right, dataset, confirmed)
    return finish(figure, f"of each plate {THUMBNAIL:g} mm × {THUMBNAIL:g} mm" if names else "", result=dataset)


def _draw_plates(figure: SubFigure, dataset: xarray.Dataset, names: dict[int, str], folder: Path) -> None:
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
        return Campaign.from_text(str(dataset[f.CAMPAIGN].values[place]), name="front", folder=folder)
    except CampaignError:
        return None


def _draw_front(axes: Axes, dataset: xarray.Dataset, names: dict[int, str]) -> None:
    """Draw the second objective over the first; fresh hits of a third one colour the points."""
    labels, signs = dataset[f.GOAL_LABEL].values, dataset[f.GOAL_SIGN].values
    goals = np.flatnonzero(np.isnan(dataset[f.GOAL_LIMIT].values))
    across, up = goals[0], goals[min(1, len(goals) - 1)]
    axes.plot(*dataset[f.RESULT].values[:, [across, up]].T, ".", color="0.82", ms=3, zorder=1, label="other designs")
    confirmed, fresh = dataset[f.CONFIRMED].values == 1, dataset[f.FRESH].values
    of_fresh = np.stack([dataset[name].values[:, up] for name in (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)])
    groups = ((confirmed, "front, fresh hits, 95 %", BLUE), (~confirmed, "not on the front by fresh hits", "white"))
    for which, label, face in groups:
        if which.any():
            style: dict[str, Any] = {"color": BLUE, "markerfacecolor": face, "markersize": 6, "capsize": 2, "zorder": 4}
            ends = bars(*of_fresh[:, which])
            axes.errorbar(fresh[which, across], fresh[which, up], yerr=ends, fmt="o", label=label, **style)
    if len(fresh):
        links = axes.scatter(fresh[:, across], fresh[:, up], s=60, alpha=0.01, zorder=7)
        links.set_urls([f"#{file}" for file in dataset[f.FILE].values])
    if len(fresh) and len(goals) == 3:
        drawn = axes.scatter(fresh[:, across], fresh[:, up], c=fresh[:, goals[2]], s=36, zorder=5, cmap="viridis")
        axes.figure.colorbar(drawn, ax=axes, label=str(labels[goals[2]]))
    of_references = [dataset[name].values for name in (f.REFERENCE_RESULT, f.REFERENCE_LOW, f.REFERENCE_HIGH)]
    for name, mark, at, low, high in zip(dataset[f.REFERENCE].values, 4 * _MARKS, *of_references, strict=False):
        point: dict[str, Any] = {"color": VERMILION, "markersize": 11, "zorder": 5}
        axes.errorbar(at[across], at[up], yerr=bars(at[up], low[up], high[up]), fmt=mark, label=str(name), **point)
    for number, (place, letter) in enumerate(names.items()):
        at, above = (fresh[place, across], fresh[place, up]), number % 2 == 0  # neighbours may lie close together
        axes.annotate(letter, at, xytext=(6, 6 if above else -15), textcoords="offset points", weight="bold", zorder=6)
    titles = [f"{labels[goal]}, {'less' if signs[goal] > 0 else 'more'} is better" for goal in (across, up)]
    furnish(axes, xlabel=titles[0], ylabel=fill(titles[1], _LONGEST_LABEL))
    hide_sides(axes, "top", "right")


def _draw_variables(figure: SubFigure, dataset: xarray.Dataset, places: Any) -> None:
    """Values over the first objective of the variables that count somewhere on the front."""
    names, values = dataset[f.NAME].values, dataset[f.VALUE].values[dataset[f.NUMBER].values[places]]
    shown = np.flatnonzero(np.isfinite(values).any(axis=0))
    if not len(shown):
        return
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    over = dataset[f.FRESH].values[places, 0]
    for place, axes in zip(shown, panels, strict=True):
        axes.plot(over, values[:, place], "o-", color=GREEN, markersize=4, linewidth=0.8)
        labels, unit = json.loads(str(dataset[f.LABELS].values[place]) or "[]"), str(dataset[f.UNIT].values[place])
        if labels:
            axes.set_yticks(range(len(labels)), labels)
        name = str(names[place]).removeprefix("plate.").removeprefix("pattern.")
        axes.set_title(f"{name} [{unit}]" if unit else name, fontsize="small", loc="left", pad=2)
        axes.tick_params(labelsize="small")
        hide_sides(axes, "top", "right")
    panels[-1].set_xlabel(str(dataset[f.GOAL_LABEL].values[0]))
