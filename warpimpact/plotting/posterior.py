"""Figures of a posterior: pairs of parameters, and where each shot hit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import xarray

from warpimpact.identification.fit import fit_from
from warpimpact.identification.posterior import parameters_of, unit_of
from warpimpact.plotting.cell import words
from warpimpact.plotting.plate import draw_plate
from warpimpact.plotting.style import BLUE, Figure, finish, in_style, sheet
from warpimpact.results import posterior_file as p
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM

_GREY = "0.6"
_POINTS = 600
_MOST_CELLS = 5.0
"""Most cells of holes that a figure shows on either side of the middle. A fit searches hits in the first."""


def _values(posterior: xarray.Dataset, name: str) -> tuple[Array, Array, Array, str]:
    """Draws of a parameter and of its prior in its display unit, limits of their axis, and its label."""
    unit, factor = unit_of(posterior[name])
    values, prior = factor * posterior[name].values, factor * posterior[name].attrs[p.PRIOR]
    prior = np.random.default_rng(len(name)).choice(prior, values.size)
    ends = np.quantile(np.concatenate([prior, values]), [0.002, 0.998])
    return values, prior, ends + np.ptp(ends) * np.array([-0.03, 0.03]), words(name) + (f"\n[{unit}]" if unit else "")


@in_style
def pairs_figure(posterior: xarray.Dataset) -> Figure:
    """Every two parameters against each other, and each beside its prior."""
    names = parameters_of(posterior)
    size = max(4.5, 1.75 * len(names))
    figure = Figure(figsize=(size + 1.2, size), layout="constrained")
    panels = figure.subplots(len(names), len(names), squeeze=False)
    drawn = [_values(posterior, name) for name in names]
    for (row, column), axes in np.ndenumerate(panels):
        (x, prior, limits, label), (y, prior_below, limits_below, label_below) = drawn[column], drawn[row]
        if row == column:
            for values, colour in ((prior, _GREY), (x, BLUE)):
                axes.hist(
                    values, bins=np.linspace(limits[0], limits[1], 31).tolist(), density=True, color=colour, alpha=0.55
                )
            axes.set_title(posterior[names[row]].attrs[p.VERDICT].replace(" by these shots", ""), fontsize="x-small")
            axes.set(yticks=[], xlim=limits)
        else:
            some = slice(None, None, max(1, len(x) // _POINTS))
            axes.scatter(prior[some], prior_below[some], s=2, color=_GREY, alpha=0.25, lw=0)
            axes.scatter(x[some], y[some], s=4, color=BLUE, alpha=0.45, lw=0)
            axes.set(xlim=limits, ylim=limits_below)
            axes.set_ylabel(label_below, fontsize="small")
        axes.set_xlabel(label, fontsize="small")
        axes.tick_params(labelsize="x-small")
        axes.label_outer()
        if column > row:
            axes.remove()
    finish(figure, f"posterior (blue) and prior (grey); {_worth(posterior)}", result=posterior)
    return figure


def _worth(posterior: xarray.Dataset) -> str:
    ended = "" if posterior.attrs[p.CONVERGED] else ", NOT CONVERGED"
    return f"effective sample size {posterior.attrs[p.EFFECTIVE]:.0f}{ended}"


@in_style
def hits_figure(posterior: xarray.Dataset) -> Figure:
    """Where each shot hit, on the plate: draws of the posterior.

    The plate is drawn at the posterior's medians; where the spacing of its holes is unknown, so are their places.
    """
    fit = fit_from(str(posterior.attrs[p.FIT_TEXT]), "the fit of this posterior", Path())
    medians = {
        scene_parameter.place: float(np.median(posterior[scene_parameter.name]))
        for scene_parameter in fit.scene_parameters
        if scene_parameter.unit != "rad"
    }
    figure, panels = sheet(len(fit.shots), 3, (4.5, 4.6))
    for place, (axes, shot) in enumerate(zip(panels, fit.shots, strict=True)):
        plate = fit.scene_of(shot, medians).target.layers[0]
        hits = MM * np.stack([posterior[name].values[:, place] for name in p.HITS])
        cell, far = MM * np.array(plate.sampled_cell), 1.05 * np.abs(hits).max(axis=1)
        half = np.minimum(np.maximum(0.55 * cell, far), _MOST_CELLS * cell)
        draw_plate(axes, plate, half)
        axes.scatter(hits[0], hits[1], s=5, color=BLUE, alpha=0.35, lw=0)
        axes.set(xlabel="y [mm]", ylabel="z [mm]", title=str(posterior["shot"].values[place]))
    finish(figure, f"where the shots hit, {_worth(posterior)}", result=posterior)
    return figure


FIGURES: Mapping[str, Callable[[xarray.Dataset], Figure]] = {"pairs": pairs_figure, "hits": hits_figure}
"""All figures of a posterior, by the endings of their files."""
