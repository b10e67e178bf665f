"""Parts of hit maps: values of hits in shown units, their colours, and the coloured unit cell.

If the hits cover the cell, they are drawn as an image; every pixel has the colour of the nearest hit, also across the
cell's edges. If they are few or leave gaps, they are drawn as points. The view is against the line of fire, from
behind the plate: y to the right, z up, x towards the viewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import NamedTuple

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray
from scipy.spatial import KDTree

from warpimpact.analysis.hit_map import OF_PASSED, chosen, hit_points
from warpimpact.analysis.summary import breaks_promise
from warpimpact.kernels.status import Status
from warpimpact.plotting.style import MAP_SIDE, common_fire, draw_fire
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed
from warpimpact.results.layers import outlines
from warpimpact.scene.display import MM, STORED
from warpimpact.scene.model import Array

Scale = tuple[Colormap, Normalize]

CELL_PIXELS = 400  # along the longer side of the cell
FEWEST_HITS = 64  # fewer are drawn as points: an image would suggest detail that they do not have
WIDEST_GAP = 3.0  # largest distance from a pixel to its hit, in mean hit spacings; random hits reach about 2
NO_VALUE = "0.62"  # for hits without a value
# Colours of Okabe and Ito: they differ in every kind of colour blindness.
STATUS_COLOURS = (
    *("#D55E00", "#56B4E9", "#009E73", "#E69F00", "#000000", "#CC79A7", "#F0E442", "#0072B2", "#FFFFFF"),
    *("#882255", "#999933"),
)
"""Colours by the codes of `Status`: warm where the core comes through, cool where it is stopped or turned back, white
where it did not reach the layer."""

_SIGNED = {
    *(v.AZIMUTH, v.IMPACT_PITCH, v.IMPACT_YAW, v.EDGE_DISTANCE),
    *(v.PITCH, v.YAW),
}


class Shown(NamedTuple):
    """A variable of the hits as it is shown: values of shape [hits], NaN where a hit has none; label of an axis; title;
    whether it has a sign."""

    values: Array
    label: str
    title: str
    signed: bool


def shown(dataset: xarray.Dataset, variable: str, standoff: float | None = None, layer: int | None = None) -> Shown:
    """A variable in the units in which it is shown.

    Args:
        dataset: the result of a campaign.
        variable: one of `variables.HIT_NUMBERS` or `variables.LAYER_NUMBERS`. Residual velocity and deflection are
            those of cores that passed the plate.
        standoff: distance behind the plate, or the layer, [m] for a variable that has one; the largest if None.
        layer: number of the layer for a variable that has layers, 0 the plate; the last one if None.

    Raises:
        ValueError: the variable cannot be mapped, or the Dataset has no such stand-off or layer.
    """
    array = _selected(dataset, variable, standoff, layer)
    unit = STORED[array.attrs["units"]]
    exists = np.isfinite(array.values) & (passed(dataset) if variable in OF_PASSED else True)
    title = name = words(variable.removeprefix("layer_"))
    if "standoff" in array.coords:
        title += f", {float(array[v.STANDOFF]) * MM:g} mm behind the {struck(dataset)}"
    if variable in v.LAYER_NUMBERS:
        title += f", layer {_number(dataset, layer)}"
    if array.attrs["long_name"] != title:
        title += f"\n{array.attrs['long_name']}"
    values = np.where(exists, array.values.astype(np.float64) * unit.factor, np.nan)
    return Shown(values, f"{name} [{unit.shown}]", title, variable in _SIGNED)


def _number(dataset: xarray.Dataset, layer: int | None) -> int:
    return int(dataset.sizes["layer"]) - 1 if layer is None else layer


def _selected(dataset: xarray.Dataset, variable: str, standoff: float | None, layer: int | None) -> xarray.DataArray:
    numbers = (*v.HIT_NUMBERS, *v.LAYER_NUMBERS)
    mapped = [name for name in numbers if name in dataset]
    if variable not in mapped:
        raise ValueError(f'"{variable}" cannot be mapped; choose one of {", ".join(mapped)}')
    return chosen(dataset, variable, standoff, layer)


def struck(dataset: xarray.Dataset) -> str:
    """The word for what the shots are fired at: plate, or target if there are layers."""
    return "target" if v.LAYER_STATUS in dataset else "plate"


def words(name: str) -> str:
    return name.replace("_", " ")


def shots_text(dataset: xarray.Dataset) -> str:
    """Number of hits and the share that passed, velocity and obliquity; whether the numerics break their promise."""
    velocity, obliquity = (range_text(dataset[name]) for name in (v.IMPACT_VELOCITY, v.OBLIQUITY))
    share = float(passed(dataset).mean())
    share_text = "" if share == 1.0 else f" ({share:.1%} passed the {struck(dataset)})"
    broken = "; numerics less exact than promised" if breaks_promise(dataset) else ""
    hits = int((dataset["image"] == 0).sum()) if "image" in dataset.coords else dataset.sizes["hit"]
    return f"{hits} hits{share_text}, {velocity}, obliquity {obliquity}{broken}"


def range_text(array: xarray.DataArray) -> str:
    """The value that all hits share, or the range of the values, with its unit."""
    unit = STORED[array.attrs["units"]]
    lowest, highest = f"{array.values.min() * unit.factor:.4g}", unit.text(array.values.max(), ".4g")
    return highest if f"{lowest}{unit.suffix}" == highest else f"{lowest} to {highest}"


def limits(dataset: xarray.Dataset) -> Array:
    """Range [mm] along y and z that contains the whole cell and every hit, shape [2, 2]."""
    half = np.asarray(dataset.attrs[attr.PLATE_PERIOD]) / 2
    hits = hit_points(dataset)
    return np.stack([np.minimum(-half, hits.min(axis=0)), np.maximum(half, hits.max(axis=0))], axis=1) * MM


def map_size(dataset: xarray.Dataset) -> Array:
    """Width and height of a map to scale [inch]."""
    extent = np.ptp(limits(dataset), axis=1)
    return np.asarray(MAP_SIDE * extent / extent.max())


def scale_of(columns: Sequence[Array], *, signed: bool = False) -> Scale:
    """One colour scale for all columns: symmetric about a neutral zero if the values have a sign; grey for NaN."""
    together = np.concatenate(columns)
    finite = together[np.isfinite(together)]
    if signed:
        highest = np.max(np.abs(finite), initial=0.0)
        lowest = -highest
    else:
        lowest, highest = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
        if np.isclose(lowest, highest):  # a scale from 0: it shows no rounding as a pattern
            lowest, highest = min(0.0, highest), max(0.0, highest) or 1.0
    colours = colormaps["RdBu_r" if signed else "viridis"].with_extremes(bad=NO_VALUE)
    return colours, Normalize(lowest, highest)


def draw_values(
    axes: Axes, dataset: xarray.Dataset, values: Array, scale: Scale, layer: int | None = None
) -> ScalarMappable:
    """Draw values of the hits, shape [hits], with the holes and a legend; return the artist for a colour bar. A hit
    without a value shows how it ended, or how it ended in one layer."""
    artist = _paint(axes, dataset, values, *scale)
    exists = np.isfinite(values)
    grey = [] if exists.all() else [Patch(facecolor=NO_VALUE, label=_without_value(dataset, exists, layer))]
    _furnish(axes, dataset, grey, layer)
    return artist


def draw_status(axes: Axes, dataset: xarray.Dataset, layer: int | None = None) -> None:
    """Draw how the shots ended. The shares stand in the legend; for one layer they stand in the title, as layers share
    a legend."""
    status = dataset[v.STATUS].values if layer is None else dataset[v.LAYER_STATUS].values[:, layer]
    scale = Normalize(-0.5, len(STATUS_COLOURS) - 0.5)
    _paint(axes, dataset, status.astype(float), ListedColormap(STATUS_COLOURS), scale)
    codes = [code for code in Status if np.any(status == code)]
    names = {code: words(code.name.lower()) for code in codes}
    told = {code: f"{names[code]} {np.mean(status == code):.1%}" for code in codes}
    labels, shares = (told, "status") if layer is None else (names, f"layer {layer}\n{', '.join(told.values())}")
    _furnish(axes, dataset, [Patch(facecolor=STATUS_COLOURS[code], label=labels[code]) for code in codes], layer)
    axes.set_title(shares, fontsize="medium")


def draw_holes(axes: Axes, dataset: xarray.Dataset, layer: int | None = None) -> list[Artist]:
    """Draw the edges of the holes of one layer (None: the plate), visible on any colour, and set the axes to the cell,
    to scale.

    Returns the entry of a legend; no entry for a layer without holes.
    """
    (left, right), (bottom, top) = limits(dataset)
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="hit y [mm]", ylabel="hit z [mm]", aspect="equal")
    holes = outlines(dataset, layer or 0)
    if not len(holes["y"]):
        return []
    (edge,) = axes.plot(
        holes["y"] * MM,
        holes["z"] * MM,
        color="white",
        linewidth=1.2,
        path_effects=[Stroke(linewidth=2.8, foreground="black"), Normal()],
        scalex=False,
        scaley=False,
        label="edge of hole",
    )
    return [edge]


def pixels(dataset: xarray.Dataset, count: int = CELL_PIXELS) -> Array:
    """Centres [m] of the cell's pixels, relative to its lower left corner, shape [z, y, 2].

    Args:
        count: pixels along the longer side.
    """
    period = np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    counts = np.ceil(count * period / period.max()).astype(int)
    y, z = ((np.arange(n) + 0.5) / n * length for n, length in zip(counts, period, strict=True))
    return np.stack(np.meshgrid(y, z), axis=-1)


def tree_of(dataset: xarray.Dataset, which: NDArray[np.bool_] | slice = slice(None)) -> KDTree:
    """Search tree of the hits for `pixels`; it continues across the cell's edges."""
    period = np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    return KDTree((hit_points(dataset)[which] + period / 2) % period, boxsize=period)


def nearest_hits(dataset: xarray.Dataset, count: int = CELL_PIXELS) -> NDArray[np.intp] | None:
    """Index of the hit nearest to each of the `pixels`, shape [z, y]; None if the hits do not cover the cell."""
    period, hits = np.asarray(dataset.attrs[attr.PLATE_PERIOD]), hit_points(dataset)
    if len(hits) < FEWEST_HITS or np.any(np.abs(hits) > period / 2):
        return None
    distance, nearest = tree_of(dataset).query(pixels(dataset, count))
    spacing = np.sqrt(period.prod() / len(hits))
    return nearest if distance.max() <= WIDEST_GAP * spacing else None


def paint_pixels(axes: Axes, dataset: xarray.Dataset, image: Array, scale: Scale) -> ScalarMappable:
    """Colour the cell by an image of shape [z, y]."""
    y, z = np.asarray(dataset.attrs[attr.PLATE_PERIOD]) / 2 * MM
    colours, norm = scale
    extent = (-y, y, -z, z)
    return axes.imshow(image, cmap=colours, norm=norm, origin="lower", extent=extent, interpolation="nearest")


def _paint(axes: Axes, dataset: xarray.Dataset, values: Array, colours: Colormap, norm: Normalize) -> ScalarMappable:
    """Colour the cell by values of the hits, shape [hits]: as an image if hits cover it, else as points."""
    nearest = nearest_hits(dataset)
    if nearest is not None:
        return paint_pixels(axes, dataset, values[nearest], (colours, norm))
    y, z = hit_points(dataset).T * MM
    return axes.scatter(
        y,
        z,
        c=values,
        cmap=colours,
        norm=norm,
        s=36,
        edgecolors="black",
        linewidths=0.6,
        plotnonfinite=True,
        zorder=3,
    )


def _without_value(dataset: xarray.Dataset, exists: NDArray[np.bool_], layer: int | None) -> str:
    """Legend entry of the grey hits: their statuses."""
    status = dataset[v.STATUS].values if layer is None else dataset[v.LAYER_STATUS].values[:, layer]
    statuses = set(status[~exists].tolist())
    return fill(f"no value: {', '.join(words(code.name.lower()) for code in Status if code in statuses)}", 30)


def _furnish(axes: Axes, dataset: xarray.Dataset, entries: Sequence[Artist], layer: int | None) -> None:
    """Add the holes, the direction of fire, and a legend below the axes."""
    entries = [*entries, *draw_holes(axes, dataset, layer)]
    if (fire := common_fire(dataset)) is not None:
        draw_fire(axes, fire)
    if entries:
        below = axes.transAxes + ScaledTranslation(0.0, -0.5, axes.figure.dpi_scale_trans)
        axes.legend(
            handles=entries,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=below,
            ncols=2,
            frameon=False,
        )
