"""Figures of a posterior: pairs of parameters, measured against computed numbers, and where each shot hit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.posterior import learnt, parameters_of
from warpimpact.identification.posterior_view import unit_of
from warpimpact.plotting.style import BLUE, VERMILION, add_heading, legend_below
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_GREY = "0.6"
_POINTS = 600
_CELLS_BESIDE = 5.0
"""Most cells of holes that a figure shows on either side of the middle. A fit searches hits in the first."""


def _values(tree: xarray.DataTree, group: str, name: str) -> tuple[Array, str]:
    """Draws of a parameter in its display unit, and its label."""
    array = tree[group].to_dataset()[name]
    unit, factor = unit_of(array)
    return factor * array.values.ravel(), f"{name.replace('_', ' ')}{f' [{unit}]' if unit else ''}"


def pairs_figure(tree: xarray.DataTree) -> Figure:
    """Every two parameters against each other, and each beside its prior."""
    names = parameters_of(tree)
    size = max(4.5, 1.75 * len(names))
    figure = Figure(figsize=(size + 1.2, size + 0.9), layout="constrained")
    panels = figure.subplots(len(names), len(names), squeeze=False)
    knowledge = learnt(tree)
    drawn, priors = ({name: _values(tree, group, name) for name in names} for group in ("posterior", "prior"))
    for row, below in enumerate(names):
        for column, across in enumerate(names):
            axes = panels[row, column]
            if column > row:
                axes.remove()
                continue
            (x, label_x), (y, label_y) = drawn[across], drawn[below]
            prior, prior_below = priors[across][0], priors[below][0]
            if row == column:
                _density(axes, prior, x)
                axes.set_title(knowledge[across].verdict.replace(" by these shots", ""), fontsize="x-small")
                axes.set_yticks([])
            else:
                shown = slice(None, None, max(1, len(x) // _POINTS))
                axes.scatter(prior[shown], prior_below[shown], s=2, color=_GREY, alpha=0.25, lw=0)
                axes.scatter(x[shown], y[shown], s=4, color=BLUE, alpha=0.45, lw=0)
                axes.set_ylim(_limits(prior_below, y))
            axes.set_xlim(_limits(prior, x))
            axes.tick_params(labelsize="x-small", labelbottom=row == len(names) - 1, labelleft=column == 0 and row > 0)
            if row == len(names) - 1:
                axes.set_xlabel(label_x.replace(" [", "\n["), fontsize="small")
            if column == 0 and row > 0:
                axes.set_ylabel(label_y.replace(" [", "\n["), fontsize="small")
    add_heading(figure, str(tree.attrs[attr.TITLE]), f"posterior (blue) and prior (grey); {_worth(tree)}")
    return figure


def _worth(tree: xarray.DataTree) -> str:
    ended = "" if tree.attrs[posterior_file.CONVERGED] else ", NOT CONVERGED"
    return f"effective sample size {tree.attrs[posterior_file.EFFECTIVE]:.0f}{ended}"


def _limits(prior: Array, posterior: Array) -> tuple[float, float]:
    low, high = np.quantile(np.concatenate([prior, posterior]), [0.002, 0.998])
    return float(low - 0.03 * (high - low)), float(high + 0.03 * (high - low))


def _density(axes: Axes, prior: Array, posterior: Array) -> None:
    edges = np.linspace(*_limits(prior, posterior), 31).tolist()
    axes.hist(prior, bins=edges, density=True, color=_GREY, alpha=0.5)
    axes.hist(posterior, bins=edges, density=True, color=BLUE, alpha=0.6)


def measured_figure(tree: xarray.DataTree) -> Figure:
    """Every measured number with its uncertainty beside what is computed for it: 50 and 90 % intervals."""
    observed, computed = tree["observed_data"].to_dataset(), tree["posterior_predictive"].to_dataset()
    stored = observed[posterior_file.UNITS_OF].values if posterior_file.UNITS_OF in observed else ()
    units = [str(unit) for unit in stored]
    kinds = list(dict.fromkeys(units)) or ["1"]
    counts = [max(1, units.count(kind)) for kind in kinds]
    figure = Figure(figsize=(10.0, 2.6 + 0.55 * sum(counts)), layout="constrained")
    panels = figure.subplots(len(kinds), 1, squeeze=False, gridspec_kw={"height_ratios": counts})[:, 0]
    for axes, kind in zip(panels, kinds, strict=True):
        rows = [place for place, unit in enumerate(units) if unit == kind]
        labels = [str(observed["observation"].values[place]) for place in rows]
        for line, place in enumerate(rows):
            for offset, name, colour in ((-0.16, posterior_file.MEASURED, _GREY), (0.16, posterior_file.FITTED, BLUE)):
                values = computed[name].values[..., place].ravel()
                values = values[np.isfinite(values)]
                if len(values):
                    low, quarter, three, high = np.quantile(values, [0.05, 0.25, 0.75, 0.95])
                    axes.plot([low, high], [line + offset] * 2, color=colour, lw=1.5)
                    axes.plot([quarter, three], [line + offset] * 2, color=colour, lw=5, solid_capstyle="butt")
            value, std = (float(observed[name][place]) for name in (posterior_file.MEASURED, posterior_file.STD))
            axes.errorbar(value, line, xerr=std, fmt="o", color=VERMILION, capsize=3, ms=5, zorder=4)
        axes.set_yticks(range(len(rows)), labels)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlabel({"m s-1": "m/s", "degree": "degrees"}.get(kind, kind))
        axes.grid(axis="x", color="0.9")
        axes.set_axisbelow(True)
    first = panels[0]
    first.plot([], [], "o", color=VERMILION, label="measured, ±1 standard uncertainty")
    first.plot([], [], color=BLUE, lw=4, label="computed at its hit")
    first.plot([], [], color=_GREY, lw=4, label="another such shot, measured")
    legend_below(figure, 3)
    add_heading(figure, str(tree.attrs[attr.TITLE]), f"measured and computed, {_worth(tree)}")
    return figure


def hits_figure(tree: xarray.DataTree) -> Figure:
    """Where each shot hit, on the plate: draws of the posterior, and the hit of the smallest misfit.

    The plate is drawn at the posterior's medians; where the spacing of its holes is unknown, so are their places.
    """
    fit = fit_from(str(tree.attrs[posterior_file.FIT_TEXT]), "the fit of this posterior", Path())
    posterior, best = tree["posterior"].to_dataset(), tree["best"].to_dataset()
    medians = {
        scene_parameter.path: float(np.median(posterior[scene_parameter.name]))
        for scene_parameter in fit.scene_parameters
        if scene_parameter.unit != "rad"
    }
    across = min(3, len(fit.shots))
    down = -(-len(fit.shots) // across)
    figure = Figure(figsize=(4.2 * across + 0.8, 5.2 * down + 1.0), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for place, shot in enumerate(fit.shots):
        axes = panels[place]
        scene = fit.scene_of(shot, medians)
        y, z = (MM * posterior[name].values[..., place].ravel() for name in posterior_file.HITS)
        cell = [side * MM for side in scene.target.layers[0].sampled_cell]
        far = [float(np.abs(at).max()) * 1.05 for at in (y, z)]
        half = [min(max(0.55 * side, most), _CELLS_BESIDE * side) for side, most in zip(cell, far, strict=True)]
        ranges = [(-side / MM, side / MM) for side in half]
        axes.set_facecolor("0.85")
        for outline in scene.target.layers[0].pattern.outlines(*ranges):
            axes.fill(*(MM * outline.T), facecolor="white", edgecolor="black", lw=0.8)
        axes.scatter(y, z, s=5, color=BLUE, alpha=0.35, lw=0, label="posterior")
        at = (MM * float(best[name][place]) for name in posterior_file.HITS)
        axes.plot(*at, "X", color=VERMILION, ms=8, mec="white", label="smallest misfit")
        axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal", xlabel="y [mm]", ylabel="z [mm]")
        axes.set_title(str(posterior["shot"].values[place]))
    for axes in panels[len(fit.shots) :]:
        axes.remove()
    legend_below(figure, 2)
    add_heading(figure, str(tree.attrs[attr.TITLE]), f"where the shots hit, {_worth(tree)}")
    return figure


FIGURES: Mapping[str, Callable[[xarray.DataTree], Figure]] = {
    "pairs": pairs_figure,
    "measured": measured_figure,
    "hits": hits_figure,
}
"""All figures of a posterior, by the endings of their files."""
