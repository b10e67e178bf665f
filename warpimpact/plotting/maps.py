"""Maps of the outcomes of shots over their hit points, drawn to scale over the unit cell of the plate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpimpact.analysis.hit_map import mirrored
from warpimpact.plotting.cell import Scale, Shown, draw_status, draw_values, limits, scale_of, shots_text, shown, words
from warpimpact.plotting.distribution import (
    dispersion,
    is_uncertain,
    marginals,
    probability_map,
    uncertainty,
)
from warpimpact.plotting.style import LINE, MAP_SIDE, add_heading, names, note_lines
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed, status_codes
from warpimpact.results.files import OutputError
from warpimpact.results.measures import Measure
from warpimpact.scene.display import MM

_MAIN = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
# Sizes on paper [inch]: the longer side of the largest map, the room round it, the title and the note of a sheet.
_LEFT, _RIGHT, _ABOVE, _BELOW = 0.75, 1.15, 0.55, 1.2
_NARROWEST_PANEL = 5.4  # holds the legend
_HEAD, _FOOT = 0.5, 0.3
_BELOW_NO_LEGEND, _FOOT_WITH_LEGEND = 0.65, 0.85
_MOST_COLUMNS = 3


def variable_map(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """Map of one variable of the Dataset over the hit points; hits without a value are grey. Args and errors are those
    of `cell.shown`."""
    dataset = mirrored(dataset)
    figure, (axes,) = _sheet_of_one(dataset, maps=1, columns=1)
    _draw(axes, dataset, shown(dataset, variable, standoff))
    return figure


def measure_map(dataset: xarray.Dataset, text: str) -> Figure:
    """Map of a measure: of a probability from the nearest hits (`probability_map`), or of its quantity.

    Raises:
        ValueError: the text is no measure of hits, or the result does not have it.
    """
    dataset = mirrored(dataset)
    measure = Measure.parse(text).of(dataset)
    if measure.is_binary:
        return probability_map(dataset, text)
    if measure.kind == "target":
        raise ValueError(f'got "{text}", which is one number of the whole target')
    values = measure.display.factor * measure.by_hit(dataset)
    finite = np.where(np.isfinite(values), values, np.nan)
    column = Shown(finite, measure.axis, measure.column.label, signed=measure.least < 0.0)
    figure, (axes,) = _sheet_of_one(dataset, maps=1, columns=1)
    _draw(axes, dataset, column)
    return figure


def variable_maps(datasets: Mapping[str, xarray.Dataset], variable: str, standoff: float | None = None) -> Figure:
    """A map of one variable for several results, by the names of their maps, side by side, in the same colours and to
    the same scale."""
    datasets = {name: mirrored(dataset) for name, dataset in datasets.items()}
    columns = [shown(dataset, variable, standoff) for dataset in datasets.values()]
    scale = scale_of([column.values for column in columns], signed=columns[0].signed)
    title, *_ = columns[0].title.splitlines()
    notes = ("seen from behind the plates; colours and lengths to the same scale",)
    figure, panels = _sheet(list(datasets.values()), min(_MOST_COLUMNS, len(datasets)), title, notes)
    last = len(panels) - 1
    for place, (axes, (name, dataset), column) in enumerate(zip(panels, datasets.items(), columns, strict=True)):
        _draw(axes, dataset, column._replace(title=f"{name}\n{shots_text(dataset)}"), scale, bar=place == last)
    _share_legend(figure, panels)
    return figure


def status_map(dataset: xarray.Dataset) -> Figure:
    """Map of how the shots ended, with the share of each status."""
    dataset = mirrored(dataset)
    figure, (axes,) = _sheet_of_one(dataset, maps=1, columns=1)
    draw_status(axes, dataset)
    return figure


def overview(dataset: xarray.Dataset) -> Figure:
    """Residual velocity, deflection, tilt at the largest stand-off, and status on one page, with one legend.

    If all shots ended alike, the tilt at the smallest stand-off stands in place of the status, and the note says how
    they ended.
    """
    dataset = mirrored(dataset)
    statuses, standoffs = np.unique(dataset[v.STATUS].values), dataset[v.STANDOFF].values
    columns = [shown(dataset, variable) for variable in _MAIN if variable != v.TILT or len(standoffs)]
    if len(statuses) == 1 and len(standoffs) > 1:
        columns.insert(2, shown(dataset, v.TILT, float(standoffs[0])))
    columns = [column for column in columns if np.isfinite(column.values).any()]
    names = {code: words(name) for name, code in status_codes(dataset).items()}
    alike = f"; all {names[int(statuses[0])]}" if len(statuses) == 1 and columns else ""
    figure, panels = _sheet_of_one(dataset, maps=len(columns) + (not alike), columns=2, note=alike)
    for axes, column in zip(panels, columns, strict=False):
        _draw(axes, dataset, column)
    if not alike:
        draw_status(panels[-1], dataset)
    _share_legend(figure, panels)
    return figure


def layers_figure(dataset: xarray.Dataset) -> Figure:
    """A row of maps for each layer: how the cores ended in it, and their velocity and tilt behind it. A layer that no
    core left shows their depth."""
    dataset = mirrored(dataset)
    layers = dataset.sizes["layer"]
    figure, panels = _sheet_of_one(dataset, maps=3 * layers, columns=3, note="; layer 0 is the plate")
    for layer, (status, *others) in enumerate(zip(*[iter(panels)] * 3, strict=True)):
        draw_status(status, dataset, layer)
        columns = [shown(dataset, variable, layer=layer) for variable in v.LAYER_NUMBERS]
        if not np.isfinite(columns[0].values).any():
            columns = [_depth_in(dataset, layer)]
        for axes, column in zip(others, columns, strict=False):
            _draw(axes, dataset, column, layer=layer)
        for axes in others[len(columns) :]:
            axes.remove()
    _share_legend(figure, panels)
    return figure


def _depth_in(dataset: xarray.Dataset, layer: int) -> Shown:
    column = shown(dataset, v.DEPTH)
    values = np.where(dataset[v.STOPPED_IN].values == layer, column.values, np.nan)
    return column._replace(values=values, title=f"depth in layer {layer}\nthat any point of the core reached")


def save_maps(dataset: xarray.Dataset, folder: Path, stem: str, *, overwrite: bool = False) -> list[Path]:
    """Write the figures of one result as PNG files ``<stem>_<figure>.png`` and return their paths. Figures without
    values are left out.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    dataset = mirrored(dataset)
    figures: dict[str, Figure] = {
        "overview": overview(dataset),
        "status": status_map(dataset),
    }
    for variable in (name for name in v.shown_by("plot") if name in dataset):
        at_standoffs = v.STANDOFF in variable.dims
        for standoff in dataset[v.STANDOFF].values.tolist() if at_standoffs else [None]:
            name = variable if standoff is None else f"{variable}_{standoff * MM:g}mm"
            if np.isfinite(shown(dataset, variable, standoff).values).any():
                figures[name] = variable_map(dataset, variable, standoff)
    behind = bool(passed(dataset).any())
    if behind:
        figures["marginals"] = marginals(dataset, v.RESIDUAL_VELOCITY)
    if behind and dataset.sizes["standoff"]:
        figures["dispersion"] = dispersion(dataset)
    if is_uncertain(dataset):
        figures["uncertainty"] = uncertainty(dataset, v.RESIDUAL_VELOCITY)
    if v.LAYER_STATUS in dataset:
        figures["layers"] = layers_figure(dataset)
    return _saved(figures, folder, stem, overwrite=overwrite)


def save_beside(
    datasets: Mapping[str, xarray.Dataset], folder: Path, stem: str, *, overwrite: bool = False
) -> list[Path]:
    """Write maps of several results side by side as PNG files ``<stem>_<map>.png`` and return their paths.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    there = all(dataset.sizes["standoff"] for dataset in datasets.values())
    figures: dict[str, Figure] = {
        variable: variable_maps(datasets, variable) for variable in _MAIN if variable != v.TILT or there
    }
    return _saved(figures, folder, stem, overwrite=overwrite)


def _saved(figures: Mapping[str, Figure], folder: Path, stem: str, *, overwrite: bool) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = {folder / f"{stem}_{name}.png": figure for name, figure in figures.items()}
    if not overwrite and (existing := next(filter(Path.exists, paths), None)):
        raise OutputError(f"{existing}: exists already; name another folder or give --overwrite")
    for path, figure in paths.items():
        figure.savefig(path, dpi=150)
    return list(paths)


def _sheet_of_one(dataset: xarray.Dataset, *, maps: int, columns: int, note: str = "") -> tuple[Figure, list[Axes]]:
    """A sheet for several maps of one result, with title and note."""
    notes = f"{shots_text(dataset)}; seen from behind the plate{note}", *names(dataset)
    return _sheet([dataset] * maps, columns, str(dataset.attrs.get(attr.TITLE, "")), notes)


def _sheet(
    datasets: Sequence[xarray.Dataset], columns: int, title: str, notes: Sequence[str]
) -> tuple[Figure, list[Axes]]:
    """Figure with a place for a map of each result, row by row, all to one scale, with its title and notes.

    The maps show the whole cell and every hit. Their size follows from that extent; the room round them is
    the same on every figure, so that maps of one plate can be laid side by side.
    """
    below, foot = (_BELOW, _FOOT) if len(datasets) == 1 else (_BELOW_NO_LEGEND, _FOOT_WITH_LEGEND)
    extents = np.array([np.ptp(limits(dataset), axis=1) for dataset in datasets])
    sizes = MAP_SIDE * extents / extents.max()
    rows, (widest, tallest) = -(-len(datasets) // columns), sizes.max(axis=0)
    panel_width = max(_LEFT + widest + _RIGHT, _NARROWEST_PANEL)
    panel_height = _ABOVE + tallest + below
    width = columns * panel_width
    foot += LINE * max(0, len(note_lines(width, title, notes)) - 1)
    height = _HEAD + rows * panel_height + foot
    figure = Figure(figsize=(width, height))
    add_heading(figure, title, *notes)
    panels = []
    for number, (map_width, map_height) in enumerate(sizes):
        row, column = divmod(number, columns)
        left = column * panel_width + _LEFT + (panel_width - _LEFT - map_width - _RIGHT) / 2
        bottom = foot + (rows - 1 - row) * panel_height + below + (tallest - map_height) / 2
        panels.append(figure.add_axes((left / width, bottom / height, map_width / width, map_height / height)))
    return figure, panels


def _share_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """One legend above the note for all maps, with every entry once, in place of one below each map."""
    entries: dict[str, Artist] = {}
    for legend in filter(None, (axes.get_legend() for axes in panels)):
        labels = (text.get_text() for text in legend.get_texts())
        entries |= {label: handle for label, handle in zip(labels, legend.legend_handles, strict=True) if handle}
        legend.remove()
    if entries:
        place = (0.5, (0.3 + LINE * figure.get_supxlabel().count("\n")) / figure.get_figheight())
        figure.legend(
            entries.values(), entries, loc="lower center", bbox_to_anchor=place, ncols=len(entries), frameon=False
        )


def _draw(
    axes: Axes,
    dataset: xarray.Dataset,
    column: Shown,
    scale: Scale | None = None,
    *,
    bar: bool = True,
    layer: int | None = None,
) -> None:
    """Draw one variable with its title, and with a colour bar beside the map and as high as it."""
    scale = scale or scale_of([column.values], signed=column.signed)
    artist = draw_values(axes, dataset, column.values, scale, layer)
    axes.set_title(column.title, fontsize="medium")
    if bar and np.isfinite(column.values).any():
        figure, place = axes.figure, axes.get_position()
        inch = figure.dpi / figure.bbox.width
        beside = figure.add_axes((place.x1 + 0.18 * inch, place.y0, 0.17 * inch, place.height))
        figure.colorbar(artist, cax=beside, label=column.label)
