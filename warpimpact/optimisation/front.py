"""The front of a search: its Dataset, the campaign files of its designs, and what people read of it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
import xarray
from numpy.typing import NDArray

from warpimpact.analysis.numbers import View, interval_text, listed, number_text
from warpimpact.campaign.evidence import outside_tested_range, range_line
from warpimpact.campaign.places import relocated
from warpimpact.optimisation.design import Bound, Design, target_weights
from warpimpact.optimisation.evaluate import goal_numbers, interval, nondominated
from warpimpact.records.variable import Variable
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results.dataset import dataset_of
from warpimpact.results.files import atomic_path
from warpimpact.results.kinds import FRONT
from warpimpact.scene.model import Array

OF_FRONT = (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)
OF_REFERENCE = (f.REFERENCE_RESULT, f.REFERENCE_LOW, f.REFERENCE_HIGH)
"""Variables with a value of each goal by fresh hits, and the ends of its interval."""


def folder_of(output: Path) -> Path:
    """Folder of the campaigns of the designs of a front."""
    return output.with_name(f"{output.stem}_designs")


def front_dataset(
    design: Design,
    values: Array,
    results: Array,
    front: NDArray[np.int64],
    numbers: NDArray[np.int64],
    targets: Sequence[dict[str, Any]],
    columns: Array,
) -> xarray.Dataset:
    """The Dataset of results/front.py.

    Args:
        values: values of the variables of all computed designs, shape [designs, variables].
        results: their objectives and bounds, shape [designs, goals].
        front: numbers of those on the front.
        numbers: numbers of those with fresh hits.
        targets: tables of these, and of the references.
        columns: numbers of the fresh hits of the targets, shape [targets, threats, columns, hits].
    """
    goals, variables, size = design.goals, design.space.variables, len(numbers)
    names = [goal.measure for goal in goals]
    of_targets = [
        [goal_numbers(design, target_weights(design.campaign(tables).target), hits, goal) for goal in goals]
        for tables, hits in zip(targets, columns, strict=True)
    ]
    ends = [[interval(design, goal, of[0]) for goal, of in zip(goals, row, strict=True)] for row in of_targets]
    value, low, high = np.moveaxis(np.array(ends).reshape(-1, len(goals), 3), -1, 0)
    parts: dict[Any, Any] = {
        f.NAME: [variable.name for variable in variables],
        f.UNIT: [variable.unit for variable in variables],
        f.LABELS: [json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables],
        f.GOAL: [name if names.count(name) == 1 else f"{name}_{place}" for place, name in enumerate(names)],
        f.GOAL_LABEL: [goal.spec.title for goal in goals],
        f.GOAL_SIGN: [int(goal.sign) for goal in goals],
        f.GOAL_LIMIT: [goal.limit if isinstance(goal, Bound) else np.nan for goal in goals],
        f.VALUE: values,
        f.TEXT: [design.space.text(point) for point in values],
        f.RESULT: results,
        f.ON_FRONT: np.isin(np.arange(len(values)), front).astype(np.int8),
        f.NUMBER: numbers,
        f.CONFIRMED: np.isin(np.arange(size), nondominated(design, value[:size])).astype(np.int8),
        f.CAMPAIGN: [tomli_w.dumps(_tables_of(design, values[number], 0)) for number in numbers],
        f.FILE: [f"design_{number:02d}.toml" for number in range(size)],
        f.OUTSIDE: [_range(design, tables) for tables in targets[:size]],
        f.REFERENCE: [reference.name for reference in design.file.references],
        **{name: part[:size] for name, part in zip(OF_FRONT, (value, low, high), strict=True)},
        **{name: part[size:] for name, part in zip(OF_REFERENCE, (value, low, high), strict=True)},
    }
    if len(design.file.threats) > 1 and size:
        parts[f.WORST] = [[threat for _, threat in of_target] for of_target in of_targets[:size]]
    if design.columns and size:
        fresh = (design.campaign(tables, seed=design.fresh_seed) for tables in targets[:size])
        shots = [campaign.sampler().shots(0, columns.shape[-1]) for campaign in fresh]
        parts |= {f.HIT_Y: [some.hit_y for some in shots], f.HIT_Z: [some.hit_z for some in shots]}
        parts[f.HIT_VALUE] = columns[:size, 0]
    attributes = {
        attr.REFERENCES: f.REFERENCES,
        attr.KIND: FRONT.mark,
        attr.TITLE: design.base.get("title", ""),
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.file.search.seed,
        f.DESIGN: design.text,
        f.OUTCOME: f.FEASIBLE if size else f.NONE_FEASIBLE,
        f.HITS: design.file.search.hits if design.columns else 0,
    }
    return dataset_of(parts, attributes).set_coords([f.UNIT, f.GOAL_LABEL])  # a selected value keeps its unit and label


def _range(design: Design, tables: dict[str, Any]) -> str:
    """Whether the plates of a design lie in the tested range, or in what they do not."""
    sentences = outside_tested_range(design.campaign(tables))
    return range_line(sentence for sentence in sentences if " (" in sentence.partition(": ")[0])  # names a plate


def _tables_of(design: Design, values: Array, threat: int) -> dict[str, Any]:
    return campaign_tables(design, design.tables(values), threat, design.space.text(values))


def campaign_tables(design: Design, tables: dict[str, Any], threat: int, name: str) -> dict[str, Any]:
    """The tables of the campaign of a target, by its name, and a threat, for `warpimpact run`."""
    threats = design.file.threats
    made: dict[str, Any] = json.loads(json.dumps(design.against(tables, threats[threat]), default=str))
    made.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.file.search.seed})
    named = f", {threats[threat].name}" if len(threats) > 1 else ""
    title = " ".join(f"{design.base.get('title', '')}{named}: {name}"[:200].split())
    return made | {"title": title.rstrip(":")}


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
    for stale in folder.glob("design_[0-9]*.toml") if overwrite else ():
        stale.unlink()
    for number, name in zip(dataset[f.NUMBER].values, dataset[f.FILE].values, strict=True):
        values = dataset[f.VALUE].values[int(number)]
        for place, threat in enumerate(design.file.threats):
            tables = _tables_of(design, values, place)
            ending = "_" + re.sub(r"\W+", "_", threat.name) if place else ""
            path = folder / f"{Path(name).stem}{ending}.toml"
            text = tomli_w.dumps(relocated(tables, design.folder, folder))
            if not path.exists():
                folder.mkdir(parents=True, exist_ok=True)
                with atomic_path(path) as file:
                    file.write_text(text, encoding="utf-8")
            elif path.read_bytes() != text.encode():
                warn(f"{path}: differs from the design of the front and is kept; --overwrite replaces it")


def front_view(dataset: xarray.Dataset) -> View:
    """The front with intervals, and the values of its variables."""
    attributes, (every, *_) = dataset.attrs, dataset[f.RESULT].shape
    counts = f"{every} designs computed with {attributes[f.HITS]} hits each, {attributes[f.PILOTS]} pilots"
    computed = f"{counts}; {attributes[f.REFUSED]} more broke a constraint and were not computed"
    if attributes[f.OUTCOME] == f.NONE_FEASIBLE:
        return {"": [computed, _nearest(dataset)]}
    on_front, confirmed = int(dataset[f.ON_FRONT].sum()), dataset.sizes["front"]
    again = f"front: {on_front} designs, of which {confirmed} were computed again with fresh hits"
    texts = zip(dataset[f.FILE].values, dataset[f.TEXT].values[dataset[f.NUMBER].values], strict=True)
    variables = [f"{name}: {text}" for name, text in texts]
    corrected: list[str | pd.DataFrame] = []
    if f.CORRECTED in dataset:
        table = corrected_table(dataset)
        unknown = [str(name) for name, row in table.iterrows() if "-" in row.to_list()]
        why = f"Finite elements give no number of {listed(unknown)}: too few of its hits ended soundly."
        corrected = [table, *([why] if unknown else []), *changed_places(dataset)]
    return {
        "": [computed, again],
        "objectives and bounds": [front_table(dataset)],
        f"corrected by {attributes.get(f.ELEMENTS)} hits of each plate by finite elements": corrected,
        "variables": variables,
    }


def corrected_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives and bounds by fresh hits of the fast law, and as finite elements correct them."""
    law = _table(dataset, (f.FRESH,), (f.REFERENCE_RESULT,))
    corrected = _table(dataset, f.BY_ELEMENTS, f.REFERENCE_BY_ELEMENTS)
    exact = (dataset[f.CORRECTED_LOW] == dataset[f.CORRECTED_HIGH]).all(dim="front").values  # as a weight, which stays
    columns: list[tuple[str, pd.Series[str]]] = []
    for place, goal in enumerate(dataset[f.GOAL].values):
        columns.append((goal if exact[place] else f"{goal}, fast law", law.iloc[:, place]))
        columns += [] if exact[place] else [("corrected", corrected.iloc[:, place])]
    table: pd.DataFrame = pd.concat([texts for _, texts in columns], axis=1)
    return table.set_axis([name for name, _ in columns], axis=1)


def _table(dataset: xarray.Dataset, of_front: Sequence[Variable], of_reference: Sequence[Variable]) -> pd.DataFrame:
    """Texts of every goal: a row for each design of the front and each reference, a column for each goal.

    The variables are a value, and perhaps the ends of its interval.
    """
    goals, rows = dataset[f.GOAL].values, dict[str, list[str]]()
    for names in ((f.FILE, *of_front), (f.REFERENCE, *of_reference)):
        for target, *numbers in zip(*(dataset[name].values for name in names), strict=True):
            rows[target] = [_text(*of_goal) for of_goal in zip(goals, *numbers, strict=True)]
    return pd.DataFrame.from_dict(rows, "index", columns=goals).rename_axis("design")


def _text(goal: str, value: float, low: float = np.nan, high: float = np.nan) -> str:
    """A value of a goal with its interval, if it has one; shares in percent."""
    digits, ends = (".1%", ".1%") if goal.startswith("P(") else ("#.4g", ".4g")
    interval = "" if low == high or np.isnan(low) else f" ({interval_text(low, high, digits=ends)})"
    return number_text(value, digits) + interval


def changed_places(dataset: xarray.Dataset) -> list[str]:
    """Which designs change places by the corrected values, a sentence for each objective."""
    sentences, names = [], np.array([Path(name).stem for name in dataset[f.FILE].values])
    for goal in np.flatnonzero(np.isnan(dataset[f.GOAL_LIMIT].values)):
        sign, label = dataset[f.GOAL_SIGN].values[goal], dataset[f.GOAL].values[goal]
        law, value = (sign * dataset[name].values[:, goal] for name in (f.FRESH, f.CORRECTED))
        known = np.flatnonzero(np.isfinite(value))
        before, after = (names[known[np.argsort(numbers[known], kind="stable")]] for numbers in (law, value))
        if (before != after).any():
            moved = listed(sorted(before[before != after]))
            sentences.append(f"By corrected {label}, {moved} change places. Best first: {', '.join(after)}.")
    return sentences or ["No design changes its place by the corrected values."]


def front_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives, bounds and notes by fresh hits: a row for each design of the front and each reference."""
    labels = zip(dataset[f.GOAL].values, dataset[f.GOAL_LABEL].values, strict=True)
    columns = [f"{name} [{label.partition(' [')[2]}".removesuffix(" [") for name, label in labels]
    table = _table(dataset, OF_FRONT, OF_REFERENCE).set_axis(columns, axis=1)
    for place, file in enumerate(dataset[f.FILE].values):
        worst = dict.fromkeys(filter(None, dataset[f.WORST].values[place])) if f.WORST in dataset else ()
        notes = {
            "not on the front by fresh hits": not dataset[f.CONFIRMED].values[place],
            dataset[f.OUTSIDE].values[place].rstrip("."): dataset[f.OUTSIDE].values[place].startswith("Outside"),
            f"worst threat: {', '.join(worst)}": worst,
        }
        table.loc[file, "note"] = "; ".join(note for note, holds in notes.items() if holds)
    return table.fillna("")


def _nearest(dataset: xarray.Dataset) -> str:
    """The design that comes nearest to the bounds, where none keeps them."""
    bounds = dataset.isel(goal=np.isfinite(dataset[f.GOAL_LIMIT].values))
    labels, limits, signs = (bounds[name].values for name in (f.GOAL_LABEL, f.GOAL_LIMIT, f.GOAL_SIGN))
    over = np.maximum(signs * (bounds[f.RESULT].values - limits) / np.maximum(np.abs(limits), 1e-30), 0.0).sum(axis=1)
    nearest = int(np.nanargmin(over)) if np.isfinite(over).any() else 0
    texts = [
        f"{label} {'<' if sign > 0 else '>'}= {limit:.4g} (nearest: {number_text(value)})"
        for label, limit, sign, value in zip(labels, limits, signs, bounds[f.RESULT].values[nearest], strict=True)
    ]
    missed = "; ".join(texts) or "no hit of any design could be computed"
    return f"no design meets the bounds: {missed}; the nearest has {dataset[f.TEXT].values[nearest]}"
