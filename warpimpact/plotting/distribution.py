"""Figures of distributions: along the cell, of two variables, and around the local mean of nearby hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from numpy.typing import NDArray

from warpimpact.analysis.hit_map import NEIGHBOURS, hit_points, mirrored, plane_fit, share_of
from warpimpact.plotting.cell import (
    SEEN,
    draw_hole_edges,
    draw_map,
    map_sheet,
    map_size,
    nearest,
    nearest_hits,
    paint_pixels,
    pixels,
    scale_of,
    shots_text,
    shown,
    struck,
    to_scale,
)
from warpimpact.plotting.style import BLUE, VERMILION, Figure, finish, in_style
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.layers import outlines
from warpimpact.results.measures import Measure
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_BANDS = {"5 to 95 %": (0.05, 0.95, 0.2), "25 to 75 %": (0.25, 0.75, 0.4)}
"""Two quantiles and the opacity of each band."""
_PER_STRIP, _MOST_STRIPS = 50, 48
"""Fewest hits of a strip, and most strips along an axis."""
_FINE = 100
"""Pixels along the longer side of a smoothed map."""
_MOST_POINTS = 4000
"""More hits are drawn as a density."""
_STRIP = 1.2
"""Width of a panel beside another one [inch]."""


@in_style
def marginals(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """A map with the distribution of its values along y, along z, and over the whole cell.

    Strips of the cell with equal numbers of hits give the median and the middle 50 % and 90 %. Arguments and errors are
    those of `cell.shown`.
    """
    dataset = mirrored(dataset)
    column = shown(dataset, variable, standoff)
    figure, centre, above, beside, histogram = _with_margins(map_size(dataset))
    to_scale(centre, dataset)
    artist = draw_map(centre, dataset, column._replace(title=""))
    exists = np.isfinite(column.values)
    values, points = column.values[exists], hit_points(dataset)[exists] * MM
    if len(values):
        _draw_strips(above, points[:, 0], values, upright=False)
        _draw_strips(beside, points[:, 1], values, upright=True)
        histogram.hist(values, bins=min(40, 4 + len(values) // 20), orientation="horizontal", color=BLUE, alpha=0.5)
        histogram.axhline(np.median(values), color="black", lw=1.2)
        figure.colorbar(artist, ax=histogram, location="left", aspect=25, pad=0.0).set_ticks([])
        histogram.set(ylim=artist.get_clim() if np.ptp(values) else None, xlabel="hits", ylabel=column.label)
        histogram.yaxis.tick_right()
        histogram.yaxis.set_label_position("right")
    above.set_ylabel(column.label.replace(" [", "\n["))
    beside.set_xlabel(column.label.replace(" [", "\n["))
    finish(figure, column.title, f"{shots_text(dataset)}; {SEEN}", result=dataset, legend=True, columns=4)
    return figure


def _with_margins(size: Array) -> tuple[Figure, Axes, Axes, Axes, Axes]:
    """A figure with a panel of this size [inch], one above, one on the right with its own heights, and one further
    right."""
    figure = Figure(figsize=(size[0] + 2 * _STRIP + 2.4, size[1] + _STRIP + 1.0), layout="compressed")
    grid = figure.add_gridspec(2, 3, width_ratios=(size[0], _STRIP, _STRIP), height_ratios=(_STRIP, size[1]))
    centre = figure.add_subplot(grid[1, 0])
    above, beside = figure.add_subplot(grid[0, 0], sharex=centre), figure.add_subplot(grid[1, 1], sharey=centre)
    above.tick_params(labelbottom=False)
    beside.tick_params(labelleft=False)
    return figure, centre, above, beside, figure.add_subplot(grid[1, 2])


@in_style
def dispersion(dataset: xarray.Dataset, standoff: float | None = None) -> Figure:
    """Residual velocity against tilt at a stand-off (None: the largest), with the distribution of each."""
    figure, centre, above, beside, free = _with_margins(np.array([5.0, 5.0]))
    free.remove()
    tilt, velocity = (shown(dataset, name, standoff) for name in (v.TILT, v.RESIDUAL_VELOCITY))
    both = np.isfinite(tilt.values) & np.isfinite(velocity.values)
    x, y = tilt.values[both], velocity.values[both]
    if len(x) > _MOST_POINTS:
        density = centre.hexbin(x, y, gridsize=60, mincnt=1, bins="log", cmap="viridis", linewidths=0.1)
        figure.colorbar(density, ax=centre, location="bottom", shrink=0.6, label="hits per hexagon", format="{x:g}")
    else:
        centre.scatter(x, y, s=7, color=BLUE, alpha=0.4, linewidths=0)
    if len(x):
        centre.axvline(np.median(x), color=VERMILION, lw=1.0, ls="--", label="medians")
        centre.axhline(np.median(y), color=VERMILION, lw=1.0, ls="--")
        centre.legend(frameon=False)
        above.hist(x, bins=40, color=BLUE, alpha=0.5)
        beside.hist(y, bins=40, color=BLUE, alpha=0.5, orientation="horizontal")
    else:
        centre.text(0.5, 0.5, f"no core behind the {struck(dataset)}", transform=centre.transAxes, ha="center")
    centre.set(xlabel=f"{tilt.title.partition(chr(10))[0]} [°]", ylabel=velocity.label)
    above.set_ylabel("hits")
    beside.set_xlabel("hits")
    finish(figure, f"cores that passed the {struck(dataset)}; {shots_text(dataset)}", result=dataset)
    return figure


@in_style
def uncertainty(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """A map of the mean of neighbouring hits, and of half the width of its 95 % interval (`hit_map.plane_fit`).

    Shots must scatter, so that two shots at one place differ; otherwise neighbours say nothing about uncertainty.

    Raises:
        ValueError: nothing is uncertain, the hits do not cover the cell, or the variable cannot be mapped.
    """
    dataset = mirrored(dataset)
    column = shown(dataset, variable, standoff)
    if not shots_scatter(dataset):
        raise ValueError(
            f'got "{variable}" of shots that all arrive alike, so nothing is uncertain that a map could show'
        )
    images = _local(dataset, column.values, _covered(dataset), lambda near: plane_fit(*near)[:2])
    labels = f"local mean of {column.label}", f"half width of its 95 % interval [{column.label.partition('[')[2]}"
    method = "plane through the {} nearest hits, Student's interval; bends of the map widen it"
    return _local_maps(dataset, images, labels, column.title, method)


def is_uncertain(dataset: xarray.Dataset) -> bool:
    """Whether `uncertainty` has something to show."""
    return nearest_hits(dataset) is not None and shots_scatter(dataset)


def shots_scatter(dataset: xarray.Dataset) -> bool:
    """Whether shots differ in more than their hit point."""
    return any(np.ptp(dataset[name].values) > 0.0 for name in v.shot_variables(dataset))


@in_style
def probability_map(dataset: xarray.Dataset, quantity: str) -> Figure:
    """Map of a probability from the nearest hits, and half the width of its 95 % interval (`hit_map.share_of`).

    Args:
        dataset: a result whose hits cover the cell.
        quantity: such as ``P(bending_stress > 1.5 GPa)`` or ``P(perforated)``, as in a campaign's ``stop.quantity``; or
            a share among the measures of protection, such as ``P(base perforated)``.

    Raises:
        ValueError: the quantity is no probability, the result does not have it, or the hits do not cover the cell.
    """
    dataset = mirrored(dataset)
    measure = Measure.parse(quantity).of(dataset)
    if not measure.is_binary:
        raise ValueError(f'got "{quantity}", but a map of a probability needs P(…), such as P(perforated)')
    values, places = measure.values(dataset), _covered(dataset)
    if not shots_scatter(dataset):
        note = "each hit has one outcome, 1 or 0; nearest hit"
        return _local_maps(dataset, values[places][None], [quantity], quantity, note)
    images = _local(dataset, values, places, lambda near: share_of(near[1]))
    labels = quantity, "half width of its 95 % interval"
    return _local_maps(dataset, images, labels, quantity, "share of the {} nearest hits, Wilson's interval")


def _covered(dataset: xarray.Dataset) -> NDArray[np.intp]:
    """Index of the hit nearest to every pixel. Raises ValueError if the hits do not cover the cell."""
    places = nearest_hits(dataset, _FINE)
    if places is None:
        raise ValueError("the hits do not cover the cell, so there is no estimate between them; more hits are needed")
    return places


def _local_maps(dataset: xarray.Dataset, images: Array, labels: Sequence[str], title: str, method: str) -> Figure:
    """A map of each image, shape [maps, pixels_z, pixels_y]: of a local value, and of how uncertain it is. The scale of
    a probability is that of all of them."""
    figure, panels = map_sheet([dataset] * len(images), len(images))
    for axes, image, label in zip(panels, images, labels, strict=True):
        scale = scale_of([np.array([0.0, 1.0])] if label.startswith("P(") else [image])
        figure.colorbar(paint_pixels(axes, dataset, image, scale), ax=axes, label=label)
        draw_hole_edges(axes, *outlines(dataset).values())
    finish(figure, title, f"{method.format(NEIGHBOURS)}; {shots_text(dataset)}; {SEEN}", result=dataset)
    return figure


def _local(
    dataset: xarray.Dataset,
    values: Array,
    places: NDArray[np.intp],
    estimate: Callable[[tuple[Array, Array]], tuple[Array, Array]],
) -> Array:
    """Local estimates at every pixel, shape [2, pixels_z, pixels_y]: the value, and half the width of its interval.

    Both are NaN where the nearest hit has no value.

    Args:
        places: index of the hit nearest to each pixel, shape [pixels_z, pixels_y].
        estimate: computes both from offsets [m] and values of the nearest hits with a value.
    """
    images = np.full((2, *places.shape), np.nan)
    exists, period = np.isfinite(values), np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    there = exists[places]
    if exists.sum() >= NEIGHBOURS:
        points = pixels(dataset, _FINE)[there]
        _, near = nearest(dataset, points, exists, NEIGHBOURS)
        offsets = hit_points(dataset)[exists][near] - points[:, None]
        images[:, there] = estimate((offsets - period * np.round(offsets / period), values[exists][near]))
    return images


def _draw_strips(axes: Axes, places: Array, values: Array, *, upright: bool) -> None:
    """Draw quantiles of the values against their places; `upright` puts the places on the vertical axis."""
    strips = np.array_split(np.argsort(places), np.clip(len(places) // _PER_STRIP, 1, _MOST_STRIPS))
    middles = [places[strip].mean() for strip in strips]

    def quantiles(share: float) -> list[float]:
        return [float(np.quantile(values[strip], share)) for strip in strips]

    band: Any = axes.fill_betweenx if upright else axes.fill_between
    for label, (low, high, alpha) in _BANDS.items():
        band(middles, quantiles(low), quantiles(high), color=BLUE, alpha=alpha, lw=0, label=label)
    median = (quantiles(0.5), middles) if upright else (middles, quantiles(0.5))
    axes.plot(*median, color="black", lw=1.2, label="median")
