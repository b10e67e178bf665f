"""Figures of a posterior: pairs of parameters, and where each shot hit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import xarray
from matplotlib.axes import Axes

from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.posterior import parameters_of, unit_of
from warpimpact.plotting.plate import draw_holes
from warpimpact.plotting.style import BLUE, STEEL, Figure, finish, in_style
from warpimpact.results import posterior_file as p
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_GREY = "0.6"
_POINTS = 600
_CELLS_BESIDE = 5.0
"""Most cells of holes that a figure shows on either side of the middle. A fit searches hits in the first."""


def _values(posterior: xarray.Dataset, name: str) -> tuple[Array, Array, str]:
    """Draws of a parameter and of its prior in its display unit, and its label."""
    array = posterior[name]
    unit, factor = unit_of(array)
    prior = np.random.default_rng(len(name)).choice(factor * array.attrs[p.PRIOR], array.size)
    return factor * array.values, prior, f"{name.replace('_', ' ')}{f' [{unit}]' if unit else ''}"


@in_style
def pairs_figure(posterior: xarray.Dataset) -> Figure:
    """Every two parameters against each other, and each beside its prior."""
    names = parameters_of(posterior)
    size = max(4.5, 1.75 * len(names))
    figure = Figure(figsize=(size + 1.2, size), layout="constrained")
    panels = figure.subplots(len(names), len(names), squeeze=False)
    drawn = {name: _values(posterior, name) for name in names}
    for row, below in enumerate(names):
        for column, across in enumerate(names):
            axes = panels[row, column]
            if column > row:
                axes.remove()
                continue
            (x, prior, label_x), (y, prior_below, label_y) = drawn[across], drawn[below]
            if row == column:
                _density(axes, prior, x)
                axes.set_title(posterior[across].attrs[p.VERDICT].replace(" by these shots", ""), fontsize="x-small")
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
    finish(figure, f"posterior (blue) and prior (grey); {_worth(posterior)}", result=posterior)
    return figure


def _worth(posterior: xarray.Dataset) -> str:
    ended = "" if posterior.attrs[p.CONVERGED] else ", NOT CONVERGED"
    return f"effective sample size {posterior.attrs[p.EFFECTIVE]:.0f}{ended}"


def _limits(prior: Array, posterior: Array) -> tuple[float, float]:
    low, high = np.quantile(np.concatenate([prior, posterior]), [0.002, 0.998])
    return float(low - 0.03 * (high - low)), float(high + 0.03 * (high - low))


def _density(axes: Axes, prior: Array, posterior: Array) -> None:
    edges = np.linspace(*_limits(prior, posterior), 31).tolist()
    axes.hist(prior, bins=edges, density=True, color=_GREY, alpha=0.5)
    axes.hist(posterior, bins=edges, density=True, color=BLUE, alpha=0.6)


@in_style
def hits_figure(posterior: xarray.Dataset) -> Figure:
    """Where each shot hit, on the plate: draws of the posterior.

    The plate is drawn at the posterior's medians; where the spacing of its holes is unknown, so are their places.
    """
    fit = fit_from(str(posterior.attrs[p.FIT_TEXT]), "the fit of this posterior", Path())
    medians = {
        scene_parameter.path: float(np.median(posterior[scene_parameter.name]))
        for scene_parameter in fit.scene_parameters
        if scene_parameter.unit != "rad"
    }
    across = min(3, len(fit.shots))
    down = -(-len(fit.shots) // across)
    figure = Figure(figsize=(4.2 * across + 0.8, 4.6 * down), layout="compressed")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for place, shot in enumerate(fit.shots):
        axes = panels[place]
        plate = fit.scene_of(shot, medians).target.layers[0]
        y, z = (MM * posterior[name].values[:, place] for name in p.HITS)
        cell = [side * MM for side in plate.sampled_cell]
        far = [float(np.abs(at).max()) * 1.05 for at in (y, z)]
        half = [min(max(0.55 * side, most), _CELLS_BESIDE * side) for side, most in zip(cell, far, strict=True)]
        axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal", xlabel="y [mm]", ylabel="z [mm]")
        axes.set_facecolor(STEEL)
        draw_holes(axes, plate)
        axes.scatter(y, z, s=5, color=BLUE, alpha=0.35, lw=0)
        axes.set_title(str(posterior["shot"].values[place]))
    for axes in panels[len(fit.shots) :]:
        axes.remove()
    finish(figure, f"where the shots hit, {_worth(posterior)}", result=posterior)
    return figure


FIGURES: Mapping[str, Callable[[xarray.Dataset], Figure]] = {"pairs": pairs_figure, "hits": hits_figure}
"""All figures of a posterior, by the endings of their files."""
