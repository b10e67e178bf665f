"""Maps of the outcomes of shots over the unit cell, to scale, and distributions along it and around nearby hits."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure as PlainFigure
from matplotlib.ticker import PercentFormatter
from numpy.typing import NDArray

from warpimpact.analysis.hit_map import NEIGHBOURS, hit_points, mirrored, plane_fit, share_of
from warpimpact.analysis.numbers import interval_text
from warpimpact.errors import OutputError
from warpimpact.measures.estimates import by_hit_of, estimated
from warpimpact.measures.hits import failed, passed, shot_variables
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import Result, as_dataset, as_plates
from warpimpact.plotting.cell import (
    SEEN,
    Field,
    Scale,
    draw_map,
    map_and_curve,
    map_field,
    map_sheet,
    map_size,
    nearest,
    nearest_hits,
    pixels,
    scale_of,
    shots_text,
    status_field,
    status_names,
    target_word,
    to_one_cell,
    to_scale,
)
from warpimpact.plotting.style import BLUE, VERMILION, Figure, finish, furnish, in_style
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import is_uniform
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM

_MAIN = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
_MOST_COLUMNS = 3
_BANDS = {"5 to 95 %": (0.05, 0.95, 0.2), "25 to 75 %": (0.25, 0.75, 0.4)}
_SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles; the ends and the opacity of each band of them."""
_PER_STRIP, _MOST_STRIPS = 50, 48
"""Fewest hits of a strip, and most strips along an axis."""
_FINE = 100
"""Pixels along the longer side of a smoothed map."""
_WHOLE = scale_of([np.array([0.0, 1.0])])
"""Scale of a share."""
_SHARE_NOTE = f"share of the {NEIGHBOURS} nearest hits, Wilson's interval"
_STRIP = 1.2
"""Width of a panel next to another one [inch]."""
_FRACTION = "mean(residual_energy_fraction)"
_CURVES = (BLUE, "-"), (VERMILION, "--"), ("black", ":")
"""Colours and lines of a target and its references."""


@in_style
def variable_map(result: Result, variable: str, standoff: float | None = None) -> Figure:
    """Map of one variable over the hit points; hits without a value are grey.

    Args:
        result: of a campaign.
        variable: a variable of `cell.map_field`, or "status": how the shots ended.
        standoff: distance behind the plate [m] for a variable that has one; the largest if None.

    Raises:
        ValueError: the variable cannot be mapped, all hits have one status, or the Dataset has no such stand-off.
    """
    dataset = mirrored(result)
    if variable != v.STATUS:
        return _maps(dataset, [map_field(dataset, variable, standoff)], 1)
    if len(names := status_names(dataset[v.STATUS].values)) == 1:
        raise ValueError(f'got "{variable}", but all hits are {names.popitem()[1]}; choose another variable')
    return _maps(dataset, [status_field(dataset)], 1)


@in_style
def measure_map(result: Result, text: str) -> Figure:
    """Map of a measure: of its quantity, or of a probability.

    Where shots scatter, a probability is the share of the nearest hits, with half the width of its 95 % interval
    (`hit_map.share_of`).

    Args:
        text: such as `mean(tilt@50mm)`, `P(bending_stress > 1.5 GPa)` or `P(base_perforated)`.

    Raises:
        ValueError: the text is no measure of hits, the result does not have it, or its hits do not cover the cell.
    """
    dataset = mirrored(result)
    measure = Measure.parse(text).of(dataset)
    if measure.kind == "target":
        raise ValueError(f'got "{text}", which is one number of the whole target')
    if not measure.is_binary:
        return _maps(dataset, [_measure_field(dataset, measure)], 1)
    if not shots_scatter(dataset):
        image = Field(measure.values(dataset)[_covered(dataset)], text, scale=_WHOLE)
        return _maps(dataset, [image], 1, "each hit has one outcome, 1 or 0; nearest hit")
    return _maps(dataset, _local_shares(dataset, measure), 2, _SHARE_NOTE)


def _measure_field(dataset: xarray.Dataset, measure: Measure) -> Field:
    """The quantity of a measure, in its display unit."""
    values, column = measure.display.factor * measure.by_hit(dataset), measure.column
    finite = np.where(np.isfinite(values), values, np.nan)
    return Field(finite, column.title, column.label, signed=measure.bounds[0] < 0.0)


def _local_shares(dataset: xarray.Dataset, measure: Measure) -> list[Field]:
    """Share of the nearest hits in which an event occurs."""
    return _local(dataset, measure.values(dataset), lambda near: share_of(near[1]), measure.title, scale=_WHOLE)


@in_style
def variable_maps(results: Mapping[str, Result], variable: str, standoff: float | None = None) -> Figure:
    """A map of one variable for several results side by side, by their names, with one scale of colour and length."""
    datasets = dict(zip(results, to_one_cell([*map(mirrored, results.values())]), strict=True))
    columns = [map_field(dataset, variable, standoff) for dataset in datasets.values()]
    scale = scale_of([column.values for column in columns], signed=columns[0].signed)
    figure, panels = map_sheet(list(datasets.values()), _MOST_COLUMNS)
    for axes, (name, dataset), column in zip(panels, datasets.items(), columns, strict=True):
        artist = draw_map(axes, dataset, column._replace(title=f"{name}\n{shots_text(dataset)}", scale=scale))
        if is_uniform(dataset):
            axes.set(xticks=[], yticks=[], xlabel="any place of a solid plate", ylabel="")
    figure.colorbar(artist, ax=panels, label=columns[0].label)
    note = f"{SEEN}s; colours and lengths to the same scale"
    return finish(figure, note, title=columns[0].title.partition("\n")[0], legend=True)


@in_style
def overview(result: Result) -> Figure:
    """Residual velocity, deflection, tilt at the largest stand-off, and status, with one legend.

    If all shots ended alike, the tilt at the smallest stand-off stands in place of the status, and the note says how
    they ended. Where all cores are stopped, the maps are those behind the plate, or of the time of contact.
    """
    dataset = mirrored(result)
    names, standoffs = status_names(dataset[v.STATUS].values), dataset[v.STANDOFF].values
    columns = [map_field(dataset, variable) for variable in _MAIN if variable != v.TILT or len(standoffs)]
    if len(names) == 1 and len(standoffs) > 1:
        columns.insert(2, map_field(dataset, v.TILT, float(standoffs[0])))
    columns = [column for column in columns if np.isfinite(column.values).any()]
    if len(names) == 1:
        alike = f"all {', '.join(names.values())}"
        if not columns and v.LAYER_STATUS in dataset:
            columns = [map_field(dataset, variable, layer=0) for variable in v.LAYER_NUMBERS]
            alike += "; layer 0 is the plate"
        return _maps(dataset, columns or [map_field(dataset, v.CONTACT_DURATION)], 2, alike)
    return _maps(dataset, [*columns, status_field(dataset)], 2)


@in_style
def verdict(result: Result) -> Figure:
    """What decides: where cores pass the base, and how deep the others come.

    Without a base, or where nothing differs in it: where cores pass, or with which energy, and the share of hits
    above a residual energy, of the target and of its references.
    """
    cell = mirrored(result)
    base = cell.sizes["layer"] - 1 if v.LAYER_STATUS in cell else None
    measure = Measure.parse("P(perforated)" if base is None else "P(base_perforated)")
    share = estimated(result, [measure])[measure]
    note = f"{measure.title} {share.value:.1%}, 95 % interval {interval_text(share.low, share.high, digits='.1%')}"
    for name, reference in as_plates(result).items():
        note += f"; {name} {estimated(reference, [measure])[measure].value:.1%}"
    columns, notes = list[Field](), [note]
    if 0.0 < share.value < 1.0 and shots_scatter(cell) and nearest_hits(cell, _FINE) is not None:
        columns, notes = _local_shares(cell, measure), [*notes, _SHARE_NOTE]
    elif 0.0 < share.value < 1.0:
        columns = [status_field(cell, base)]
    if base is not None:
        depth = _depth_in(cell, base) if passed(cell).any() else map_field(cell, v.DEPTH)
        columns += [depth] if np.isfinite(depth.values).any() else []
    if base is None or not columns:
        return _with_energies(result, (columns or [_measure_field(cell, Measure.parse(_FRACTION))])[0], *notes)
    columns = [one._replace(layer=None, title=one.title.replace(f"layer {base}", "base")) for one in columns]
    return _maps(cell, columns, len(columns), *notes)


def _with_energies(result: Result, column: Field, *notes: str) -> Figure:
    """A map beside the share of hits above a residual energy, of the target and of its references."""
    dataset, cell, energy = as_dataset(result), mirrored(result), Measure.parse("mean(residual_energy)")
    figure, (left, right) = map_and_curve(cell)
    artist = draw_map(left, cell, column)
    if column.label:
        figure.colorbar(artist, ax=left, label=column.label)
    plates = {target_word(dataset): dataset, **as_plates(result)}
    energies = {name: np.sort(by_hit_of(plate, energy)[~failed(plate)]) for name, plate in plates.items()}
    end = max(values.max(initial=1.0) for values in energies.values())
    for (name, values), (colour, line) in zip(energies.items(), _CURVES, strict=False):
        shares = np.append(np.linspace(1.0, 0.0, len(values) + 1), 0.0)
        right.step([0.0, *values, end], shares, where="post", color=colour, linestyle=line, label=name)
    furnish(right, legend=False, xlabel=energy.column.title, ylabel="share of the hits above this energy [%]")
    right.set_ylim(-0.02, 1.02)
    right.set_xlim(left=0.0)
    right.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
    text = f"{shots_text(cell)}; {SEEN}"
    return finish(figure, *notes, text, result=dataset, legend=True, columns=6)


def _depth_in(dataset: xarray.Dataset, layer: int) -> Field:
    """Depth in a layer of the cores that it stops."""
    depth = map_field(dataset, v.DEPTH)
    values = np.where(dataset[v.STOPPED_IN].values == layer, depth.values, np.nan)
    title = f"depth in layer {layer}\nthat any point of the core reached"
    return depth._replace(values=values, title=title, layer=layer)


@in_style
def layers_figure(result: Result) -> Figure:
    """A row of maps for each layer: how the cores ended in it, and their velocity and tilt behind it.

    A layer that no core left shows their depth. Where all cores ended alike, the note says so in place of a map.
    """
    dataset = mirrored(result)
    rows, notes = list[list[Field | None]](), ["layer 0 is the plate"]
    for layer in range(dataset.sizes["layer"]):
        columns = [map_field(dataset, variable, layer=layer) for variable in v.LAYER_NUMBERS]
        if not np.isfinite(columns[0].values).any():
            columns = [_depth_in(dataset, layer)]
        names = status_names(dataset[v.LAYER_STATUS].values[:, layer])
        if len(names) == 1:
            notes.append(f"layer {layer}: all {', '.join(names.values())}")
        rows.append([status_field(dataset, layer) if len(names) > 1 else None, *columns, None][:3])
    first = 0 if any(row[0] for row in rows) else 1
    return _maps(dataset, [panel for row in rows for panel in row[first:]], 3 - first, "; ".join(notes))


def _maps(dataset: xarray.Dataset, columns: Sequence[Field | None], across: int, *notes: str) -> Figure:
    """Maps of one result, row by row, with one legend; None leaves a place free."""
    figure, panels = map_sheet([dataset] * len(columns), across)
    for axes, column in zip(panels, columns, strict=True):
        if column is None:
            axes.remove()
            continue
        artist = draw_map(axes, dataset, column)
        if column.label and np.isfinite(column.values).any():
            figure.colorbar(artist, ax=axes, label=column.label)
    text = f"{shots_text(dataset)}; {SEEN}"
    return finish(figure, *notes, text, result=dataset, legend=True, columns=2 * across)


@in_style
def marginals(result: Result, variable: str, standoff: float | None = None) -> Figure:
    """A map with the distribution of its values along y, along z, and over the whole cell.

    Strips of the cell with equal numbers of hits give the median and the middle 50 % and 90 %. Arguments and errors are
    those of `cell.map_field`.
    """
    dataset = mirrored(result)
    column = map_field(dataset, variable, standoff)
    figure, panels = _with_margins(map_size(dataset))
    centre, above, right, histogram = (panels[name] for name in ("centre", "above", "right", "histogram"))
    to_scale(centre, dataset)
    artist = draw_map(centre, dataset, column._replace(title=""))
    exists = np.isfinite(column.values)
    values, points = column.values[exists], hit_points(dataset)[exists] * MM
    if len(values):
        _draw_strips(above, points[:, 0], values, upright=False)
        _draw_strips(right, points[:, 1], values, upright=True)
        histogram.hist(values, bins=min(40, 4 + len(values) // 20), orientation="horizontal", color=BLUE, alpha=0.5)
        histogram.axhline(np.median(values), color="black", lw=1.2)
        figure.colorbar(artist, ax=histogram, location="left", aspect=25, pad=0.0).set_ticks([])
        histogram.set(ylim=artist.get_clim() if np.ptp(values) else None, xlabel="hits", ylabel=column.label)
        histogram.yaxis.tick_right()
        histogram.yaxis.set_label_position("right")
    above.set_ylabel(column.label.replace(" [", "\n["))
    right.set_xlabel(column.label.replace(" [", "\n["))
    return finish(figure, column.title, f"{shots_text(dataset)}; {SEEN}", result=dataset, legend=True, columns=4)


def _with_margins(size: Array) -> tuple[Figure, dict[str, Axes]]:
    """A figure with a panel of this size [inch], panels above and right of it, and a histogram further right, with
    heights of its own."""
    figure = Figure(figsize=(size[0] + 2 * _STRIP + 2.4, size[1] + _STRIP + 1.0), layout="compressed")
    ratios: dict[str, Any] = {"width_ratios": [size[0], _STRIP, _STRIP], "height_ratios": [_STRIP, size[1]]}
    panels = figure.subplot_mosaic([["above", ".", "."], ["centre", "right", "histogram"]], **ratios)
    panels["above"].sharex(panels["centre"])
    panels["right"].sharey(panels["centre"])
    panels["above"].tick_params(labelbottom=False)
    panels["right"].tick_params(labelleft=False)
    return figure, panels


@in_style
def uncertainty(result: Result, variable: str, standoff: float | None = None) -> Figure:
    """A map of the mean of neighbouring hits, and of half the width of its 95 % interval (`hit_map.plane_fit`).

    Shots must scatter, so that two shots at one place differ; otherwise neighbours say nothing about uncertainty.

    Raises:
        ValueError: nothing is uncertain, the hits do not cover the cell, or the variable cannot be mapped.
    """
    dataset = mirrored(result)
    column = map_field(dataset, variable, standoff)
    if not shots_scatter(dataset):
        raise ValueError(f'got "{variable}" of shots that all arrive alike, so nothing is uncertain')
    label, unit = f"local mean of {column.label}", f" [{column.label.partition('[')[2]}"
    columns = _local(dataset, column.values, lambda near: plane_fit(*near)[:2], label, unit)
    method = f"plane through the {NEIGHBOURS} nearest hits, Student's interval; bends of the map widen it"
    return _maps(dataset, columns, 2, column.title, method)


def shots_scatter(dataset: xarray.Dataset) -> bool:
    """Whether shots differ in more than their hit point."""
    return any(np.ptp(dataset[name].values) > 0.0 for name in shot_variables(dataset))


def _covered(dataset: xarray.Dataset) -> NDArray[np.intp]:
    """Index of the hit nearest to every pixel. Raises ValueError if the hits do not cover the cell."""
    if (places := nearest_hits(dataset, _FINE)) is None:
        raise ValueError("the hits do not cover the cell, so there is no estimate between them; more hits are needed")
    return places


def _local(
    dataset: xarray.Dataset,
    values: Array,
    estimate: Callable[[tuple[Array, Array]], tuple[Array, Array]],
    label: str,
    unit: str = "",
    scale: Scale | None = None,
) -> list[Field]:
    """Local estimates at every pixel, and half the widths of their intervals.

    Both are NaN where the nearest hit has no value. `estimate` computes both from offsets [m] and values of the nearest
    hits with a value.
    """
    exists, period = np.isfinite(values), np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    there = exists[_covered(dataset)]
    images = np.full((2, *there.shape), np.nan)
    if exists.sum() >= NEIGHBOURS:
        points = pixels(dataset, _FINE)[there]
        _, near = nearest(dataset, points, exists, NEIGHBOURS)
        offsets = hit_points(dataset)[exists][near] - points[:, None]
        images[:, there] = estimate((offsets - period * np.round(offsets / period), values[exists][near]))
    return [Field(images[0], label, scale=scale), Field(images[1], f"half width of its 95 % interval{unit}")]


def _draw_strips(axes: Axes, places: Array, values: Array, *, upright: bool) -> None:
    """Draw quantiles of the values against their places; `upright` puts the places on the vertical axis."""
    strips = np.array_split(np.argsort(places), np.clip(len(places) // _PER_STRIP, 1, _MOST_STRIPS))
    middles = [places[strip].mean() for strip in strips]
    quantiles = {share: [np.quantile(values[strip], share) for strip in strips] for share in _SHARES}
    band: Any = axes.fill_betweenx if upright else axes.fill_between
    for label, (low, high, alpha) in _BANDS.items():
        band(middles, quantiles[low], quantiles[high], color=BLUE, alpha=alpha, lw=0, label=label)
    median = (quantiles[0.5], middles) if upright else (middles, quantiles[0.5])
    axes.plot(*median, color="black", lw=1.2, label="median")


def save_maps(result: Result, folder: Path, stem: str, *, every: bool = False, overwrite: bool = False) -> list[Path]:
    """Write the overview and the verdict of a result as PNG files ``<stem>_<figure>.png``; return their paths.

    Args:
        every: whether to write all figures that have values.

    Raises:
        OutputError: one of them exists, and must not be replaced.
    """
    dataset = mirrored(result)
    figures: dict[str, PlainFigure] = {"overview": overview(dataset)}
    if attr.LIMIT not in dataset.attrs:  # its outcomes are those of the slowest cores that passed
        figures["verdict"] = verdict(result)
    for variable in (name for name in v.shown_by("plot") if name in dataset and every):
        for standoff in dataset[v.STANDOFF].values.tolist() if v.STANDOFF in variable.dims else [None]:
            if np.isfinite(map_field(dataset, variable, standoff).values).any():
                name = variable if standoff is None else f"{variable}_{standoff * MM:g}mm"
                figures[name] = variable_map(dataset, variable, standoff)
    if every and passed(dataset).any():
        figures["marginals"] = marginals(dataset, v.RESIDUAL_VELOCITY)
    if every and shots_scatter(dataset) and nearest_hits(dataset) is not None:
        figures["uncertainty"] = uncertainty(dataset, v.RESIDUAL_VELOCITY)
    if every and v.LAYER_STATUS in dataset:
        figures["layers"] = layers_figure(dataset)
    return save_all(figures, folder, stem, overwrite=overwrite)


def save_side_by_side(
    results: Mapping[str, Result], folder: Path, stem: str, *, every: bool = False, overwrite: bool = False
) -> list[Path]:
    """Write maps of residual velocity and tilt of several results side by side; with `every` of deflection, too."""
    with_tilt = all(result.sizes["standoff"] for result in results.values())
    chosen = {v.RESIDUAL_VELOCITY: True, v.DEFLECTION: every or not with_tilt, v.TILT: with_tilt}
    figures = {str(name): variable_maps(results, name) for name, is_drawn in chosen.items() if is_drawn}
    return save_all(figures, folder, stem, overwrite=overwrite)


def save_all(figures: Mapping[str, PlainFigure], folder: Path, stem: str, *, overwrite: bool) -> list[Path]:
    """Write figures as `save_maps` does."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = {folder / f"{stem}_{name}.png": figure for name, figure in figures.items()}
    if not overwrite and (existing := next(filter(Path.exists, paths), None)):
        raise OutputError(f"{existing}: exists already; name another folder or give --overwrite")
    for path, figure in paths.items():
        figure.savefig(path, dpi=150)
    return list(paths)
