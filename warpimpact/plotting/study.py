"""Figure of a study: error against speed, for residual velocity and tilt."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray
from matplotlib.figure import Figure

from warpimpact.plotting.heading import heading
from warpimpact.plotting.style import BLUE, VERMILION
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.studies.accuracy import QUOTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANELS = {v.RESIDUAL_VELOCITY: "residual velocity [m/s]", v.TILT: "tilt [°]"}
_BELOW_FLOOR = 0.4  # lowest error shown, in units of the uncertainty
# Colours of Okabe and Ito: they differ in every kind of colour blindness.
_GREY = "0.62"


def study_figure(dataset: xarray.Dataset) -> Figure:
    """90 % error against hits per second, for residual velocity and for tilt at the last stand-off.

    Args:
        dataset: the result of `analysis.study.study`.
    """
    figure = Figure(figsize=(11.5, 5.4), layout="constrained")
    quoted = dataset.sel(quantile=QUOTED).isel(standoff=-1)
    panels = figure.subplots(1, 2)
    for axes, quantity in zip(panels, _PANELS, strict=True):
        _draw(axes, quoted, quantity)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(
        f"{heading(dataset)}\n{dataset.sizes['hit']} hits, tilt at {quoted[v.STANDOFF].item() * 1e3:g} mm; "
        f"{dataset.attrs[attr.DEVICE]}, {dataset.attrs[attr.HISTORY][:10]}"
    )
    return figure


def _draw(axes: Axes, quoted: xarray.Dataset, quantity: v.Variable) -> None:
    """One panel: every setting, the front, the named fidelities, and the uncertainty of the converged answer."""
    axes.set(xscale="log", yscale="log", xlabel="hits per second", ylabel=f"{QUOTED:.0%} error of {_PANELS[quantity]}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")  # that of a logarithmic axis writes mathtext, which figures leave unparsed
    axes.grid(which="major", color="0.9")
    axes.set_axisbelow(True)
    quoted = quoted.isel(setting=(quoted[v.ERRORS[quantity]] > 0.0).values)  # a logarithm has no 0
    literal = (quoted[v.SCHEME] == "nodal").values
    on_front = quoted.isel(setting=quoted[v.FRONTS[quantity]].values == 1).sortby(v.HITS_PER_SECOND)

    def points(settings: xarray.Dataset) -> tuple[np.ndarray, np.ndarray]:
        return settings[v.HITS_PER_SECOND].values, settings[v.ERRORS[quantity]].values

    floor = quoted[v.CHANGES[quantity]].values[-1]
    axes.plot(*points(on_front), color=BLUE, linewidth=1.5, zorder=2, label="front: no faster setting is as exact")
    axes.scatter(*points(quoted.isel(setting=~literal)), s=28, color=_GREY, zorder=3, label="other settings")
    axes.scatter(*points(on_front), s=28, color=BLUE, zorder=4)
    axes.scatter(
        *points(quoted.isel(setting=literal)), s=48, color=VERMILION, marker="X", zorder=4, label="literal scheme"
    )
    named = quoted.isel(setting=np.char.startswith(quoted[v.SETTING].values.astype(str), "level "))
    axes.scatter(*points(named), s=110, facecolors="none", edgecolors="black", zorder=5, label="levels of the ladder")
    axes.margins(x=0.22, y=0.15)
    if floor > 0.0:
        bottom = min(axes.get_ylim()[0], _BELOW_FLOOR * floor)
        axes.axhspan(bottom, floor, color=VERMILION, alpha=0.12, linewidth=0, label="converged answer uncertain")
        axes.set_ylim(bottom=bottom)
    for setting in named[v.SETTING].values:
        _name(axes, *points(named.sel(setting=[setting])), setting, right=-5, up=7, ha="right")
    for row, setting in enumerate(quoted[v.SETTING].values[literal]):
        _name(axes, *points(quoted.sel(setting=[setting])), setting, right=9, up=4 - 14 * row)


def _name(
    axes: Axes, rates: np.ndarray, errors: np.ndarray, text: str, *, right: float, up: float, ha: str = "left"
) -> None:
    """Write a setting's name beside its point; the distances `right` and `up` are in points."""
    place = (rates.item(), errors.item())
    axes.annotate(text, place, xytext=(right, up), textcoords="offset points", ha=ha, zorder=6)
