"""Figure of a study of sensitivity: how far each change moves each measure."""

from __future__ import annotations

from textwrap import fill

import numpy as np
import pandas as pd

from warpimpact.plotting.style import BLUE, VERMILION, Figure, finish, hide_sides, in_style

_ROW, _PANEL, _LABELS = 0.24, 2.6, 2.4
"""Height of a row, and widths of a panel and of the names of the changes [inch]."""


@in_style
def sensitivity_figure(table: pd.DataFrame, title: str = "", hits: int = 0) -> Figure:
    """Draw a bar for each change from the value as given, with a panel for each measure.

    Args:
        table: table of `sensitivity`.
        title: title of the campaign.
        hits: number of hits of each row, for the note.
    """
    size = (_LABELS + _PANEL * len(table.columns), 0.9 + _ROW * len(table))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(1, len(table.columns), sharey=True, squeeze=False)[0]
    rows = np.arange(1, len(table))
    for axes, (name, values) in zip(panels, table.items(), strict=True):
        given = float(values.iloc[0])
        moves = values.iloc[1:].to_numpy(float) - given
        axes.barh(rows, moves, left=given, color=np.where(moves > 0.0, VERMILION, BLUE), height=0.7)
        axes.axvline(given, color="0.2", linewidth=1.0)
        axes.set_title(fill(str(name), 28), fontsize="medium")
        axes.set_yticks(rows, table.index[1:])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x", color="0.9")
        axes.set_axisbelow(True)
        axes.margins(x=0.08)
        hide_sides(axes, "top", "right", "left")
    panels[0].invert_yaxis()
    note = f"{hits} hits, the same with every change. " if hits else ""
    finish(figure, f"{note}A bar begins at the value as given.", title=title or "sensitivity")
    return figure
