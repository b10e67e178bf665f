"""Maps of what a shot does over where it hits, drawn to scale over the unit cell of the plate.

Hits that cover the cell are drawn as an image in which every pixel has the colour of the nearest hit, counted
across the cell's edges; hits that are few or leave gaps are drawn as points. The view is against the line of
fire, from behind the plate: y to the right, z up, x towards the viewer.
"""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import ScaledTranslation
from scipy.spatial import KDTree

from warpimpact.results import BENDING_VARIABLES, OUTCOME_VARIABLES, SHOT_VARIABLES, passed, status_codes

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from numpy.typing import NDArray

MAPPED = tuple(
    name
    for name, variable in (SHOT_VARIABLES | OUTCOME_VARIABLES | BENDING_VARIABLES).items()
    if name != "status" and variable.dims in {("hit",), ("hit", "standoff")}
)

PIXELS = 400  # along the longer side of the cell
FEWEST_HITS = 64  # fewer are drawn as points: an image would suggest detail that is not there
WIDEST_GAP = 3.0  # distance to a hit that an image bridges, in mean hit spacings; random hits reach about 2

_SIGNED = {"azimuth", "impact_pitch", "impact_yaw", "pitch", "yaw"}
_BEHIND = {"residual_velocity", "deflection"}  # a ricochet has them too, but in front of the plate
_GREY = "0.62"
_MM = 1e3
# Sizes on paper [inch]: the longer side of a map, the room round it, the title and the note of a sheet.
_LONGER_SIDE = 4.2
_LEFT, _RIGHT, _ABOVE, _BELOW = 0.75, 1.15, 0.55, 1.2
_NARROWEST_PANEL = 5.4  # holds the legend
_HEAD, _FOOT = 0.5, 0.3
# Units as people write them, and the factor from those of the Dataset.
_SHOWN_UNITS = {
    "m s-1": (" m/s", 1.0),
    "rad s-1": (" rad/s", 1.0),
    "degree": ("°", 1.0),
    "J": (" J", 1.0),
    "s": (" µs", 1e6),
    "N m": (" N m", 1.0),
    "Pa": (" GPa", 1e-9),
    "m": (" mm", 1e3),
}
# Okabe and Ito's colours, which stay apart in every kind of colour blindness.
_STATUS_COLOURS = ("#56B4E9", "#D55E00", "#F0E442", "#009E73", "#000000", "#CC79A7", "#E69F00")


def hit_map(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """Map of one variable of the Dataset over the hit points; hits without a value are grey.

    Args:
        dataset: The result of a campaign.
        variable: One of `MAPPED`. Residual velocity and deflection are shown for cores that passed the plate.
        standoff: Distance behind the plate [m] for a variable that has one; the largest if None.

    Raises:
        ValueError: The variable cannot be mapped, or the Dataset has no such stand-off.
    """
    figure, (axes,) = _sheet(dataset, rows=1, columns=1)
    _draw_values(axes, dataset, variable, standoff)
    return figure


def status_map(dataset: xarray.Dataset) -> Figure:
    """Map of how the shots ended, with the share of each status."""
    figure, (axes,) = _sheet(dataset, rows=1, columns=1)
    _draw_status(axes, dataset)
    return figure


def overview(dataset: xarray.Dataset) -> Figure:
    """Residual velocity, deflection, tilt at the largest stand-off, and status on one page."""
    figure, (*axes, last) = _sheet(dataset, rows=2, columns=2)
    for panel, variable in zip(axes, ("residual_velocity", "deflection", "tilt"), strict=True):
        _draw_values(panel, dataset, variable, None)
    _draw_status(last, dataset)
    return figure


def save_maps(dataset: xarray.Dataset, folder: Path, stem: str) -> list[Path]:
    """Write the overview and the single maps as PNG files ``<stem>_<map>.png`` and return their paths."""
    figures = {
        "overview": overview(dataset),
        "status": status_map(dataset),
        "residual_velocity": hit_map(dataset, "residual_velocity"),
        "deflection": hit_map(dataset, "deflection"),
    }
    for standoff in dataset["standoff"].values:
        figures[f"tilt_{standoff * _MM:g}mm"] = hit_map(dataset, "tilt", standoff)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures.items():
        paths.append(folder / f"{stem}_{name}.png")
        figure.savefig(paths[-1], dpi=150)
    return paths


def _sheet(dataset: xarray.Dataset, *, rows: int, columns: int) -> tuple[Figure, list[Axes]]:
    """Figure that says which campaign it shows, with maps that are to scale, row by row.

    The maps show the whole cell and every hit. Their size follows from that extent; the room round them is
    the same on every figure, so that maps of one plate can be laid side by side.
    """
    extent = np.stack([_limits(dataset, "y"), _limits(dataset, "z")])
    map_width, map_height = _LONGER_SIDE * np.ptp(extent, axis=1) / np.ptp(extent, axis=1).max()
    panel_width = max(_LEFT + map_width + _RIGHT, _NARROWEST_PANEL)
    panel_height = _ABOVE + map_height + _BELOW
    width, height = columns * panel_width, _HEAD + rows * panel_height + _FOOT
    figure = Figure(figsize=(width, height))
    axes = []
    for row, column in np.ndindex(rows, columns):
        left = column * panel_width + _LEFT + (panel_width - _LEFT - map_width - _RIGHT) / 2
        bottom = _FOOT + (rows - 1 - row) * panel_height + _BELOW
        place = (left / width, bottom / height, map_width / width, map_height / height)
        axes.append(figure.add_axes(place, xlim=extent[0], ylim=extent[1], xlabel="hit y [mm]", ylabel="hit z [mm]"))
    figure.suptitle(dataset.attrs.get("title", ""), y=1.0 - 0.12 / height, va="top", wrap=True)
    velocity, obliquity = (_range_text(dataset[name]) for name in ("impact_velocity", "obliquity"))
    note = f"{dataset.sizes['hit']} hits, {velocity}, obliquity {obliquity}; seen from behind the plate"
    figure.supxlabel(note, y=0.12 / height, va="bottom", fontsize="small", color="0.3")
    return figure, axes


def _limits(dataset: xarray.Dataset, axis: str) -> tuple[float, float]:
    """Range [mm] along y or z that holds the whole cell and every hit."""
    half = dataset.attrs["plate_period"]["yz".index(axis)] / 2
    hits = dataset[f"hit_{axis}"].values
    return min(-half, hits.min()) * _MM, max(half, hits.max()) * _MM


def _range_text(array: xarray.DataArray) -> str:
    """The value that all hits share, or the range of the values, with its unit."""
    unit, factor = _SHOWN_UNITS[array.attrs["units"]]
    lowest, highest = f"{array.values.min() * factor:.4g}", f"{array.values.max() * factor:.4g}"
    return f"{lowest}{unit}" if lowest == highest else f"{lowest} to {highest}{unit}"


def _draw_values(axes: Axes, dataset: xarray.Dataset, variable: str, standoff: float | None) -> None:
    """Draw one variable with its colour bar."""
    array = _selected(dataset, variable, standoff)
    unit, factor = _SHOWN_UNITS[array.attrs["units"]]
    exists = np.isfinite(array.values) & (passed(dataset) if variable in _BEHIND else True)
    values = np.where(exists, array.values * factor, np.nan)
    artist = _paint(axes, dataset, values, *_scale(values, signed=variable in _SIGNED))
    if exists.any():
        _add_colour_bar(axes, artist, f"{_words(variable)} [{unit.strip()}]")
    entries: list[Artist] = []
    if not exists.all():
        entries.append(Patch(facecolor=_GREY, label=_without_value(dataset, exists)))
    title = _words(variable)
    if "standoff" in array.coords:
        title += f", {float(array['standoff']) * _MM:g} mm behind the plate"
    if array.attrs["long_name"] != title:
        title += f"\n{array.attrs['long_name']}"
    _furnish(axes, dataset, title, entries)


def _selected(dataset: xarray.Dataset, variable: str, standoff: float | None) -> xarray.DataArray:
    """The variable, shape (hit,), at one stand-off if it has any."""
    if variable not in MAPPED:
        raise ValueError(f'"{variable}" cannot be mapped; choose one of {", ".join(MAPPED)}')
    array = dataset[variable]
    if "standoff" not in array.dims:
        return array
    distances = dataset["standoff"].values
    index = distances.size - 1 if standoff is None else int(np.argmin(np.abs(distances - standoff)))
    if standoff is not None and not np.isclose(distances[index], standoff):
        known = ", ".join(f"{distance:g}" for distance in distances)
        raise ValueError(f"the result has no stand-off of {standoff:g} m; it has {known} m")
    return array.isel(standoff=index)


def _scale(values: NDArray[np.float64], *, signed: bool) -> tuple[Colormap, Normalize]:
    """Colours for the values: symmetric about a neutral zero if they have a sign; grey for NaN."""
    finite = values[np.isfinite(values)]
    if signed:
        highest = np.max(np.abs(finite), initial=0.0)
        lowest = -highest
    else:
        lowest, highest = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
        if np.isclose(lowest, highest):
            lowest = highest  # rounding is no pattern
    colours = colormaps["RdBu_r" if signed else "viridis"].with_extremes(bad=_GREY)
    return colours, Normalize(lowest, highest)


def _without_value(dataset: xarray.Dataset, exists: NDArray[np.bool_]) -> str:
    """Legend of the grey hits: how they ended."""
    found = set(dataset["status"].values[~exists].tolist())
    return fill(", ".join(_words(name) for name, code in status_codes(dataset).items() if code in found), 30)


def _draw_status(axes: Axes, dataset: xarray.Dataset) -> None:
    """Draw how the shots ended, with the share of each status in the legend."""
    status = dataset["status"].values
    codes = status_codes(dataset)
    scale = Normalize(-0.5, len(_STATUS_COLOURS) - 0.5)
    _paint(axes, dataset, status.astype(float), ListedColormap(_STATUS_COLOURS), scale)
    entries: list[Artist] = [
        Patch(facecolor=_STATUS_COLOURS[code], label=f"{_words(name)} {np.mean(status == code):.1%}")
        for name, code in codes.items()
        if np.any(status == code)
    ]
    _furnish(axes, dataset, "status", entries)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _paint(
    axes: Axes, dataset: xarray.Dataset, values: NDArray[np.float64], colours: Colormap, scale: Normalize
) -> ScalarMappable:
    """Colour the cell by values of the hits, shape (hit,): as an image if hits cover it, else as points."""
    nearest = _nearest_hits(dataset)
    if nearest is not None:
        y, z = np.asarray(dataset.attrs["plate_period"]) / 2 * _MM
        return axes.imshow(
            values[nearest],
            cmap=colours,
            norm=scale,
            origin="lower",
            extent=(-y, y, -z, z),
            interpolation="nearest",
        )
    y, z = dataset["hit_y"].values * _MM, dataset["hit_z"].values * _MM
    return axes.scatter(
        y,
        z,
        c=values,
        cmap=colours,
        norm=scale,
        s=36,
        edgecolors="black",
        linewidths=0.6,
        plotnonfinite=True,
        zorder=3,
    )


def _nearest_hits(dataset: xarray.Dataset) -> NDArray[np.intp] | None:
    """Index of the hit nearest to each pixel of the cell, shape (z, y); None if the hits do not cover it."""
    period = np.asarray(dataset.attrs["plate_period"])
    hits = np.stack([dataset["hit_y"].values, dataset["hit_z"].values], axis=-1)
    if len(hits) < FEWEST_HITS or np.any(np.abs(hits) > period / 2):
        return None
    counts = np.ceil(PIXELS * period / period.max()).astype(int)
    y, z = ((np.arange(count) + 0.5) / count * length for count, length in zip(counts, period, strict=True))
    pixels = np.stack(np.meshgrid(y, z), axis=-1)
    distance, nearest = KDTree((hits + period / 2) % period, boxsize=period).query(pixels)
    spacing = np.sqrt(period.prod() / len(hits))
    return nearest if distance.max() <= WIDEST_GAP * spacing else None


def _add_colour_bar(axes: Axes, artist: ScalarMappable, label: str) -> None:
    """Add a colour bar beside the map and as high as the map."""
    figure, place = axes.figure, axes.get_position()
    inch = figure.dpi / figure.bbox.width
    bar = figure.add_axes((place.x1 + 0.18 * inch, place.y0, 0.17 * inch, place.height))
    figure.colorbar(artist, cax=bar, label=label)


def _furnish(axes: Axes, dataset: xarray.Dataset, title: str, entries: list[Artist]) -> None:
    """Add hole outlines that show on any colour, title and legend."""
    if dataset.sizes["vertex"]:
        (edge,) = axes.plot(
            dataset["outline_y"] * _MM,
            dataset["outline_z"] * _MM,
            color="white",
            linewidth=1.2,
            path_effects=[Stroke(linewidth=2.8, foreground="black"), Normal()],
            label="edge of hole",
        )
        entries = [*entries, edge]
    axes.set_aspect("equal")
    axes.set_title(title, fontsize="medium")
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
