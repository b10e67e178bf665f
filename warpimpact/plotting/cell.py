"""Maps of the unit cell: a variable of the hits in shown units, its colours, and the holes.

If the hits cover the cell, every pixel has the colour of the nearest hit, also across the cell's edges. If they are few
or leave gaps, they are drawn as points. The view is from behind the plate: y to the right, z up.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.patches import Rectangle
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray
from scipy.spatial import KDTree

from warpimpact.analysis.correction import interval_of
from warpimpact.analysis.hit_map import (
    BY_ELEMENTS,
    OF_PASSED,
    axes_of,
    hit_points,
    is_by_law,
    mirrored,
    select_variable,
    share_that_passes,
)
from warpimpact.analysis.inspection import exceeds_tolerance
from warpimpact.kernels.status import Status
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import Result
from warpimpact.plotting.style import Figure, common_fire, draw_fire, sheet
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import is_uniform, outlines
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM, STORED, count_text

Scale = tuple[Colormap, Normalize]

MAP_SIDE = 4.2
"""Longer side of a map on paper [inch]."""
_ROOM = np.array([2.3, 0.9])
"""Room for the axis labels and the colour bar of a map [inch]."""
_TITLE_WIDTH = 50
"""Most characters in a line of the title of a map."""
SEEN = "seen from behind the plate"
CELL_PIXELS = 400
"""Pixels along the longer side of the cell."""
FEWEST_HITS = 64
"""Fewer hits are drawn as points: an image would suggest detail that they do not have."""
WIDEST_GAP = 3.0
"""Largest distance from a pixel to its hit, in mean hit spacings; random hits reach about 2."""
NO_VALUE, NOT_KNOWN = "0.9", "0.35"
"""Colours of hits without a value, as of a core that never passes, and of those whose computation failed."""
STATUS_COLOURS = (
    *("#D55E00", "#56B4E9", "#009E73", "#E69F00", "#000000", "#CC79A7", "#F0E442", "#0072B2", "#FFFFFF"),
    *("#882255", "#999933"),
)
"""Colours by the codes of `Status`: warm where the core comes through, cool where it is stopped or turned back, white
where it did not reach the layer."""
_OF_STATUS: Scale = ListedColormap(STATUS_COLOURS), Normalize(-0.5, len(STATUS_COLOURS) - 0.5)
SHARE_COLOURS = (STATUS_COLOURS[Status.ARRESTED], "#F5F5F5", STATUS_COLOURS[Status.PERFORATED])
"""Colours of a share from 0 to 1 that does harm."""
OF_SHARE: Scale = LinearSegmentedColormap.from_list("share", SHARE_COLOURS), Normalize(0.0, 100.0)
_PERFORATED = Measure.parse("P(perforated)")
_SIGNED = {v.AZIMUTH, v.IMPACT_PITCH, v.IMPACT_YAW, v.EDGE_DISTANCE, v.PITCH, v.YAW}


class Field(NamedTuple):
    """A variable as a map shows it.

    Attributes:
        values: in shown units, of shape [hits], or of shape [z, y] for an image of the cell; NaN where there is none.
        label: of the colour bar; empty for codes of status.
        title: of the map.
        signed: whether the colours are symmetric about a neutral zero.
        layer: the layer whose holes and ends are shown; None for the plate's holes and the target's ends.
        scale: colours; by default those of the values.
    """

    values: Array
    label: str
    title: str = ""
    signed: bool = False
    layer: int | None = None
    scale: Scale | None = None


def map_field(dataset: xarray.Dataset, variable: str, standoff: float | None = None, layer: int | None = None) -> Field:
    """A variable in the units in which it is shown.

    Args:
        dataset: the result of a campaign.
        variable: one of `variables.HIT_NUMBERS` or `variables.LAYER_NUMBERS`, or "perforated": the share that passes.
            Residual velocity and deflection are those of cores that pass the plate.
        standoff: distance behind the plate, or the layer, [m] for a variable that has one; the largest if None.
        layer: number of the layer for a variable that has layers, 0 the plate; the last one if None.

    Raises:
        ValueError: the variable cannot be mapped, or the Dataset has no such stand-off or layer.
    """
    mapped = [str(name) for name in (*v.HIT_NUMBERS, *v.LAYER_NUMBERS, v.PERFORATED) if name in dataset]
    if variable not in mapped:
        raise ValueError(f'"{variable}" cannot be mapped; choose one of {", ".join(mapped)}')
    share = share_that_passes(dataset)
    if variable == v.PERFORATED:
        title = f"share that passes the {target_word(dataset)}"
        return Field(100.0 * share, "share that passes [%]", title, scale=OF_SHARE)
    array = select_variable(dataset, variable, standoff, layer)
    unit = STORED[array.attrs["units"]]
    exists = np.isfinite(array.values) & (share > 0.0 if variable in OF_PASSED else True)
    title = name = words(variable.removeprefix("layer_"))
    if "standoff" in array.coords:
        title += f", {float(array[v.STANDOFF]) * MM:g} mm behind the {target_word(dataset)}"
    if variable in v.LAYER_NUMBERS:
        title += f", layer {int(dataset.sizes['layer']) - 1 if layer is None else layer}"
    meaning = f"\n{array.attrs['long_name']}" if array.attrs["long_name"] != title else ""
    title += ", by the fast law" if is_by_law(dataset, variable) else ""
    values = np.where(exists, array.values.astype(np.float64) * unit.factor, np.nan)
    return Field(values, f"{name} [{unit.shown}]", title + meaning, variable in _SIGNED, layer)


def status_field(dataset: xarray.Dataset, layer: int | None = None) -> Field:
    """How the shots ended, with the share of each end in the title; of an answer the most frequent end."""
    status = _statuses(dataset, layer)
    shares = ", ".join(f"{name} {np.mean(status == code):.1%}" for code, name in status_names(status).items())
    shown = "most frequent end" if layer is None and BY_ELEMENTS in dataset.coords else shares
    title = f"{'status' if layer is None else f'layer {layer}'}\n{shown}"
    return Field(status.astype(float), "", title, layer=layer, scale=_OF_STATUS)


def target_word(dataset: xarray.Dataset) -> str:
    """The word for what the shots are fired at: plate, or target if there are layers."""
    return "target" if v.LAYER_STATUS in dataset else "plate"


def words(name: str) -> str:
    """A name of a variable as words."""
    return name.replace("_", " ")


def computed_hits(dataset: xarray.Dataset) -> int:
    """Number of hits without their mirror images."""
    return int((dataset["image"] == 0).sum()) if "image" in dataset.coords else dataset.sizes["hit"]


def shots_text(result: Result) -> str:
    """Number of hits, the share that passes with its interval, velocity and obliquity, and by which method; whether the
    numerics exceed their tolerance."""
    dataset = mirrored(result)
    velocity, obliquity = (range_text(dataset[name]) for name in (v.IMPACT_VELOCITY, v.OBLIQUITY))
    parts = [count_text(computed_hits(dataset), "hit")]
    if BY_ELEMENTS in dataset.coords:
        count = int(dataset[BY_ELEMENTS].sum())
        parts[0] += f", {count} of them by finite elements" if count else " by the fast law alone"
    share = share_that_passes(dataset)
    if attr.LIMIT not in dataset.attrs and np.nanmin(share, initial=1.0) < 1.0:
        passes = estimated(result, [_PERFORATED])[_PERFORATED]
        parts.append(f"{interval_of(_PERFORATED, passes)} pass the {target_word(dataset)}")
    broken = ["numerics beyond their tolerance"] if exceeds_tolerance(dataset) else []
    return "; ".join([*parts, f"{velocity}, obliquity {obliquity}", *broken])


def range_text(array: xarray.DataArray) -> str:
    """The value that all hits share, or the range of the values, with its unit."""
    unit = STORED[array.attrs["units"]]
    lowest, highest = f"{array.values.min() * unit.factor:.4g}", unit.text(array.values.max(), ".4g")
    return highest if f"{lowest}{unit.suffix}" == highest else f"{lowest} to {highest}"


def to_one_cell(datasets: Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
    """Results of targets that are alike at every place, with cells as large as the largest other one."""
    uniform = [is_uniform(one) for one in datasets]
    periods = [np.asarray(one.attrs[attr.PLATE_PERIOD]) for one in datasets]
    largest = np.max([period for period, alike in zip(periods, uniform, strict=True) if not alike] or periods, axis=0)
    return [
        one.assign(
            {name: one[name] * ratio for name, ratio in zip((v.HIT_Y, v.HIT_Z), largest / period, strict=True)}
        ).assign_attrs({attr.PLATE_PERIOD: largest})
        if alike and not np.any(np.abs(hit_points(one)) > period / 2)
        else one
        for one, period, alike in zip(datasets, periods, uniform, strict=True)
    ]


def limits(*datasets: xarray.Dataset) -> Array:
    """Range [mm] along y and z that contains the cells of all results and every hit, shape [2, 2]."""
    halves = [np.asarray(dataset.attrs[attr.PLATE_PERIOD]) / 2 for dataset in datasets]
    points = np.concatenate([*(hit_points(dataset) for dataset in datasets), halves, np.negative(halves)])
    return np.stack([points.min(axis=0), points.max(axis=0)], axis=1) * MM


def map_size(*datasets: xarray.Dataset) -> Array:
    """Width and height of a map to scale [inch]."""
    extent = np.ptp(limits(*datasets), axis=1)
    return np.asarray(MAP_SIDE * extent / extent.max())


def map_sheet(datasets: Sequence[xarray.Dataset], columns: int) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for a map of each result, all to one scale."""
    figure, panels = sheet(len(datasets), columns, map_size(*datasets) + _ROOM)
    for axes in panels:
        to_scale(axes, *datasets)
    return figure, panels


def map_and_curve(dataset: xarray.Dataset) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for a map, to scale, and one for a curve right of it."""
    width, height = map_size(dataset)
    figure = Figure(figsize=(width + 7.6, max(height + 1.2, 4.4)), layout="constrained")
    panels = figure.subplots(1, 2, width_ratios=[width + 1.4, 5.2])
    to_scale(panels[0], dataset)
    return figure, list(panels)


def to_scale(axes: Axes, *datasets: xarray.Dataset) -> None:
    """Set axes to the cells of some results."""
    across, up = limits(*datasets)
    axes.set(xlim=across, ylim=up, xlabel="hit y [mm]", ylabel="hit z [mm]", aspect="equal")
    axes.autoscale(False)


def scale_of(columns: Sequence[Array], *, signed: bool = False) -> Scale:
    """One colour scale for all columns: symmetric about a neutral zero if the values have a sign; grey for NaN."""
    together = np.concatenate([np.ravel(column) for column in columns])
    finite = together[np.isfinite(together)]
    lowest, highest = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    if signed:
        highest = max(-lowest, highest)
        lowest = -highest
    elif np.isclose(lowest, highest):  # a scale from 0: it shows no rounding as a pattern
        lowest, highest = min(0.0, highest), max(0.0, highest) or 1.0
    colours = colormaps["RdBu_r" if signed else "viridis"].with_extremes(bad=NO_VALUE)
    return colours, Normalize(lowest, highest)


def draw_map(axes: Axes, dataset: xarray.Dataset, column: Field) -> ScalarMappable:
    """Draw a variable with its title, the holes and the fire, with labels for a legend; return the coloured artist.

    An image, and hits that cover the cell, are drawn as an image, other hits as points. A hit without a value is light,
    with how it ended as the label; one whose computation failed is dark. Hits by finite elements have an open marker.
    """
    values, scale = column.values, column.scale or scale_of([column.values], signed=column.signed)
    artist = _paint(axes, dataset, values, scale)
    colours = dict[str, str]()
    if column.scale is _OF_STATUS:
        colours = {name: STATUS_COLOURS[code] for code, name in status_names(values).items()}
    elif values.ndim == 1 and np.isnan(values).any():
        share, missing = share_that_passes(dataset), np.isnan(values)
        unknown = missing & np.isnan(share)
        if (without := missing & ~unknown).any():
            never = column.layer is None and share[without].max() == 0.0
            ends = ", ".join(status_names(_statuses(dataset, column.layer)[without]).values())
            colours[f"{'no core passes' if never else 'no value'}: {ends}"] = NO_VALUE
        if unknown.any():
            _paint(axes, dataset, np.where(unknown, 0.0, np.nan), (ListedColormap([NOT_KNOWN]), Normalize(0.0, 1.0)))
            colours["not known: the computation failed"] = NOT_KNOWN
    for label, colour in colours.items():
        axes.plot([], [], "s", color=colour, markeredgecolor="0.3", markersize=9, label=label)
    draw_hole_edges(axes, *outlines(dataset, column.layer or 0))
    if BY_ELEMENTS in dataset.coords and (by_elements := dataset[BY_ELEMENTS].values).any():
        y, z = hit_points(dataset)[by_elements].T * MM
        mark: dict[str, Any] = {"fillstyle": "none", "color": "white", "markersize": 6, "path_effects": _around(3.0)}
        axes.plot(y, z, "o", label="hit by finite elements", zorder=4, **mark)
    (left, right), (bottom, top) = limits(dataset)
    cell = Rectangle((left, bottom), right - left, top - bottom, transform=axes.transData)
    for line in axes.lines:
        line.set_clip_path(cell)
    if (fire := common_fire(dataset)) is not None:
        draw_fire(axes, fire)
    axes.set_title("\n".join(fill(line, _TITLE_WIDTH) for line in column.title.splitlines()), fontsize="medium")
    return artist


def _paint(axes: Axes, dataset: xarray.Dataset, values: Array, scale: Scale) -> ScalarMappable:
    """Colour an image of the cell, or each place by its nearest hit; hits that do not cover the cell are points."""
    if values.ndim == 2:
        return paint_pixels(axes, dataset, values, scale)
    if (places := nearest_hits(dataset)) is not None:
        return paint_pixels(axes, dataset, values[places], scale)
    point: dict[str, Any] = {"s": 36, "edgecolors": "black", "linewidths": 0.6, "plotnonfinite": True, "zorder": 3}
    y, z = hit_points(dataset).T * MM
    return axes.scatter(y, z, c=values, cmap=scale[0], norm=scale[1], **point)


def status_names(status: NDArray[Any]) -> dict[int, str]:
    """Words for the codes of status that occur."""
    return {int(code): words(code.name.lower()) for code in Status if np.any(status == code)}


def _statuses(dataset: xarray.Dataset, layer: int | None) -> NDArray[Any]:
    return dataset[v.STATUS].values if layer is None else dataset[v.LAYER_STATUS].values[:, layer]


def draw_hole_edges(axes: Axes, y: Array, z: Array) -> None:
    """Draw edges of holes [m], with a NaN between one hole and the next, visible on any colour."""
    if len(y):
        axes.plot(y * MM, z * MM, color="white", linewidth=1.2, path_effects=_around(2.8), label="edge of hole")


def _around(width: float) -> list[Any]:
    """Effects that make a white line visible on any colour."""
    return [Stroke(linewidth=width, foreground="black"), Normal()]


def pixels(dataset: xarray.Dataset, count: int = CELL_PIXELS) -> Array:
    """Centres [m] of the cell's pixels, `count` of them along its longer side, shape [z, y, 2]."""
    return np.stack(np.meshgrid(*axes_of(np.asarray(dataset.attrs[attr.PLATE_PERIOD]), count)), axis=-1)


def nearest(
    dataset: xarray.Dataset, points: Array, which: NDArray[np.bool_] | slice = slice(None), count: int | None = None
) -> tuple[Any, Any]:
    """Distances [m] and indices of the hits nearest to points [m], across the cell's edges."""
    period = np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    tree = KDTree((hit_points(dataset)[which] + period / 2) % period % period, boxsize=period)
    distances, places = tree.query(points + period / 2, k=count or 1)
    return distances, places


def nearest_hits(dataset: xarray.Dataset, count: int = CELL_PIXELS) -> NDArray[np.intp] | None:
    """Index of the hit nearest to each of the `pixels`, shape [z, y]; None if the hits do not cover the cell."""
    period, hits = np.asarray(dataset.attrs[attr.PLATE_PERIOD]), hit_points(dataset)
    if len(hits) < FEWEST_HITS or np.any(np.abs(hits) > period / 2):
        return None
    distance, places = nearest(dataset, pixels(dataset, count))
    return places if distance.max() <= WIDEST_GAP * np.sqrt(period.prod() / len(hits)) else None


def paint_pixels(axes: Axes, dataset: xarray.Dataset, image: Array, scale: Scale) -> ScalarMappable:
    """Colour the cell by an image of shape [z, y]."""
    y, z = np.asarray(dataset.attrs[attr.PLATE_PERIOD]) / 2 * MM
    cmap, norm = scale
    return axes.imshow(image, cmap=cmap, norm=norm, origin="lower", extent=(-y, y, -z, z), interpolation="nearest")
