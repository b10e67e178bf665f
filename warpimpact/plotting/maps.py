"""Maps of the outcomes of shots over the unit cell, to scale, and distributions along it and around nearby hits."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure as PlainFigure
from matplotlib.ticker import PercentFormatter

from warpimpact.analysis.correction import interval_of
from warpimpact.analysis.hit_map import (
    BY_ELEMENTS,
    deformed_hits,
    hit_points,
    mirrored,
    share_that_passes,
    symmetries_of,
)
from warpimpact.errors import OutputError
from warpimpact.measures.draws import Draws, ends_of_draws
from warpimpact.measures.estimates import by_hit_of, estimated
from warpimpact.measures.hits import hit_numbers, shot_variables
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import DRAWS, Result, as_dataset, as_plates, as_tree
from warpimpact.measures.vocabulary import has_base
from warpimpact.plotting.cell import (
    NO_VALUE,
    NOT_KNOWN,
    OF_SHARE,
    SEEN,
    Field,
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
from warpimpact.scene.units import MM, count_text

_MAIN = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
_MOST_COLUMNS = 3
_BANDS = {"5 to 95 %": (0.05, 0.95, 0.2), "25 to 75 %": (0.25, 0.75, 0.4)}
_SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles; the ends and the opacity of each band of them."""
_PER_STRIP, _MOST_STRIPS = 50, 48
"""Fewest hits of a strip, and most strips along an axis."""
_FINE = 100
"""Pixels along the longer side of a smoothed map."""
_NEIGHBOURS = 24
"""Number of hits about a place whose mean is the value there, where shots scatter."""
_POINTS = 60
"""Energies of a curve."""
_STRIP = 1.2
"""Width of a panel next to another one [inch]."""
_FRACTION, _PASSES = "mean(residual_energy_fraction)", Measure.parse("P(perforated)")
_BROKEN, _WHOLE = Measure.parse("P(broken)"), 99.9
"""Whether a core breaks; least share of the mass of a core that is whole [%]."""
_CURVES = (BLUE, "-"), (VERMILION, "--"), ("black", ":")
"""Colours and lines of a target and its references."""


@in_style
def variable_map(result: Result, variable: str, standoff: float | None = None) -> Figure:
    """Map of one variable over the hit points.

    Args:
        result: of a campaign.
        variable: a variable of `cell.map_field`, or "status": how the shots ended.
        standoff: distance behind the plate [m] for a variable that has one; the largest if None.

    Raises:
        ValueError: the variable cannot be mapped, all hits have one status, or the Dataset has no such stand-off.
    """
    dataset = mirrored(result)
    if variable != v.STATUS:
        return _maps(result, [map_field(dataset, variable, standoff)], 1)
    if len(names := status_names(dataset[v.STATUS].values)) == 1:
        raise ValueError(f'got "{variable}", but all hits are {names.popitem()[1]}; choose another variable')
    return _maps(result, [status_field(dataset)], 1)


@in_style
def measure_map(result: Result, text: str) -> Figure:
    """Map of a measure: of its quantity, or of a probability.

    A place has the mean of all draws. Where shots scatter, it is that of the nearest hits.

    Args:
        text: such as `mean(tilt@50mm)`, `P(bending_stress > 1.5 GPa)` or `P(base_perforated)`.

    Raises:
        ValueError: the text is no measure of hits, or the result does not have it.
    """
    measure = Measure.parse(text).of(as_dataset(result))
    if measure.kind == "target":
        raise ValueError(f'got "{text}", which is one number of the whole target')
    cell, values, note = _values_of_draws(result, measure)
    return _maps(result, [_mean_field(measure, values)], 1, note, cell=cell)


def _mean_field(measure: Measure, values: Array) -> Field:
    """Means of values of a measure over draws, in its display unit.

    Args:
        values: of shape [draws, hits] or [draws, z, y].
    """
    mean = _mean(values, axis=0)
    if not measure.is_binary:
        return Field(mean, measure.column.title, measure.column.label, signed=measure.bounds[0] < 0.0)
    harm, norm = OF_SHARE
    colours = {False: harm, True: harm.reversed(), None: colormaps["viridis"].with_extremes(bad=NO_VALUE)}
    scale = colours[measure.higher_is_better], norm
    return Field(100.0 * mean, "share [%]", measure.title, scale=scale)


def _values_of_draws(result: Result, measure: Measure, *, is_smooth: bool = False) -> tuple[xarray.Dataset, Array, str]:
    """The hits that are in every draw, with their images; values of a measure, in its display unit, and a note.

    Args:
        is_smooth: whether a place has the mean of the nearest hits, as it has where shots scatter.

    Returns:
        Values of shape [draws, hits], or means at the pixels of the cell, shape [draws, z, y]. In each draw the nearest
        hits count as often as a sample of them has them. Without draws the values are one.
    """
    cell, factor, draws = mirrored(result), measure.display.factor, Draws.of(result)
    if draws is None:
        values = factor * measure.values(cell)[None]
        return cell, values, "each hit has one outcome, 1 or 0" if measure.is_binary else ""
    drawn = as_tree(result).children[DRAWS].coords[v.DRAWN_HIT].values
    cell = cell.isel(hit=np.isin(hit_numbers(cell), drawn))
    signed, images = [name for name in v.hit_variables() if name.mirror and name in draws.every], list[Array]()
    for symmetry in symmetries_of(cell):
        changed = {name: getattr(symmetry, str(name.mirror)) * draws.every[name] for name in signed}
        images.append(draws.shaped(factor * measure.values(draws.every.assign(changed))))
    values = np.concatenate(images, axis=1)
    if not (is_smooth or shots_scatter(cell)) or nearest_hits(cell, _FINE) is None:
        return cell, values, ""
    _, near = nearest(cell, pixels(cell, _FINE), count=_NEIGHBOURS)
    samples = np.random.default_rng(0).integers(_NEIGHBOURS, size=(len(values), _NEIGHBOURS))
    places = [_mean(own[near[..., some]], axis=-1) for own, some in zip(values, samples, strict=True)]
    return cell, np.stack(places), f"mean of the {_NEIGHBOURS} nearest hits"


def _mean(values: Array, axis: int) -> Array:
    """Mean of the finite values along an axis; NaN without any."""
    return np.asarray(np.ma.masked_invalid(values).mean(axis=axis).filled(np.nan))


@in_style
def variable_maps(results: Mapping[str, Result], variable: str, standoff: float | None = None) -> Figure:
    """A map of one variable for several results side by side, by their names, with one scale of colour and length."""
    datasets = dict(zip(results, to_one_cell([*map(mirrored, results.values())]), strict=True))
    columns = [map_field(dataset, variable, standoff) for dataset in datasets.values()]
    scale = columns[0].scale or scale_of([column.values for column in columns], signed=columns[0].signed)
    figure, panels = map_sheet(list(datasets.values()), _MOST_COLUMNS)
    for axes, (name, dataset), column in zip(panels, datasets.items(), columns, strict=True):
        artist = draw_map(axes, dataset, column._replace(title=f"{name}\n{shots_text(results[name])}", scale=scale))
        if is_uniform(dataset):
            axes.set(xticks=[], yticks=[], xlabel="any place of a solid plate", ylabel="")
    figure.colorbar(artist, ax=panels, label=columns[0].label)
    note = f"{SEEN}s; colours and lengths to the same scale"
    return finish(figure, note, title=columns[0].title.partition("\n")[0], legend=True)


@in_style
def overview(result: Result) -> Figure:
    """Share that passes, or status, and residual velocity, deflection and tilt at the largest stand-off, with a legend.

    If all shots ended alike, the tilt at the smallest stand-off stands in place of the status, and the note says how
    they ended. Where all cores are stopped, the maps are those behind the plate, or of the time of contact.
    """
    dataset = mirrored(result)
    names, standoffs = status_names(dataset[v.STATUS].values), dataset[v.STANDOFF].values
    columns = [map_field(dataset, variable) for variable in _MAIN if variable != v.TILT or len(standoffs)]
    if is_open(dataset):
        how = "velocities and angles are means of the draws in which the core passes"
        return _maps(result, [map_field(dataset, v.PERFORATED), *columns], 2, how)
    if len(names) == 1 and len(standoffs) > 1:
        columns.insert(2, map_field(dataset, v.TILT, float(standoffs[0])))
    columns = [column for column in columns if np.isfinite(column.values).any()]
    if len(names) == 1:
        alike = f"all {', '.join(names.values())}"
        if not columns and v.LAYER_STATUS in dataset:
            columns = [map_field(dataset, variable, layer=0) for variable in v.LAYER_NUMBERS]
            alike += "; layer 0 is the plate"
        return _maps(result, columns or [map_field(dataset, v.ENERGY_LOSS)], 2, alike)
    return _maps(result, [status_field(dataset), *columns], 2)


def is_open(dataset: xarray.Dataset) -> bool:
    """Whether some cores pass in a part of the draws only."""
    share = share_that_passes(dataset)
    return bool(np.any((share > 0.0) & (share < 1.0)))


@in_style
def verdict(result: Result) -> Figure:
    """What decides: where cores pass the base, and how deep the others come.

    Without a base, or where nothing differs in it: where cores pass, or with which energy, and the share of hits
    above a residual energy, of the target and of its references.
    """
    cell, dataset = mirrored(result), as_dataset(result)
    measure = Measure.parse("P(base_perforated)" if has_base(dataset) else "P(perforated)")
    estimates = {
        name: estimated(plate, [measure])[measure] for name, plate in {"": result, **as_plates(result)}.items()
    }
    note = "; ".join(f"{name or measure.title} {interval_of(measure, share)}" for name, share in estimates.items())
    columns, notes = list[Field](), [note]
    if 0.0 < estimates[""].value < 1.0:
        by_place, values, how = _values_of_draws(result, measure)
        if values.ndim == 3 or is_open(cell):
            word = "base" if has_base(dataset) else target_word(dataset)
            shares = _mean_field(measure, values)._replace(title=f"share that passes the {word}")
            columns, notes, cell = [shares], [*notes, how], by_place
        else:
            columns = [status_field(cell)]
    if not has_base(dataset):
        fraction = Measure.parse(_FRACTION)
        if not columns:
            cell, values, _ = _values_of_draws(result, fraction)
            columns = [_mean_field(fraction, values)]
        return _with_energies(result, cell, columns[0], *notes)
    depth = _depth_in(cell, cell.sizes["layer"] - 1) if share_that_passes(cell).any() else map_field(cell, v.DEPTH)
    columns += [depth] if np.isfinite(depth.values).any() else []
    if not columns:
        columns = [map_field(cell, v.PERFORATED)]
    columns = [
        one._replace(layer=None, title=one.title.replace(f"layer {cell.sizes['layer'] - 1}", "base")) for one in columns
    ]
    return _maps(result, columns, len(columns), *notes, cell=cell)


def _with_energies(result: Result, cell: xarray.Dataset, column: Field, *notes: str) -> Figure:
    """A map beside the share of hits above a residual energy, of the target and of its references."""
    dataset, energy = as_dataset(result), Measure.parse("mean(residual_energy)")
    figure, (left, right) = map_and_curve(cell)
    artist = draw_map(left, cell, column)
    if column.label:
        figure.colorbar(artist, ax=left, label=column.label)
    plates = {target_word(dataset): result, **as_plates(result)}
    draws = {name: Draws.of(plate) for name, plate in plates.items()}
    energies = {
        name: by_hit_of(as_dataset(plate), energy)[None] if (own := draws[name]) is None else own.by_hit(energy)
        for name, plate in plates.items()
    }
    end = max(np.nanmax(values, initial=1.0) for values in energies.values())
    for (name, values), (colour, line) in zip(energies.items(), _CURVES, strict=False):
        style: dict[str, Any] = {"color": colour, "linestyle": line, "label": name}
        if (own := draws[name]) is None:
            known = np.sort(values[0][np.isfinite(values[0])])
            shares = np.append(np.linspace(1.0, 0.0, len(known) + 1), 0.0)
            right.step([0.0, *known, end], shares, where="post", **style)
            continue
        above = np.linspace(0.0, end, _POINTS)
        share = [own.estimate(_PASSES, values=np.where(np.isnan(values), np.nan, values > least)) for least in above]
        right.plot(above, [one.value for one in share], **style)
        ends = [one.low for one in share], [one.high for one in share]
        right.fill_between(above, *ends, color=colour, alpha=0.15, lw=0, label="95 % interval")
    furnish(right, legend=False, xlabel=energy.column.title, ylabel="share of the hits above this energy [%]")
    right.set_ylim(-0.02, 1.02)
    right.set_xlim(left=0.0)
    right.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
    return finish(figure, *notes, f"{shots_text(result)}; {SEEN}", result=dataset, legend=True, columns=6)


def _depth_in(dataset: xarray.Dataset, layer: int) -> Field:
    """Depth in a layer of the cores that it stops."""
    depth, stopped_in = map_field(dataset, v.DEPTH), dataset[v.STOPPED_IN].values
    values = np.where((stopped_in == layer) | (is_open(dataset) & (stopped_in < 0)), depth.values, np.nan)
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
    return _maps(result, [panel for row in rows for panel in row[first:]], 3 - first, "; ".join(notes))


def _maps(
    result: Result, columns: Sequence[Field | None], across: int, *notes: str, cell: xarray.Dataset | None = None
) -> Figure:
    """Maps of one result, row by row, with one legend; None leaves a place free.

    Args:
        cell: the hits that are mapped; by default all of them with their images.
    """
    cell = mirrored(result) if cell is None else cell
    figure, panels = map_sheet([cell] * len(columns), across)
    for axes, column in zip(panels, columns, strict=True):
        if column is None:
            axes.remove()
            continue
        artist = draw_map(axes, cell, column)
        if column.label and np.isfinite(column.values).any():
            figure.colorbar(artist, ax=axes, label=column.label)
    return finish(figure, *notes, f"{shots_text(result)}; {SEEN}", result=cell, legend=True, columns=2 * across)


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
    return finish(figure, column.title, f"{shots_text(result)}; {SEEN}", result=dataset, legend=True, columns=4)


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
    """A map of the mean of all draws, and of half the width of the 95 % interval at every place, by `Draws`.

    Raises:
        ValueError: the result has no draws, or the variable has none.
    """
    if Draws.of(result) is None:
        raise ValueError(f'got "{variable}" of a result without draws, so nothing says how uncertain it is')
    column = map_field(mirrored(result), variable, standoff)
    if variable not in v.DRAWN:
        raise ValueError(f'got "{variable}", but draws have {", ".join(v.DRAWN[1:])}')
    standoffs = as_dataset(result)[v.STANDOFF].values.tolist()
    at = f"@{standoff or standoffs[-1]!r}m" if v.STANDOFF in as_dataset(result)[variable].dims else ""
    measure = Measure.parse(f"mean({variable}{at})")
    cell, values, note = _values_of_draws(result, measure, is_smooth=True)
    half_width = np.diff(ends_of_draws(values, axis=0), axis=0)[0] / 2.0
    unit = f" [{column.label.partition('[')[2]}"
    fields = [
        _mean_field(measure, values)._replace(title=""),
        Field(half_width, f"half width of its 95 % interval{unit}"),
    ]
    return _maps(result, fields, 2, column.title.partition("\n")[0], note, cell=cell)


@in_style
def breaks(result: Result) -> Figure:
    """Where cores of hits by finite elements stayed whole, lost their tip or broke, and P(broken) of the result.

    In a draw the cores of all other hits break with one probability, so it has no map.

    Raises:
        ValueError: the result has no hits by finite elements of cores that deform.
    """
    hits, cell = deformed_hits(result), mirrored(result).drop_vars(BY_ELEMENTS, errors="ignore")
    if hits is None:
        raise ValueError("got a result without hits by finite elements of cores that deform")
    broken, share = hits[v.BROKEN].values > 0.0, 100.0 * (hits[v.FRAGMENT_MASS] / hits[v.MASS]).values
    is_known = np.isfinite(share)
    kinds = {
        "whole": ("o", is_known & ~broken & (share >= _WHOLE)),
        "tip lost": ("^", is_known & ~broken & (share < _WHOLE)),
        "broken": ("X", is_known & broken),
    }
    figure, (axes,) = map_sheet([cell], 1)
    share_of_draws = interval_of(_BROKEN, estimated(result, [_BROKEN])[_BROKEN])
    title = f"where cores break by finite elements\nP(broken) at every place: {share_of_draws}"
    draw_map(axes, cell, Field(np.full((1, 1), np.nan), "", title))
    y, z = hit_points(hits).T * MM
    colours: dict[str, Any] = {"cmap": "viridis", "vmin": 0.0, "vmax": 100.0, "edgecolors": "black", "zorder": 5}
    for label, (marker, which) in kinds.items():
        name = f"{label}: {count_text(int(which.sum()), 'hit')}"
        artist = axes.scatter(y[which], z[which], 80, share[which], marker=marker, label=name, **colours)
    if bad := int((~is_known).sum()):
        axes.plot(y[~is_known], z[~is_known], "s", color=NOT_KNOWN, label=f"failed: {count_text(bad, 'hit')}", zorder=5)
    figure.colorbar(artist, ax=axes, label="leading fragment [% of the mass]")
    return finish(figure, f"{shots_text(result)}; {SEEN}", result=cell, legend=True, columns=2)


def shots_scatter(dataset: xarray.Dataset) -> bool:
    """Whether shots differ in more than their hit point."""
    return any(np.ptp(dataset[name].values) > 0.0 for name in shot_variables(dataset))


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
    share = share_that_passes(dataset)
    figures: dict[str, PlainFigure] = {"overview": overview(result)}
    if attr.LIMIT not in dataset.attrs:  # its outcomes are those of the slowest cores that passed
        figures["verdict"] = verdict(result)
    variables = [*([v.PERFORATED] if np.any(share < 1.0) else []), *v.shown_by("plot")]
    for variable in (name for name in variables if name in dataset and every):
        for standoff in dataset[v.STANDOFF].values.tolist() if v.STANDOFF in variable.dims else [None]:
            if np.isfinite(map_field(dataset, variable, standoff).values).any():
                name = variable if standoff is None else f"{variable}_{standoff * MM:g}mm"
                figures[name] = variable_map(result, variable, standoff)
    if deformed_hits(result) is not None:
        figures["breaks"] = breaks(result)
    if every and share.any():
        figures["marginals"] = marginals(result, v.RESIDUAL_VELOCITY)
    if every and DRAWS in as_tree(result).children and share.any():
        figures["uncertainty"] = uncertainty(result, v.RESIDUAL_VELOCITY)
    if every and v.LAYER_STATUS in dataset:
        figures["layers"] = layers_figure(result)
    return save_all(figures, folder, stem, overwrite=overwrite)


def save_side_by_side(
    results: Mapping[str, Result], folder: Path, stem: str, *, every: bool = False, overwrite: bool = False
) -> list[Path]:
    """Write maps of residual velocity and tilt of several results side by side, and of the share that passes where it
    differs; with `every` of deflection, too."""
    with_tilt = all(result.sizes["standoff"] for result in results.values())
    some_stop = any((share_that_passes(as_dataset(result)) < 1.0).any() for result in results.values())
    chosen = {
        v.PERFORATED: some_stop,
        v.RESIDUAL_VELOCITY: True,
        v.DEFLECTION: every or not with_tilt,
        v.TILT: with_tilt,
    }
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
