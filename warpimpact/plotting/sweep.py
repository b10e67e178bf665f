"""Figure of a sweep: means and shares with their intervals against the swept inputs."""

from __future__ import annotations

import itertools
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from matplotlib.figure import Figure

from warpimpact.analysis.estimates import estimated
from warpimpact.plotting.cell import words
from warpimpact.plotting.heading import heading
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure
from warpimpact.scene.display import STORED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from warpimpact.statistics.intervals import Estimate

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # of Okabe and Ito
_MOST_LINES = 12


def sweep_figure(sweep: xarray.Dataset) -> Figure:
    """Mean residual velocity, mean deflection, mean tilt at the largest stand-off and the share that passes, with 95 %
    intervals, against the first input that is a number; a line for every combination of the others.

    Args:
        sweep: a Dataset of `studies.sweep.joined`.
    """
    inputs = list(json.loads(sweep.attrs[attr.SWEEP]))
    along = next((name for name in inputs if sweep[name].dtype.kind == "f"), inputs[0])
    others = [name for name in inputs if name != along]
    measures = _measures(sweep)
    lines = list(itertools.islice(_lines(sweep, others), _MOST_LINES))
    figure = Figure(figsize=(10.0, 7.5), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True)
    for number, (label, line) in enumerate(lines):
        found = [estimated(point, measures) for point in points_along(line, along)]
        for axes, measure in zip(panels.flat, measures, strict=False):
            colour, estimates = _COLOURS[number % len(_COLOURS)], [one[measure] for one in found]
            _draw(axes, line[along], estimates, colour, label)
            if not measure.is_binary:
                _tell_shares(axes, line[along], estimates, [one[measures[-1]].count for one in found], colour)
    for axes in panels.flat[len(measures) :]:
        axes.set_axis_off()
    for axes, measure in zip(panels.flat, measures, strict=False):
        axes.set_ylabel(_label(measure))
        axes.grid(color="0.9")
        if measure.is_binary:
            axes.set_ylim(-0.03, 1.03)
    for axes in panels[-1]:
        axes.set_xlabel(_axis_label(sweep[along]))
    if others:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    counted = "; beside a mean: the share of the hits that it counts, where that is not all"
    left_out = _product(sweep.sizes[name] for name in others) - len(lines)
    note = f"; {left_out} more combinations are not shown" if left_out > 0 else ""
    hits = f"{sweep.sizes['hit']} hits at every point, 95 % intervals"
    figure.suptitle(f"{heading(sweep)}\n{hits}{counted}{note}")
    return figure


def points_along(line: xarray.Dataset, along: str) -> Iterator[xarray.Dataset]:
    """The points of a sweep in which one input is left, each with the hits that it has."""
    for place in range(line.sizes[along]):
        point = line.isel({along: place})
        yield point.isel(hit=np.flatnonzero(point[v.STATUS].notnull().values))


def _product(sizes: Any) -> int:
    return int(np.prod(list(sizes), dtype=int))


def _measures(sweep: xarray.Dataset) -> list[Measure]:
    tilts = [f"mean({v.TILT}@{last!r}m)" for last in sweep[v.STANDOFF].values[-1:].tolist()]
    means = [f"mean({v.RESIDUAL_VELOCITY})", f"mean({v.DEFLECTION})", *tilts]
    return [Measure.parse(text) for text in (*means, "P(perforated)")]


def _label(measure: Measure) -> str:
    if measure.kind == "share":
        return f"share {measure.quantity.label}"
    return f"mean {measure.column.label} [{measure.display.shown}]\nof the cores that passed"


def _axis_label(values: xarray.DataArray) -> str:
    shown = STORED[values.attrs.get("units", "1")].shown
    return f"{words(str(values.name))} [{shown}]" if shown else words(str(values.name))


def _lines(sweep: xarray.Dataset, others: Sequence[str]) -> Iterator[tuple[str, xarray.Dataset]]:
    """Label and points of every combination of the other inputs."""
    told = json.loads(sweep.attrs[attr.SWEEP])
    for places in itertools.product(*(range(sweep.sizes[name]) for name in others)):
        label = ", ".join(f"{words(name)} {told[name][place]}" for name, place in zip(others, places, strict=True))
        yield label, sweep.isel(dict(zip(others, places, strict=True)))


def _tell_shares(
    axes: Axes, places: xarray.DataArray, estimates: Sequence[Estimate], hits: Sequence[int], colour: str
) -> None:
    """Write the share of the hits that a mean counts beside it, where that is not all of them."""
    x = places.values if places.dtype.kind == "f" else np.arange(len(estimates))
    for at, one, all_ in zip(x, estimates, hits, strict=True):
        if 0 < one.count < all_:
            style: dict[str, Any] = {"fontsize": "x-small", "color": colour, "textcoords": "offset points"}
            axes.annotate(f"{one.count / all_:.0%}", (at, one.value), (5.0, 4.0), **style)


def _draw(axes: Axes, places: xarray.DataArray, estimates: Sequence[Estimate], colour: str, label: str) -> None:
    values = np.array([one.value for one in estimates])
    ends = np.array([[one.value - one.low for one in estimates], [one.high - one.value for one in estimates]])
    x = places.values * STORED[places.attrs["units"]].factor if places.dtype.kind == "f" else np.arange(len(values))
    bars = np.clip(np.nan_to_num(ends), 0.0, None)
    axes.errorbar(x, values, yerr=bars, fmt="o-", color=colour, capsize=3.0, label=label)
    if places.dtype.kind != "f":
        axes.set_xticks(x, places.values)
