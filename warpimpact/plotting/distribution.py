"""Figures of distributions: along the cell, of two variables, and around the local mean of nearby hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from textwrap import fill

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from warpimpact.analysis.hit_map import NEIGHBOURS, hit_points, mirrored, plane_fit, share_of
from warpimpact.plotting.cell import (
    draw_holes,
    draw_values,
    map_size,
    nearest_hits,
    paint_pixels,
    pixels,
    scale_of,
    shots_text,
    shown,
    struck,
    tree_of,
)
from warpimpact.plotting.style import BLUE, LINE, VERMILION, inscribe, names, note_lines
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_BANDS = {"5 to 95 %": (0.05, 0.95, 0.2), "25 to 75 %": (0.25, 0.75, 0.4)}  # two quantiles and the opacity
_PER_STRIP, _MOST_STRIPS = 50, 48  # fewest hits of a strip; most strips along an axis
_NARROW = 16  # characters of a label along 1.2 inch
_FINE = 100  # pixels along the longer side of a smoothed map
_MOST_POINTS = 4000  # more are drawn as a density


def marginals(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """A map with the distribution of its values along y, along z, and over the whole cell.

    Strips of the cell with equal numbers of hits give the median and the middle 50 % and 90 %. Arguments and errors are
    those of `cell.shown`.
    """
    dataset = mirrored(dataset)
    column = shown(dataset, variable, standoff)
    size = map_size(dataset)
    notes = column.title, f"{shots_text(dataset)}; seen from behind the plate"
    left, width = 0.95, size[0] + 4.8
    below = 1.25 + LINE * len(note_lines(width, "", [*notes, *names(dataset)]))
    height = below + size[1] + 1.9
    figure = Figure(figsize=(width, height))  # a layout engine does not find a place for insets of fixed size
    centre = figure.add_axes((left / width, below / height, size[0] / width, size[1] / height))
    artist = draw_values(centre, dataset, column.values, scale_of([column.values], signed=column.signed))
    exists = np.isfinite(column.values)
    if exists.any():
        wide, tall = 1.0 / size  # one inch as a share of the map
        above = centre.inset_axes((0.0, 1.0 + 0.12 * tall, 1.0, 1.2 * tall), sharex=centre)
        beside = centre.inset_axes((1.0 + 0.12 * wide, 0.0, 1.2 * wide, 1.0), sharey=centre)
        bar = centre.inset_axes((1.0 + 1.6 * wide, 0.0, 0.17 * wide, 1.0))
        histogram = centre.inset_axes((1.0 + 1.77 * wide, 0.0, 1.2 * wide, 1.0))
        values, points = column.values[exists], hit_points(dataset)[exists] * MM
        _draw_strips(above, points[:, 0], values, upright=False)
        _draw_strips(beside, points[:, 1], values, upright=True)
        above.set_ylabel(fill(column.label, _NARROW))
        beside.set_xlabel(fill(column.label, _NARROW))
        beside.xaxis.set_major_locator(MaxNLocator(2, prune="both"))  # its numbers stay apart from those of the map
        figure.colorbar(artist, cax=bar).set_ticks([])
        histogram.hist(values, bins=min(40, 4 + len(values) // 20), orientation="horizontal", color=BLUE, alpha=0.5)
        histogram.axhline(np.median(values), color="black", lw=1.2)
        histogram.set(ylim=artist.get_clim() if np.ptp(values) else None, xlabel="hits", ylabel=column.label)
        histogram.yaxis.tick_right()
        histogram.yaxis.set_label_position("right")
    inscribe(figure, dataset, *notes)
    return figure


def dispersion(dataset: xarray.Dataset, standoff: float | None = None) -> Figure:
    """Residual velocity against tilt at a stand-off (None: the largest), with the distribution of each."""
    figure = Figure(figsize=(7.5, 6.5), layout="constrained")
    grid = {"width_ratios": [5.0, 1.2], "height_ratios": [1.2, 5.0]}
    (above, corner), (centre, beside) = figure.subplots(2, 2, sharex="col", sharey="row", gridspec_kw=grid)
    corner.remove()
    tilt, velocity = draw_dispersion(centre, dataset, standoff)
    for axes, values, orientation in ((above, tilt, "vertical"), (beside, velocity, "horizontal")):
        if len(values):
            axes.hist(values, bins=40, orientation=orientation, color=BLUE, alpha=0.5)
        else:
            axes.set(xticks=[], yticks=[])
        axes.label_outer()
    above.set_ylabel("hits")
    beside.set_xlabel("hits")
    inscribe(figure, dataset, f"cores that passed the {struck(dataset)}; {shots_text(dataset)}")
    return figure


def draw_dispersion(axes: Axes, dataset: xarray.Dataset, standoff: float | None = None) -> tuple[Array, Array]:
    """Draw residual velocity against tilt, with their medians; return the drawn tilt [degree] and velocity [m/s]."""
    tilt, velocity = (shown(dataset, name, standoff) for name in (v.TILT, v.RESIDUAL_VELOCITY))
    both = np.isfinite(tilt.values) & np.isfinite(velocity.values)
    x, y = tilt.values[both], velocity.values[both]
    if len(x) > _MOST_POINTS:
        density = axes.hexbin(x, y, gridsize=60, mincnt=1, bins="log", cmap="viridis", linewidths=0.1)
        axes.figure.colorbar(density, ax=axes, location="bottom", shrink=0.6, label="hits per hexagon", format="{x:g}")
    else:
        axes.scatter(x, y, s=7, color=BLUE, alpha=0.4, linewidths=0)
    if len(x):
        axes.axvline(np.median(x), color=VERMILION, lw=1.0, ls="--", label="medians")
        axes.axhline(np.median(y), color=VERMILION, lw=1.0, ls="--")
        axes.legend(frameon=False, loc="best")
    else:
        axes.text(0.5, 0.5, "no core behind the " + struck(dataset), transform=axes.transAxes, ha="center", va="center")
        axes.set(xticks=[], yticks=[])
    axes.set(xlabel=f"{tilt.title.partition(chr(10))[0]} [°]", ylabel=velocity.label)
    return x, y


def uncertainty(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """A map of the mean of neighbouring hits, and of half the width of its 95 % interval (`hit_map.plane_fit`).

    Shots must scatter, so that two shots at one place differ; otherwise neighbours say nothing about uncertainty.

    Raises:
        ValueError: nothing is uncertain, the hits do not cover the cell, or the variable cannot be mapped.
    """
    dataset = mirrored(dataset)
    column = shown(dataset, variable, standoff)
    unit = f"[{column.label.partition('[')[2]}"
    if not shots_scatter(dataset):
        raise ValueError(
            f'got "{variable}" of shots that all arrive alike, so nothing is uncertain that a map could show'
        )
    images = _local(dataset, column.values, _covered(dataset), lambda near: plane_fit(*near)[:2])
    labels = f"local mean of {column.label}", f"half width of its 95 % interval {unit}"
    method = "plane through the {} nearest hits, Student's interval; bends of the map widen it"
    return _local_maps(dataset, images, labels, column.title, method)


def is_uncertain(dataset: xarray.Dataset) -> bool:
    """Whether `uncertainty` has something to show."""
    return nearest_hits(dataset) is not None and shots_scatter(dataset)


def shots_scatter(dataset: xarray.Dataset) -> bool:
    """Whether shots differ in more than their hit point."""
    return any(np.ptp(dataset[name].values) > 0.0 for name in v.shot_variables(dataset))


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
    values, nearest = _of_every_hit(dataset, quantity), _covered(dataset)
    if not shots_scatter(dataset):
        note = "each hit has one outcome, 1 or 0; nearest hit"
        return _local_maps(dataset, values[nearest][None], [quantity], quantity, note)
    images = _local(dataset, values, nearest, lambda near: share_of(near[1]))
    labels = quantity, "half width of its 95 % interval"
    return _local_maps(dataset, images, labels, quantity, "share of the {} nearest hits, Wilson's interval")


def _of_every_hit(dataset: xarray.Dataset, quantity: str) -> Array:
    """1 or 0 of every hit, shape [hits]; NaN where it does not count."""
    measure = Measure.parse(quantity).of(dataset)
    if not measure.is_binary:
        raise ValueError(f'got "{quantity}", but a map of a probability needs P(…), such as P(perforated)')
    return measure.values(dataset)


def _covered(dataset: xarray.Dataset) -> NDArray[np.intp]:
    """Index of the hit nearest to every pixel. Raises ValueError if the hits do not cover the cell."""
    nearest = nearest_hits(dataset, _FINE)
    if nearest is None:
        raise ValueError("the hits do not cover the cell, so there is no estimate between them; more hits are needed")
    return nearest


def _local_maps(dataset: xarray.Dataset, images: Array, labels: Sequence[str], title: str, method: str) -> Figure:
    """A map of each image, shape [maps, pixels_z, pixels_y]: of a local value, and of how uncertain it is. The scale of
    a probability is that of all of them."""
    width, height = map_size(dataset)
    figure = Figure(figsize=(len(images) * (width + 2.0) + (len(images) < 2), height + 1.9), layout="constrained")
    panels = figure.subplots(1, len(images), sharex=True, sharey=True, squeeze=False)[0]
    for axes, image, label in zip(panels, images, labels, strict=True):
        scale = scale_of([np.array([0.0, 1.0])] if label.startswith("P(") else [image.ravel()])
        figure.colorbar(paint_pixels(axes, dataset, image, scale), ax=axes, label=label)
        draw_holes(axes, dataset)
    note = f"{method.format(NEIGHBOURS)}; {shots_text(dataset)}; seen from behind the plate"
    inscribe(figure, dataset, title, note)
    return figure


def _local(
    dataset: xarray.Dataset,
    values: Array,
    nearest: NDArray[np.intp],
    estimate: Callable[[tuple[Array, Array]], tuple[Array, Array]],
) -> Array:
    """Local estimates at every pixel, shape [2, pixels_z, pixels_y]: the value, and half the width of its interval.

    Both are NaN where the nearest hit has no value.

    Args:
        estimate: computes both from offsets [m] and values of the nearest hits.
    """
    images = np.full((2, *nearest.shape), np.nan)
    exists = np.isfinite(values)
    there = exists[nearest]
    if exists.sum() >= NEIGHBOURS:
        images[:, there] = estimate(_neighbours(dataset, values, pixels(dataset, _FINE)[there]))
    return images


def _neighbours(dataset: xarray.Dataset, values: Array, points: Array) -> tuple[Array, Array]:
    """Offsets [m] and values of the hits with a value that are nearest to points of the cell, across its edges.

    Args:
        points: relative to the lower left corner of the cell [m], shape [points, 2].
    """
    exists, period = np.isfinite(values), np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    _, near = tree_of(dataset, exists).query(points, k=NEIGHBOURS)
    offsets = (hit_points(dataset)[exists] + period / 2)[near] - points[:, None]
    return offsets - period * np.round(offsets / period), values[exists][near]


def _draw_strips(axes: Axes, places: Array, values: Array, *, upright: bool) -> None:
    """Draw quantiles of the values against their places; `upright` puts the places on the vertical axis."""
    strips = np.array_split(np.argsort(places), np.clip(len(places) // _PER_STRIP, 1, _MOST_STRIPS))
    middles = [places[strip].mean() for strip in strips]

    def quantiles(share: float) -> list[float]:
        return [float(np.quantile(values[strip], share)) for strip in strips]

    fill = axes.fill_betweenx if upright else axes.fill_between
    for label, (low, high, alpha) in _BANDS.items():
        fill(middles, quantiles(low), quantiles(high), color=BLUE, alpha=alpha, lw=0, label=label)
    median = (quantiles(0.5), middles) if upright else (middles, quantiles(0.5))
    axes.plot(*median, color="black", lw=1.2, label="median")
    axes.tick_params(labelleft=not upright, labelbottom=upright)
    if not upright:
        axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
