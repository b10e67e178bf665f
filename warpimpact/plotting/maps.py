"""Maps of the outcomes of shots over their hit points, drawn to scale over the unit cell of the plate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray
from matplotlib.figure import Figure as PlainFigure

from warpimpact.analysis.hit_map import mirrored
from warpimpact.plotting.cell import (
    SEEN,
    Shown,
    draw_map,
    draw_status,
    map_sheet,
    scale_of,
    shots_text,
    shown,
    status_names,
)
from warpimpact.plotting.distribution import dispersion, is_uncertain, marginals, probability_map, uncertainty
from warpimpact.plotting.style import Figure, finish, in_style
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed
from warpimpact.results.files import OutputError
from warpimpact.results.measures import Measure
from warpimpact.scene.display import MM

_MAIN = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
_MOST_COLUMNS = 3


@in_style
def variable_map(dataset: xarray.Dataset, variable: str, standoff: float | None = None) -> Figure:
    """Map of one variable over the hit points; hits without a value are grey.

    Args:
        dataset: the result of a campaign.
        variable: a variable of `cell.shown`, or "status": how the shots ended.
        standoff: distance behind the plate [m] for a variable that has one; the largest if None.

    Raises:
        ValueError: the variable cannot be mapped, or the Dataset has no such stand-off.
    """
    dataset = mirrored(dataset)
    return _maps(dataset, [(None if variable == v.STATUS else shown(dataset, variable, standoff), None)], 1)


@in_style
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
    return _maps(dataset, [(column, None)], 1)


@in_style
def variable_maps(datasets: Mapping[str, xarray.Dataset], variable: str, standoff: float | None = None) -> Figure:
    """A map of one variable for several results side by side, by their names, with one scale of colour and length."""
    datasets = {name: mirrored(dataset) for name, dataset in datasets.items()}
    columns = [shown(dataset, variable, standoff) for dataset in datasets.values()]
    scale = scale_of([column.values for column in columns], signed=columns[0].signed)
    figure, panels = map_sheet(list(datasets.values()), min(_MOST_COLUMNS, len(datasets)))
    for axes, (name, dataset), column in zip(panels, datasets.items(), columns, strict=True):
        artist = draw_map(axes, dataset, column._replace(title=f"{name}\n{shots_text(dataset)}"), scale)
    figure.colorbar(artist, ax=panels, label=columns[0].label)
    note = f"{SEEN}s; colours and lengths to the same scale"
    finish(figure, note, title=columns[0].title.partition("\n")[0], legend=True)
    return figure


@in_style
def overview(dataset: xarray.Dataset) -> Figure:
    """Residual velocity, deflection, tilt at the largest stand-off, and status, with one legend.

    If all shots ended alike, the tilt at the smallest stand-off stands in place of the status, and the note says how
    they ended.
    """
    dataset = mirrored(dataset)
    names, standoffs = status_names(dataset[v.STATUS].values), dataset[v.STANDOFF].values
    columns = [shown(dataset, variable) for variable in _MAIN if variable != v.TILT or len(standoffs)]
    if len(names) == 1 and len(standoffs) > 1:
        columns.insert(2, shown(dataset, v.TILT, float(standoffs[0])))
    panels: list[_Panel] = [(column, None) for column in columns if np.isfinite(column.values).any()]
    if panels and len(names) == 1:
        return _maps(dataset, panels, 2, f"; all {', '.join(names.values())}")
    return _maps(dataset, [*panels, (None, None)], 2)


@in_style
def layers_figure(dataset: xarray.Dataset) -> Figure:
    """A row of maps for each layer: how the cores ended in it, and their velocity and tilt behind it.

    A layer that no core left shows their depth. Where all cores ended alike, the note says so in place of a map.
    """
    dataset = mirrored(dataset)
    rows, alike = list[list[_Panel | None]](), ""
    for layer in range(dataset.sizes["layer"]):
        columns = [shown(dataset, variable, layer=layer) for variable in v.LAYER_NUMBERS]
        if not np.isfinite(columns[0].values).any():
            depth = shown(dataset, v.DEPTH)
            values = np.where(dataset[v.STOPPED_IN].values == layer, depth.values, np.nan)
            title = f"depth in layer {layer}\nthat any point of the core reached"
            columns = [depth._replace(values=values, title=title)]
        names = status_names(dataset[v.LAYER_STATUS].values[:, layer])
        if len(names) == 1:
            alike += f"; layer {layer}: all {', '.join(names.values())}"
        status: _Panel | None = (None, layer) if len(names) > 1 else None
        rows.append([status, *((column, layer) for column in columns), None][:3])
    first = 0 if any(row[0] for row in rows) else 1
    panels = [panel for row in rows for panel in row[first:]]
    return _maps(dataset, panels, 3 - first, f"; layer 0 is the plate{alike}")


_Panel = tuple[Shown | None, int | None]
"""A variable, or None for the status, and the layer of a map."""


def _maps(dataset: xarray.Dataset, panels: Sequence[_Panel | None], columns: int, note: str = "") -> Figure:
    """Maps of one result, row by row, with one legend; None leaves a place free."""
    figure, places = map_sheet([dataset] * len(panels), columns)
    for axes, panel in zip(places, panels, strict=True):
        if panel is None:
            axes.remove()
            continue
        column, layer = panel
        if column is None:
            draw_status(axes, dataset, layer)
            continue
        artist = draw_map(axes, dataset, column, layer=layer)
        if np.isfinite(column.values).any():
            figure.colorbar(artist, ax=axes, label=column.label)
    finish(figure, f"{shots_text(dataset)}; {SEEN}{note}", result=dataset, legend=True, columns=2 * columns)
    return figure


def save_maps(dataset: xarray.Dataset, folder: Path, stem: str, *, overwrite: bool = False) -> list[Path]:
    """Write the figures of one result as PNG files ``<stem>_<figure>.png`` and return their paths. Figures without
    values are left out.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    dataset = mirrored(dataset)
    figures: dict[str, PlainFigure] = {"overview": overview(dataset)}
    for variable in (name for name in v.shown_by("plot") if name in dataset):
        at_standoffs = v.STANDOFF in variable.dims
        for standoff in dataset[v.STANDOFF].values.tolist() if at_standoffs else [None]:
            name = variable if standoff is None else f"{variable}_{standoff * MM:g}mm"
            if np.isfinite(shown(dataset, variable, standoff).values).any():
                figures[name] = variable_map(dataset, variable, standoff)
    if passed(dataset).any():
        figures["marginals"] = marginals(dataset, v.RESIDUAL_VELOCITY)
        if dataset.sizes["standoff"]:
            figures["dispersion"] = dispersion(dataset)
    if is_uncertain(dataset):
        figures["uncertainty"] = uncertainty(dataset, v.RESIDUAL_VELOCITY)
    if v.LAYER_STATUS in dataset:
        figures["layers"] = layers_figure(dataset)
    return save_all(figures, folder, stem, overwrite=overwrite)


def save_beside(
    datasets: Mapping[str, xarray.Dataset], folder: Path, stem: str, *, overwrite: bool = False
) -> list[Path]:
    """Write maps of several results side by side as PNG files ``<stem>_<map>.png`` and return their paths.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    with_tilt = all(dataset.sizes["standoff"] for dataset in datasets.values())
    variables = [variable for variable in _MAIN if variable != v.TILT or with_tilt]
    figures: dict[str, PlainFigure] = {variable: variable_maps(datasets, variable) for variable in variables}
    return save_all(figures, folder, stem, overwrite=overwrite)


def save_all(figures: Mapping[str, PlainFigure], folder: Path, stem: str, *, overwrite: bool) -> list[Path]:
    """Write figures as PNG files ``<stem>_<name>.png`` and return their paths.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = {folder / f"{stem}_{name}.png": figure for name, figure in figures.items()}
    if not overwrite and (existing := next(filter(Path.exists, paths), None)):
        raise OutputError(f"{existing}: exists already; name another folder or give --overwrite")
    for path, figure in paths.items():
        figure.savefig(path, dpi=150)
    return list(paths)
