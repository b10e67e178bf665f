"""Data of the hits for the page of a report: their numbers, the pixels of the map, and some trajectories."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from warpimpact.analysis.hit_map import (
    BY_ELEMENTS,
    hit_points,
    is_by_law,
    marked,
    mirrored,
    share_that_passes,
    symmetries_of,
)
from warpimpact.analysis.replay_geometry import runs_of, slabs
from warpimpact.kernels.status import Status
from warpimpact.measures.hits import hit_numbers
from warpimpact.measures.references import Result, pictures_of
from warpimpact.plotting.cell import (
    OF_SHARE,
    SHARE_COLOURS,
    STATUS_COLOURS,
    Field,
    limits,
    map_field,
    nearest_hits,
    words,
)
from warpimpact.plotting.style import common_fire
from warpimpact.plotting.trajectory import Pose, poses_behind, poses_in_plate, silhouette
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.dataset import is_uniform, outlines
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM
from warpimpact.solver.accuracy import spread_places

MOST_HITS = 12_000
"""Most hits on a page, for all results together: about 1 MB, compressed."""
WORST_SHARE = 0.25
"""Share of the trajectories that show the worst hits; the others are spread evenly."""
PAGE_PIXELS = 160
"""Pixels along the longer side of a map."""
MOST_PICTURED = 128
"""Most hits of a result that have pictures on a page: 3 kB each."""
LABEL_COLOURS = {
    v.PictureLabel.CORE: "#0072b2",
    v.PictureLabel.JACKET: "#e69f00",
    v.PictureLabel.FILLER: "#4d4d4d",
    v.PictureLabel.PLATE: "#b3b3b3",
    v.PictureLabel.LAYER: "#d4c3a5",
}
"""Colours of what pictures show; air has that of the page."""
SHARE = "share that passes"
"""Name of the share of the draws in which a core passes."""
_BY_LAW = ", by the fast law"  # after the name of a variable that draws do not have
_CORE_BEHIND = "#707070"  # colour of the core behind the plate
_TURN = 1.5  # turn of an outline from point to point [degree]; its error is 0.01 mm of a core's profile


def thinned(result: Result, most: int, *, keep: Sequence[int] = ()) -> xarray.Dataset:
    """The hits of a page, loaded, with their mirror images.

    If there are more than `most`, those by finite elements and those in `keep` stay and others are chosen at random.
    Hits at a constant step in a grid or a Sobol sampling would leave out parts of the cell.
    """
    dataset = marked(result)
    places, most = np.arange(dataset.sizes["hit"]), most // len(symmetries_of(dataset))
    if len(places) > most:
        kept = np.flatnonzero(np.isin(hit_numbers(dataset), keep) | _by_elements(dataset))
        others = np.setdiff1d(places, kept)
        chosen = np.random.default_rng(0).choice(others, most - len(kept), replace=False)
        places = np.union1d(chosen, kept)
    return mirrored(dataset.assign_coords(hit=hit_numbers(dataset)).isel(hit=places).load())


def _by_elements(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Whether each hit is one by finite elements of an answer."""
    known = dataset.coords.get(BY_ELEMENTS)
    return np.zeros(dataset.sizes["hit"], dtype=bool) if known is None else np.asarray(known.values)


def worst_and_spread(dataset: xarray.Dataset, count: int, *, first: Sequence[int] = ()) -> list[int]:
    """Numbers of the hits that get a trajectory: those in `first`, those with the largest residual velocity, then
    repeatedly the hit that is farthest from all chosen ones, with distances across the cell's edges."""
    velocity = map_field(dataset, v.RESIDUAL_VELOCITY).values
    worst = np.argsort(-np.nan_to_num(velocity, nan=-1.0), kind="stable")[: round(WORST_SHARE * count)]
    numbers = dataset["hit"].values
    place_of = {number: place for place, number in enumerate(numbers.tolist())}
    chosen = list(dict.fromkeys([*(place_of[number] for number in first), *worst.tolist()]))[:count]
    points, period = hit_points(dataset), np.asarray(dataset.attrs[attr.PLATE_PERIOD])
    distance = np.full(len(points), np.inf)

    def step_back(hit: int) -> None:
        offset = points - points[hit]
        np.minimum(distance, np.linalg.norm(offset - period * np.round(offset / period), axis=1), out=distance)

    for hit in chosen:
        step_back(hit)
    while len(chosen) < count and distance.max() > 0.0:
        chosen.append(int(distance.argmax()))
        step_back(chosen[-1])
    return [int(number) for number in numbers[chosen]]


def page_data(datasets: Sequence[xarray.Dataset], pixels: int = PAGE_PIXELS) -> dict[str, Any]:
    """Data of the maps of a page: the variables, and the hits of each result in shown units.

    Args:
        datasets: results from `thinned`.
        pixels: pixels along the longer side of a map.
    """
    columns, shown = [_columns(dataset) for dataset in datasets], (SHARE, *map(words, v.shown_by("report")))
    shared = {key: column for key, column in columns[0].items() if all(key in others for others in columns)}
    return {
        "variables": [
            {"key": key, "label": column.label, "signed": column.signed, "share": column.scale is OF_SHARE}
            for key, column in shared.items()
        ],
        "main": [key for key in shared if key.startswith(shown) and not key.endswith(_BY_LAW)],
        "labels": {code.value: [words(code.name.lower()), colour] for code, colour in LABEL_COLOURS.items()},
        "share": SHARE,
        "share_colours": SHARE_COLOURS,
        "statuses": [
            {
                "code": status.value,
                "label": words(status.name.lower()),
                "colour": STATUS_COLOURS[status],
                "failed": status.failed,
            }
            for status in Status
            if any((dataset[v.STATUS].values == status).any() for dataset in datasets)
        ],
        "results": [
            _map_data(dataset, {key: column[key].values for key in shared}, pixels)
            for dataset, column in zip(datasets, columns, strict=True)
        ],
    }


def _columns(dataset: xarray.Dataset) -> dict[str, Field]:
    """The share that passes where it differs, all outcomes, and the shot variables that differ from hit to hit, by
    their shown names."""
    share, columns = share_that_passes(dataset), dict[str, Field]()
    if np.nanmin(share, initial=1.0) < min(1.0, np.nanmax(share, initial=1e-9)) or np.any(
        (share > 0.0) & (share < 1.0)
    ):
        columns[SHARE] = map_field(dataset, v.PERFORATED)
    for variable in (name for name in v.HIT_NUMBERS if name in dataset):
        at_standoff = v.STANDOFF in dataset[variable].dims
        for standoff in dataset[v.STANDOFF].values.tolist() if at_standoff else [None]:
            column = map_field(dataset, variable, standoff)
            if variable not in (*v.SHOT_VARIABLES, v.EDGE_DISTANCE) or np.ptp(column.values) > 0.0:
                name = words(variable) + ("" if standoff is None else f" at {standoff * MM:g} mm")
                name += _BY_LAW if is_by_law(dataset, variable) else ""
                columns[name] = column._replace(label=f"{name} [{column.label.partition('[')[2]}")
    for variable in (name for name in v.LAYER_NUMBERS if name in dataset):
        for layer in range(dataset.sizes["layer"] - (BY_ELEMENTS in dataset.coords)):
            column = map_field(dataset, variable, layer=layer)
            if np.isfinite(column.values).any():
                name, _, _ = column.title.partition("\n")
                columns[name] = column._replace(label=f"{name} [{column.label.partition('[')[2]}")
    return columns


def _map_data(dataset: xarray.Dataset, columns: dict[str, Array], pixels: int) -> dict[str, Any]:
    nearest = nearest_hits(dataset, pixels)
    y, z = hit_points(dataset).T * MM
    return {
        "period": _rounded(np.asarray(dataset.attrs[attr.PLATE_PERIOD]) * MM),
        "limits": limits(dataset).tolist(),
        "fire": None if (fire := common_fire(dataset)) is None else fire._asdict(),
        "uniform": is_uniform(dataset),
        "outline": [_rounded(outline * MM) for outline in outlines(dataset)],
        "number": hit_numbers(dataset).tolist(),
        "y": _rounded(y),
        "z": _rounded(z),
        "elements": np.flatnonzero(_by_elements(dataset)).tolist(),
        "status": dataset[v.STATUS].values.astype(int).tolist(),
        "columns": {key: _rounded(values) for key, values in columns.items()},
        "nearest": None if nearest is None else nearest.tolist(),
    }


def trajectory_data(history: xarray.Dataset) -> dict[str, Any]:
    """The core in two views, in the plate and behind it, and sections of the plate through the hit point [mm]."""
    inside, behind = poses_in_plate(history), poses_behind(history)
    colours = [to_hex(colour) for colour in colormaps["viridis"](np.linspace(0.0, 0.9, len(inside)))]

    def outline(pose: Pose, view: str) -> list[list[float | None]]:
        """Closed outline of the core [mm]; it is convex and has one point for each `_TURN` of its direction."""
        points = silhouette(history, pose, view) * MM
        along, up = (np.roll(points, -1, axis=0) - points).T
        heading = np.floor(np.degrees(np.arctan2(up, along)) / _TURN)
        return [_rounded(np.append(of, of[0])) for of in points[heading != np.roll(heading, 1)].T]

    def boxes(view: str) -> list[list[float]]:
        """Front, rear, low and high [mm] of what is solid through the hit point, in all layers."""
        along = (history["section"].values + float(history[f"hit_{view}"])) * MM
        solid = ((slab.front, slab.rear, *run) for slab in slabs(history, view) for run in runs_of(slab.solid))
        return [[front * MM, rear * MM, float(along[low]), float(along[high])] for front, rear, low, high in solid]

    def drawn(label: str, pose: Pose, colour: str) -> dict[str, Any]:
        return {"label": label, "colour": colour} | {view: outline(pose, view) for view in "yz"}

    return {
        "solid": {view: boxes(view) for view in "yz"},
        "inside": [drawn(*pose, colour) for pose, colour in zip(inside.items(), colours, strict=True)],
        "behind": [drawn(*pose, _CORE_BEHIND) for pose in behind.items()],
    }


def picture_data(result: Result) -> dict[str, Any]:
    """Pictures of hits by finite elements, by the numbers of the hits; empty without any.

    A picture is lengths of runs of cells, each with its label behind it, row by row from its upper left corner.
    """
    pictures = pictures_of(result)
    if pictures is None:
        return {}
    count = pictures.sizes["hit"]
    some = pictures.isel(hit=spread_places(count, min(count, MOST_PICTURED))).load()
    times, labels = some[v.PICTURE_TIME].values, some[v.PICTURE].values[:, :, ::-1]
    numbers = some[v.HIT].values.tolist()
    return {
        "wide": some.sizes["along"],
        "tall": some.sizes["across"],
        "cell": float(np.diff(some[v.ALONG][:2])[0] * MM),
        "codes": np.unique(labels).tolist(),
        "hits": {
            number: [[round(1e6 * time, 1), _runs(one)] for time, one in zip(*own, strict=True)]
            for number, *own in zip(numbers, times, labels, strict=True)
        },
    }


def _runs(labels: NDArray[np.int8]) -> list[int]:
    """Lengths and labels of the runs of cells with one label, in turns."""
    flat = labels.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=-1))
    return np.column_stack([np.diff(starts, append=len(flat)), flat[starts]]).ravel().tolist()


def _rounded(values: Array) -> list[float | None]:
    """Round values to five digits; None for NaN."""
    return [float(f"{value:.5g}") if math.isfinite(value) else None for value in values.tolist()]
