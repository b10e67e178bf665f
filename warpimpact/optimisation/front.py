"""The front of a search: its Dataset, the campaign files of its designs, and what people read of it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
import xarray
from numpy.typing import NDArray

from warpimpact.analysis.numbers import View, interval_text, number_text
from warpimpact.campaign.evidence import outside_tested_range
from warpimpact.campaign.places import relocated
from warpimpact.optimisation.design import Bound, Design, DesignThreat
from warpimpact.optimisation.evaluate import DesignPoint
from warpimpact.optimisation.objectives import goal_numbers, interval_of
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results.dataset import dataset_of
from warpimpact.results.files import OutputError, aside
from warpimpact.results.kinds import FRONT
from warpimpact.results.vocabulary import WEIGHTS
from warpimpact.scene.model import Array

OF_FRONT = (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)
OF_REFERENCE = (f.REFERENCE_RESULT, f.REFERENCE_LOW, f.REFERENCE_HIGH)
"""Variables with a value of each goal by fresh hits, and the ends of its interval."""


def folder_of(output: Path) -> Path:
    """Folder of the campaigns of the designs of a front."""
    return output.with_name(f"{output.stem}_designs")


def to_dataset(
    design: Design,
    points: Sequence[DesignPoint],
    front: NDArray[np.int64],
    numbers: NDArray[np.int64],
    confirmed: Sequence[DesignPoint],
    columns: Array,
    still: NDArray[np.bool_],
    attributes: Mapping[str, Any],
) -> xarray.Dataset:
    """The Dataset of results/front.py.

    Args:
        points: all computed designs.
        front: numbers of those on the front.
        numbers: numbers of those with fresh hits.
        confirmed: these with their fresh hits, and the references.
        columns: numbers of the fresh hits, shape [confirmed, threats, columns, hits].
        still: whether the designs are on the front by fresh hits.
    """
    goals, variables, size = design.goals, design.space.variables, len(numbers)
    names = [goal.measure for goal in goals]
    fresh, references = confirmed[:size], confirmed[size:]
    of_points = [
        [goal_numbers(design, point.weights, hits, goal) for goal in goals]
        for point, hits in zip(confirmed, columns, strict=True)
    ]
    ends = np.array(
        [
            interval_of(design, goal, numbers)
            for of_point in of_points
            for goal, (numbers, _) in zip(goals, of_point, strict=True)
        ]
    ).reshape(len(confirmed), len(goals), 3)
    values: dict[Any, Any] = {
        f.NAME: [variable.name for variable in variables],
        f.UNIT: [variable.unit for variable in variables],
        f.LABELS: [json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables],
        f.GOAL: [name if names.count(name) == 1 else f"{name}_{place}" for place, name in enumerate(names)],
        f.GOAL_LABEL: [goal.spec.title for goal in goals],
        f.GOAL_SIGN: [int(goal.sign) for goal in goals],
        f.GOAL_LIMIT: [goal.limit if isinstance(goal, Bound) else np.nan for goal in goals],
        f.VALUE: np.array([point.values for point in points]).reshape(len(points), len(variables)),
        f.RESULT: np.array([point.results for point in points]).reshape(len(points), len(goals)),
        f.LEVELS: [_numerics(point) for point in points],
        f.ON_FRONT: np.isin(np.arange(len(points)), front).astype(np.int8),
        f.NUMBER: numbers,
        f.CONFIRMED: still.astype(np.int8),
        f.CAMPAIGN: [_campaign(design, point) for point in fresh],
        f.FILE: [f"design_{number:02d}.toml" for number in range(size)],
        f.FRESH_LEVELS: [_numerics(point) for point in fresh],
        f.OUTSIDE: [_outside(design, point) for point in fresh],
        f.REFERENCE: [reference.name for reference in design.file.references],
        f.REFERENCE_CAMPAIGN: [_campaign(design, point) for point in references],
        **dict(zip(OF_FRONT, np.moveaxis(ends[:size], -1, 0), strict=True)),
        **dict(zip(OF_REFERENCE, np.moveaxis(ends[size:], -1, 0), strict=True)),
    }
    if len(design.file.threats) > 1 and size:
        values[f.WORST] = [[threat for _, threat in of_point] for of_point in of_points[:size]]
    if design.columns and size:
        campaigns = [design.campaign(point.tables, seed=design.fresh_seed) for point in fresh]
        shots = [campaign.sampler().shots(0, columns.shape[-1]) for campaign in campaigns]
        values |= {f.HIT_Y: [some.hit_y for some in shots], f.HIT_Z: [some.hit_z for some in shots]}
        values[f.HIT_VALUE] = columns[:size, 0]
    described = {
        attr.REFERENCES: f.REFERENCES,
        attr.KIND: FRONT.mark,
        attr.TITLE: design.title,
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.file.search.seed,
        f.DESIGN: design.text,
        f.OUTCOME: f.FEASIBLE if size else f.NONE_FEASIBLE,
        f.HITS: design.file.search.hits if design.columns else 0,
    }
    # a selected value keeps its unit and its label
    return dataset_of(values, {**described, **attributes}).set_coords([f.UNIT, f.GOAL_LABEL])


def _outside(design: Design, point: DesignPoint) -> str:
    """In what the plates of a design lie outside the tested range: the words before the plate's name."""
    heads = (sentence.partition(": ")[0] for sentence in outside_tested_range(design.campaign(point.tables)))
    return ", ".join(dict.fromkeys(head.partition(" (")[0] for head in heads if " (" in head))


def _numerics(point: DesignPoint) -> str:
    return json.dumps([json.loads(numerics) for numerics in point.numerics])


def _campaign(design: Design, point: DesignPoint) -> str:
    """The campaign of a target with the first threat, as TOML."""
    return tomli_w.dumps(campaign_tables(design, point.tables, point.values, design.file.threats[0]))


def campaign_tables(design: Design, tables: Mapping[str, Any], values: Array, threat: DesignThreat) -> dict[str, Any]:
    """The tables of the campaign of a target and a threat, for `warpimpact run`. A reference has no values."""
    made: dict[str, Any] = json.loads(json.dumps(design.against(tables, threat), default=str))
    made.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.file.search.seed})
    named = f", {threat.name}" if len(design.file.threats) > 1 else ""
    of_point = design.space.text(values) if len(values) else ""
    return made | {"title": " ".join(f"{design.title}{named}: {of_point}"[:200].split()).rstrip(":")}


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder for campaigns that is a file, or not empty, before anything is computed.

    Raises:
        OutputError: the message says what to do.
    """
    if folder.exists() and not (folder.is_dir() and (overwrite or not any(folder.iterdir()))):
        raise OutputError(
            f"{folder}: contains files already, and the campaigns of the designs belong there; name another file or "
            "give --overwrite"
        )


def write_campaigns(
    design: Design, dataset: xarray.Dataset, folder: Path, *, overwrite: bool, warn: Callable[[str], object]
) -> None:
    """Write a campaign file for each design of the front, and further ones for further threats.

    Args:
        overwrite: replace campaigns of an earlier search, and remove those of designs that are no longer on the front;
            otherwise a changed file is kept.
        warn: called with a sentence for each file that is kept.

    Raises:
        OutputError: a file cannot be written.
    """
    texts = {}
    for number, name in zip(dataset[f.NUMBER].values, dataset[f.FILE].values, strict=True):
        values = dataset[f.VALUE].values[int(number)]
        for place, threat in enumerate(design.file.threats):
            tables = campaign_tables(design, design.tables(values), values, threat)
            ending = "_" + re.sub(r"\W+", "_", threat.name) if place else ""
            path = folder / f"{Path(name).stem}{ending}.toml"
            texts[path] = tomli_w.dumps(relocated(tables, design.folder, folder))
    if texts:
        folder.mkdir(parents=True, exist_ok=True)
    for stale in {*folder.glob("design_[0-9]*.toml")} - texts.keys() if overwrite else ():
        stale.unlink()
    for path, text in texts.items():
        if overwrite or not path.exists():
            with aside(path) as file:
                file.write_text(text, encoding="utf-8")
        elif not path.is_file() or path.read_bytes() != text.encode():
            warn(f"{path}: differs from the design of the front and is kept; --overwrite replaces it")


def front_view(dataset: xarray.Dataset) -> View:
    """The front with intervals, the values of its variables, and how fresh hits changed it."""
    attributes, (every, *_) = dataset.attrs, dataset[f.RESULT].shape
    computed = (
        f"{every} designs computed with {attributes[f.HITS]} hits each, {attributes[f.PILOTS]} pilots; "
        f"{attributes[f.REFUSED]} more broke a constraint and were not computed"
    )
    if attributes[f.OUTCOME] == f.NONE_FEASIBLE:
        return {"": [computed, *_nearest(dataset)]}
    on_front, confirmed = int(dataset[f.ON_FRONT].sum()), dataset.sizes["front"]
    again = f"front: {on_front} designs, of which {confirmed} were computed again with fresh hits"
    return {
        "": [computed, again],
        "objectives and bounds": [front_table(dataset)],
        "variables": [variables_table(dataset, dataset[f.NUMBER].values, dataset[f.FILE].values), *_shrinkage(dataset)],
    }


def front_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives, bounds and notes by fresh hits: a row for each design of the front and each reference."""
    rows = dict[str, list[str]]()
    for names in ((f.FILE, *OF_FRONT), (f.REFERENCE, *OF_REFERENCE)):
        for name, *ends in zip(*(dataset[variable].values for variable in names), strict=True):
            rows[name] = [
                number_text(value) + ("" if low == high else f" ({interval_text(low, high, digits='.4g')})")
                for value, low, high in zip(*ends, strict=True)
            ]
    labels = zip(dataset[f.GOAL].values, dataset[f.GOAL_LABEL].values, strict=True)
    columns = [f"{name} [{label.partition(' [')[2]}".removesuffix(" [") for name, label in labels]
    table = pd.DataFrame.from_dict(rows, "index", columns=columns).rename_axis("design")
    for place, file in enumerate(dataset[f.FILE].values):
        notes = [] if dataset[f.CONFIRMED].values[place] else ["not on the front by fresh hits"]
        if outside := dataset[f.OUTSIDE].values[place]:
            notes.append(f"outside the tested range: {outside}")
        if worst := dict.fromkeys(filter(None, dataset[f.WORST].values[place] if f.WORST in dataset else ())):
            notes.append(f"worst threat: {', '.join(worst)}")
        table.loc[file, "note"] = "; ".join(notes)
    return table.fillna("")


def variables_table(dataset: xarray.Dataset, designs: Any, names: Any) -> pd.DataFrame:
    """The values of the variables that some of these designs use, in rows of these names."""
    table = pd.DataFrame(index=pd.Index(names, name="design"))
    variables = (dataset[variable].values for variable in (f.NAME, f.UNIT, f.LABELS))
    for name, unit, labels, values in zip(*variables, dataset[f.VALUE].values[designs].T, strict=True):
        if np.isfinite(values).any():
            texts = json.loads(labels) if labels else None
            table[f"{name} [{unit}]" if unit else name] = [
                "" if np.isnan(value) else texts[int(value)] if texts else f"{value:.6g}" for value in values
            ]
    return table


def _shrinkage(dataset: xarray.Dataset) -> Iterator[str]:
    """How much worse the fresh hits are than the hits of the search."""
    searched, fresh = dataset[f.RESULT].values[dataset[f.NUMBER].values], dataset[f.FRESH].values
    worse = (dataset[f.GOAL_SIGN].values * (fresh - searched)).mean(axis=0)
    for goal in np.flatnonzero(np.isnan(dataset[f.GOAL_LIMIT].values)):
        if str(dataset[f.GOAL].values[goal]).startswith(tuple(WEIGHTS)):
            continue
        name, _, unit = str(dataset[f.GOAL_LABEL].values[goal]).removesuffix("]").partition(" [")
        by = f"{number_text(abs(float(worse[goal])))} {unit}".strip()
        before = float(searched[:, goal].mean())
        share = f", {abs(worse[goal] / before):.1%} of it" if before else ""
        which = "worse" if worse[goal] > 0 else "better"
        yield f"shrinkage: by fresh hits {name} is {which} by {by}{share}, mean over the front"


def _nearest(dataset: xarray.Dataset) -> list[str | pd.DataFrame]:
    """The design that comes nearest to the bounds, if none keeps them."""
    limits, signs, values = dataset[f.GOAL_LIMIT].values, dataset[f.GOAL_SIGN].values, dataset[f.RESULT].values
    bounds = np.flatnonzero(~np.isnan(limits))
    over = np.maximum(signs * (values - limits) / np.maximum(np.abs(limits), 1e-30), 0.0)[:, bounds].sum(axis=1)
    nearest = int(np.nanargmin(over)) if np.isfinite(over).any() else 0
    texts = [
        f"{dataset[f.GOAL_LABEL].values[bound]!s} {'<' if signs[bound] > 0 else '>'}= {limits[bound]:.4g}"
        f" (nearest: {number_text(float(values[nearest, bound]))})"
        for bound in bounds
    ]
    sentence = f"no design keeps the bounds: {'; '.join(texts) or 'no hit of any design could be computed'}"
    return [sentence, variables_table(dataset, [nearest], ["the nearest"])]
