"""Figure of a sweep: its measures with their intervals against the swept inputs."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
import xarray
from matplotlib.axes import Axes

from warpimpact.plotting.cell import words
from warpimpact.plotting.style import PALETTE, Figure, bars, finish, in_style
from warpimpact.results.measures import Measure
from warpimpact.scene.display import STORED
from warpimpact.studies.sweep import inputs_of, measures_of, sweep_table

_MOST_LINES = 12
_PANEL = (5.0, 3.75)
"""Width and height of a panel on paper [inch]."""


@in_style
def sweep_figure(sweep: xarray.Dataset, texts: Sequence[str] = ()) -> Figure:
    """A panel for every measure, with 95 % intervals, against the first input that is a number; a line for every
    combination of the others. Without texts of measures they are those of `studies.sweep.SHOWN`.

    Raises:
        ResultError: a text is no measure, or the sweep lacks what it needs.
    """
    measures, inputs = measures_of(sweep, texts), list(inputs_of(sweep))
    along = next((name for name in inputs if sweep[name].dtype.kind == "f"), inputs[0])
    table, others = sweep_table(sweep, measures), [name for name in inputs if name != along]
    lines = {"": table}
    if others:
        groups = (
            (label if isinstance(label, tuple) else (label,), line) for label, line in table.groupby(others, sort=False)
        )
        lines = {
            ", ".join(f"{words(n)} {one}" for n, one in zip(others, label, strict=True)): line for label, line in groups
        }
    rows, columns = -(-len(measures) // 2), min(2, len(measures))
    figure = Figure(figsize=(max(2, columns) * _PANEL[0], rows * _PANEL[1]), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for axes, measure in zip(panels.flat, measures, strict=False):
        for number, (label, line) in enumerate(list(lines.items())[:_MOST_LINES]):
            style = {"color": PALETTE[number % len(PALETTE)], "label": label}
            _draw(axes, measure, sweep[along], line, style, below=number % 2 == 1)
        axes.set_ylabel(fill(measure.title, 45))
        axes.grid(color="0.9")
        if measure.is_binary:
            axes.set_ylim(-0.03, 1.03)
    for axes in panels.flat[len(measures) :]:
        axes.set_axis_off()
    unit = STORED[sweep[along].attrs.get("units", "1")].shown
    for axes in panels[-1]:
        axes.set_xlabel(f"{words(along)} [{unit}]" if unit else words(along))
    counted = "beside a value: the share of the hits that it counts, where that is not all"
    more = len(lines) - _MOST_LINES
    note = f"{sweep.sizes['hit']} hits at every point, 95 % intervals; {counted}"
    note += f"; {more} more combinations are not shown" if more > 0 else ""
    finish(figure, note, result=sweep, legend=len(inputs) > 1, columns=3)
    return figure


def _draw(
    axes: Axes, measure: Measure, places: xarray.DataArray, line: pd.DataFrame, style: dict[str, Any], *, below: bool
) -> None:
    """Draw a line with its intervals, and write the share of the hits that a value counts beside it, above or below
    the line, and left of the last place."""
    value, low, high, share = line[measure.text][["value", "low", "high", "share"]].to_numpy().T
    is_number = places.dtype.kind == "f"
    x = places.values * STORED[places.attrs["units"]].factor if is_number else np.arange(len(line))
    axes.errorbar(x, value, yerr=bars(value, low, high), fmt="o-", capsize=3.0, **style)
    if not is_number:
        axes.set_xticks(x, places.values)
    for at, height, counted in zip(x, value, share, strict=True):
        if 0.0 < counted < 1.0:
            last = len(x) > 1 and at == x.max()
            axes.annotate(
                f"{counted:.0%}",
                (at, height),
                (-6.0 if last else 6.0, -5.0 if below else 5.0),
                textcoords="offset points",
                fontsize="x-small",
                color=style["color"],
                ha="right" if last else "left",
                va="top" if below else "bottom",
            )
