"""A sweep: one campaign at every combination of some values of its inputs, as one Dataset with a dimension for each."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.inspection import law_line, range_note
from warpimpact.analysis.numbers import View, value_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.places import is_table, options_of, resolved, set_value, type_at, value_at
from warpimpact.campaign.text import parsed, read_text
from warpimpact.errors import CampaignError, Interrupted, OutputError, ResultError
from warpimpact.measures.estimates import estimated, measures_named
from warpimpact.measures.hits import failed, outcome_variables
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import DRAWS, ELEMENTS, FINER, LAW, Result, as_dataset, as_tree, with_nodes
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import CAMPAIGN, SWEEP
from warpimpact.results import files
from warpimpact.runs.draws import packed
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import run, run_to_file
from warpimpact.runs.store import Store
from warpimpact.scene.units import count_text, quoted, reader_in
from warpimpact.solver.accuracy import spread_places

SHOWN = (f"mean({v.RESIDUAL_VELOCITY})", f"mean({v.DEFLECTION})", f"mean({v.TILT})", "P(perforated)")
"""Default measures of a sweep, as far as it has them."""
_MOST = 10_000
"""Most points of a sweep."""
_MOST_NUMBERS = 2**26
"""Most numbers of a variable in the draws of all points: 256 MB."""
_BY_HIT = (LAW, ELEMENTS, FINER)
"""Nodes of a point along its hits."""


@dataclass(frozen=True)
class Sweep:
    """A campaign and its swept inputs, each by the name of its dimension, in the order of the file.

    Attributes:
        title: title of the campaign.
        text: the campaign file.
        places: dotted place of each input, such as "impact.obliquity".
        options: its values for the campaign, by their labels: as written, or the names of tables.
        campaigns: campaigns of all combinations, by names that are fit for files; the last input changes fastest.
    """

    title: str
    text: str
    places: dict[str, str]
    options: dict[str, dict[str, Any]]
    campaigns: dict[str, Campaign]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of every input."""
        return tuple(map(len, self.options.values()))


def read_sweep(path: str | Path, *, count: int | None = None) -> Sweep:
    """Read a campaign file with a table `[sweep]` of lists.

    A key is the name of an input of `[impact]`, `[plate]` or `[interaction]`, or a dotted place such as
    "plate.pattern.width". A whole core, plate or pattern is swept by a list of tables, each with a `name`.

    Args:
        count: number of hits of every point, instead of the file's.

    Raises:
        CampaignError: the file is missing, is not TOML, has no sweep, or one of its combinations is not valid.
    """
    path = Path(path)
    text = read_text(path)
    shared = parsed(text, str(path), CAMPAIGN)
    swept, where = shared.pop("sweep", None), f"{path}: sweep"
    if not isinstance(swept, dict) or not swept:
        raise CampaignError(f'{where}: needs a table [sweep] of lists, as obliquity = ["0 deg", "15 deg"]')
    places, options, campaigns = dict[str, str](), dict[str, dict[str, Any]](), {}
    for key, values in swept.items():
        place = resolved(key, where)
        if not isinstance(values, list) or not values:
            raise CampaignError(f"{where}.{key}: got {quoted(values)}, but it must be a list of values")
        if (name := _dimension(place)) in places:
            raise CampaignError(f"{where}: got two lists for one input")
        places[name], options[name] = place, options_of(values, f"{where}.{key}", whole=is_table(place))
    if (points := math.prod(map(len, options.values()))) > _MOST:
        raise CampaignError(f"{where}: got {points} combinations, but at most {_MOST} are computed")
    for number, combination in enumerate(itertools.product(*options.values())):
        data, point = json.loads(json.dumps(shared, default=str)), dict(zip(options, combination, strict=True))
        for name, label in point.items():
            set_value(data, places[name], options[name][label], where)
        words = ", ".join(f"{name} = {label}" for name, label in point.items())
        if isinstance(data.get("title"), str):
            data["title"] = f"{data['title']}: {words}"[:200]
        content = json.dumps(data, indent=1, ensure_ascii=False)
        file = f"{number:04d}_{'_'.join(re.findall(r'[A-Za-z0-9.+-]+', words))}"[:100]
        campaigns[file] = Campaign.from_text(content, name=f"{path}, {words}", folder=path.parent, count=count)
    return Sweep(str(shared.get("title", "")), text, places, options, campaigns)


def _dimension(place: str) -> str:
    """Name of the dimension of an input: that of the hit map's variable, else the last part of its place; for a layer
    the whole place, such as "layer_1_thickness"."""
    if place.startswith("layer "):
        return place.replace(" ", "_").replace(".", "_")
    last = place.rpartition(".")[2]
    return next((str(variable) for variable in v.SHOT_VARIABLES if variable.field == last), last)


def sweep(campaign: Sweep | str | Path, *, options: RunOptions = RunOptions()) -> xarray.DataTree:
    """Compute a campaign at every combination of some values of its inputs, in memory.

    Args:
        campaign: the sweep, or a campaign file with a table `[sweep]`.
        options: where to compute.

    Returns:
        The result of `run` with a dimension for each swept input, in front of "hit".

    Raises:
        CampaignError: as in `read_sweep`.
        DeviceError, ClusterError, Cancelled: as in `run`.
    """
    points = campaign if isinstance(campaign, Sweep) else read_sweep(campaign)
    with options.opened() as options:
        results = [run(one, options=options.at(f"point {name}")) for name, one in points.campaigns.items()]
    return joined(points, results)


def points_folder(output: Path) -> Path:
    """Folder with the results of the points of a sweep."""
    return output.with_name(f"{output.stem}_points")


def run_sweep(sweep: Sweep, store: Store | str | Path, *, options: RunOptions = RunOptions()) -> None:
    """Compute every point of a sweep by `run_to_file`, and join their files into one.

    Args:
        store: the file of the sweep, as in `run_to_file`. The results of the points stay in the folder
            `points_folder(store.path)`; complete ones are not computed again where the sweep is resumed.
        options: where to compute.
    """
    store = Store.at(store)
    assert store.path is not None
    folder = points_folder(store.path)
    if not (store.resume or store.overwrite) and (there := [path for path in (store.path, folder) if path.exists()]):
        raise OutputError(f"{there[0]}: exists already; give --resume or --overwrite, or another name")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None
    paths = [folder / f"{name}.nc" for name in sweep.campaigns]
    done = 0
    try:
        with options.opened() as options:
            for (name, campaign), path in zip(sweep.campaigns.items(), paths, strict=True):
                run_to_file(campaign, replace(store, path=path), options=options.at(f"point {name}"))
                done += 1
        files.write(joined(sweep, [files.read(path) for path in paths]), store.path)
    except (OutputError, Interrupted) as error:
        if not done:
            raise
        points = f"{done} of {count_text(len(paths), 'point')} complete in {folder}; continue with --resume"
        error.saved = "; ".join(filter(None, (error.saved, points)))
        raise


def joined(sweep: Sweep, results: Sequence[xarray.DataTree]) -> xarray.DataTree:
    """Results of all points as one, with what all of them have of an answer: `draws`, `law`, `elements` and `finer`.

    A variable has the dimensions of the swept inputs in front of its own if it differs from point to point. Outcomes
    always have them. Hits that a point does not have are NaN; draws are of hits that all points have. Points are in the
    order of `sweep.campaigns`.
    """
    points, names = _aligned([result.to_dataset() for result in results]), tuple(sweep.options)
    first, result = points[0], _stacked(sweep, points)
    inputs = {name: _coordinate(sweep, name) for name in names}
    nodes = {name: [one[name].to_dataset() for one in results if name in one.children] for name in (*_BY_HIT, DRAWS)}
    shared = {name: of for name, of in nodes.items() if len(of) == len(points)}
    joint = {name: _stacked(sweep, _aligned(shared[name])) for name in _BY_HIT if name in shared}
    if DRAWS in shared:
        joint[DRAWS] = packed(_stacked(sweep, _drawn_by_all([of.drop_dims(v.HIT) for of in shared[DRAWS]])))
    joint = {name: of.drop_vars([v.HIT, v.STANDOFF], errors="ignore") for name, of in joint.items()}
    texts = np.array([point.attrs.get(attr.CAMPAIGN, "") for point in points]).reshape(sweep.shape)
    result[attr.CAMPAIGN] = names, texts, {"long_name": "campaign of the point"}
    periods = np.array([point.attrs[attr.PLATE_PERIOD] for point in points])
    if np.ptp(periods, axis=0).any():
        sides = {"units": "m", "long_name": "extent of the unit cell along y and z"}
        result[attr.PLATE_PERIOD] = (*names, "side"), periods.reshape(*sweep.shape, 2), sides
    attributes = {
        name: value
        for name, value in first.attrs.items()
        if all(name in point.attrs and np.array_equal(point.attrs[name], value) for point in points)
    }
    outside = [one for point in points for one in json.loads(point.attrs.get(attr.OUTSIDE_TESTED_RANGE, "[]"))]
    result.attrs = {name: value for name, value in attributes.items() if name.removesuffix("_units") in attributes} | {
        attr.KIND: SWEEP.mark,
        attr.TITLE: sweep.title,
        attr.HISTORY: attr.history_line("sweep"),
        attr.CAMPAIGN: sweep.text,
        attr.OUTSIDE_TESTED_RANGE: json.dumps([*dict.fromkeys(outside)], ensure_ascii=False),
        attr.SWEEP: json.dumps({name: list(labels) for name, labels in sweep.options.items()}),
    }
    return with_nodes(result.assign_coords(inputs), joint)


def _drawn_by_all(points: Sequence[xarray.Dataset]) -> list[xarray.Dataset]:
    """Draws of the hits that all points have in theirs, of no more of them than a sweep holds in memory."""
    common = xarray.align(*points, join="inner")
    most = max(1, _MOST_NUMBERS // (len(points) * common[0].sizes[v.DRAW]))
    places = np.sort(spread_places(common[0].sizes[v.DRAWN_HIT], min(most, common[0].sizes[v.DRAWN_HIT])))
    return [point.isel({v.DRAWN_HIT: places}) for point in common]


def _aligned(points: Sequence[xarray.Dataset]) -> Sequence[xarray.Dataset]:
    """Datasets of points with the hits of all of them."""
    others = {dim for point in points for dim in point.dims} - {v.HIT, v.STANDOFF}
    return xarray.align(*points, join="outer", exclude=others)


def _stacked(sweep: Sweep, points: Sequence[xarray.Dataset]) -> xarray.Dataset:
    """The variables that all points have, with the dimensions of the inputs if they are outcomes or differ."""
    first, names = points[0], tuple(sweep.options)
    outcomes = {*map(str, outcome_variables(first))}
    shapes = [{name: column.shape for name, column in point.variables.items()} for point in points]
    kept = {name for name, shape in shapes[0].items() if all(other.get(name) == shape for other in shapes)}
    result = first.drop_vars({*first.variables} - kept | {*names} & {*first.variables})
    for name, array in list(result.variables.items()):
        columns = [point.variables[name] for point in points]
        if name in outcomes or not all(map(array.equals, columns)):
            stacked = np.stack([column.values for column in columns]).reshape(sweep.shape + array.shape)
            result[name] = (*names, *array.dims), stacked, array.attrs
    return result


def plates_of_points(path: Path) -> tuple[list[str], dict[str, Path]]:
    """The plates of a sweep's points, by the inputs that are of the target, and their results by name.

    Raises:
        ResultError: the folder with the results of the points is not beside the file, or is not complete.
    """
    with files.opened(path, SWEEP) as sweep:
        inputs = json.loads(sweep.attrs[attr.SWEEP])
        places = {name: str(sweep[name].attrs["long_name"]) for name in inputs}
    points, folder = [*itertools.product(*inputs.values())], points_folder(path)
    results = {file.stem: file for file in sorted(folder.glob("*.nc"))}
    if len(results) != len(points):
        needs = f"{folder} has {count_text(len(results), 'result')}; warpimpact sweep with --resume completes it"
        raise ResultError(f"{path}: has {count_text(len(points), 'point')}, but {needs}")
    of_plate = [name for name, place in places.items() if not place.startswith(("impact", "core"))]
    names = []
    for point in (dict(zip(inputs, labels, strict=True)) for labels in points):
        words = (point[name] if is_table(places[name]) else f"{name} {point[name]}" for name in of_plate)
        names.append(", ".join(words).replace("_", " "))
    return names, results


def _coordinate(sweep: Sweep, name: str) -> tuple[Any, ...]:
    """Coordinate of an input: numbers with their unit if it is a quantity, else its labels."""
    place, labels, campaigns = sweep.places[name], list(sweep.options[name]), list(sweep.campaigns.values())
    stride = math.prod(sweep.shape[list(sweep.options).index(name) + 1 :])
    numbers = [value_at(place, campaign) for campaign in campaigns[::stride][: len(labels)]]
    kind = type_at(place, campaigns[0])
    if kind is None or not all(isinstance(number, int | float) for number in numbers):
        return name, np.array(labels), {"long_name": place}
    reader, values = reader_in(kind), np.array(numbers, dtype=float)
    units = reader.display.stored if reader else "1"
    return name, np.degrees(values) if units == "degree" else values, {"units": units, "long_name": place}


def inputs_of(sweep: xarray.Dataset) -> dict[str, list[str]]:
    """The values of every input as the campaign writes them, without inputs of which one value was chosen."""
    return {name: labels for name, labels in json.loads(sweep.attrs[attr.SWEEP]).items() if name in sweep.dims}


def sweep_table(result: Result, measures: Sequence[Measure]) -> pd.DataFrame:
    """The measures at every combination of the inputs, in their display units.

    Returns:
        A row for each combination, the last input changing fastest, with an index level for each input as the campaign
        writes it, and two levels of columns: the text of a measure; value, low, high, numerics, and share (of the hits
        that count).
    """
    inputs, rows = inputs_of(as_dataset(result)), {}
    for combination in itertools.product(*map(enumerate, inputs.values())):
        point = result.isel({name: place for name, (place, _) in zip(inputs, combination, strict=True)})
        point = point.isel(hit=np.flatnonzero(as_dataset(point)[v.STATUS].notnull().values))
        if attr.CAMPAIGN in point:
            point.attrs = {**point.attrs, attr.CAMPAIGN: str(point[attr.CAMPAIGN].item())}
        hits, row = int((~failed(as_dataset(point))).sum()), dict[tuple[str, str], float]()
        for measure, one in estimated(point, measures).items():
            numbers = {"value": one.value, "low": one.low, "high": one.high, "numerics": one.numerics}
            numbers["share"] = one.count / hits if hits else 0.0
            row |= {(measure.text, name): number for name, number in numbers.items()}
        rows[tuple(label for _, label in combination)] = row
    table = pd.DataFrame([list(row.values()) for row in rows.values()], columns=pd.MultiIndex.from_tuples(row))
    return table.set_index(pd.MultiIndex.from_tuples(rows, names=list(inputs)))


def sweep_view(result: Result, texts: Sequence[str] = ()) -> View:
    """A table with a row for every combination and its measures.

    Measures with these texts have their shifts by the numerics, too. By default they are those of `SHOWN`.

    Raises:
        ResultError: a text is no measure, or the sweep lacks what it needs.
    """
    sweep = as_dataset(result)
    measures = measures_named(sweep, texts, SHOWN)
    table = sweep_table(result, measures).rename_axis(index=lambda name: name.replace("_", " "))
    shown, inputs = pd.DataFrame(index=table.index), ", ".join(inputs_of(sweep)).replace("_", " ")
    for measure in measures:
        own = table[measure.text]
        ends = zip(own.value, own.low, own.high, own.numerics if texts else [math.nan] * len(own), strict=True)
        shown[measure.title] = [value_text(measure, *one) for one in ends]
    elements = as_tree(result).children.get(ELEMENTS)
    by_elements = 0 if elements is None else int(elements[v.STATUS].notnull().sum(v.HIT).min())
    hits = count_text(sweep.sizes[v.HIT], "hit") + (f" and {by_elements} by finite elements" if by_elements else "")
    sentence = f"{count_text(len(table), 'combination')} of {inputs}, with at most {hits} each; 95 % intervals"
    notes = [*([] if by_elements else [law_line()]), *range_note([sweep])]
    more = "Means are over the cores that passed. --measure TEXT adds the error of the numerics."
    return {str(sweep.attrs.get(attr.TITLE, "untitled")): [sentence, shown, *([] if texts else [more]), *notes]}
