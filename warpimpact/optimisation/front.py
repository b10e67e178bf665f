"""The front of a search: its Dataset, campaign files, and what people read of it.

design      every design that was computed
variable    the free variables
goal        objectives, then bounds
front       confirmed designs: those of the front, then others
reference   targets to compare with, by their answers, too
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
import xarray

from warpimpact.analysis.numbers import View, interval_text, number_text
from warpimpact.campaign.evidence import outside_tested_range, range_line
from warpimpact.campaign.places import relocated
from warpimpact.optimisation.confirmation import ConfirmedTarget, bound_verdict, nondominated
from warpimpact.optimisation.design import Bound, Design, campaign_tables
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import FRONT
from warpimpact.results.dataset import column, with_interval
from warpimpact.results.files import atomic_path
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text

FEASIBLE, NONE_FEASIBLE = "front", "no design within the bounds"
"""How a search ended, its attribute `outcome`."""


def designs_folder(output: Path) -> Path:
    """Folder of the campaigns and the results of confirmed designs."""
    return output.with_name(f"{output.stem}_designs")


def design_name(place: int) -> str:
    """Name of the files of a confirmed design, by its place among them."""
    return f"design_{place:02d}"


def front_dataset(
    design: Design,
    values: Array,
    law: Array,
    goals: Array,
    confirmed: Mapping[int, ConfirmedTarget],
    references: Sequence[ConfirmedTarget],
) -> xarray.Dataset:
    """The Dataset of a search.

    Args:
        values: values of the variables of all computed designs, shape [designs, variables].
        law: their objectives and bounds by the fast law, shape [designs, goals].
        goals: the same as far as answers say, of `confirm_designs`.
        confirmed: designs by their answers, by their numbers, in the order of their files.
        references: targets to compare with, by their answers.
    """
    unsorted = np.array([one.ends for one in confirmed.values()]).reshape(-1, len(design.goals), 3)
    best = nondominated(design, unsorted[:, :, 0])
    others = np.setdiff1d(np.argsort(design.goals[0].sign * unsorted[:, 0, 0], kind="stable"), best, assume_unique=True)
    order = [*best.tolist(), *others.tolist()]
    numbers, targets = np.array([*confirmed], dtype=np.int64)[order], [[*confirmed.values()][place] for place in order]
    ends_of_references = np.array([one.ends for one in references]).reshape(-1, len(design.goals), 3)
    on_front = np.isin(np.arange(len(values)), nondominated(design, goals)).astype(np.int8)
    texts, of_search = [*map(design.space.text, values)], "in its own units"
    used = "value in its unit; number of a choice; none where unused"
    by_answers = "objective or bound, moved as the nearest confirmed design's answer is from its fast law"
    confirms = "1 where its answer leaves it on the front and within the bounds, else 0"
    outside = [_range(design, design.tables(values[number])) for number in numbers]
    tomls = [tomli_w.dumps(_tables_of(design, values[number], 0)) for number in numbers]
    parts: dict[str, tuple[Any, ...]] = {
        **_described(design),
        "value": column(("design", "variable"), values, "1", used),
        "text": column("design", texts, "1", "names and values of the variables that count"),
        "law_result": column(("design", "goal"), law, "1", f"objective or bound by the fast law alone, {of_search}"),
        "result": column(("design", "goal"), goals, "1", f"{by_answers}, {of_search}"),
        "on_front": column("design", on_front, "1", "1 on the front by these numbers, else 0"),
        "front_design": column("front", numbers, "1", "number of the design"),
        "front_confirmed": column("front", (np.arange(len(numbers)) < len(best)).astype(np.int8), "1", confirms),
        "front_campaign": column("front", tomls, "1", "campaign of the first threat, as TOML"),
        "front_file": column("front", [f"{design_name(k)}.toml" for k in order], "1", "name of its campaign file"),
        "front_outside": column("front", outside, "1", "whether it is inside the tested range, or what is outside"),
        "reference": column("reference", [one.name for one in design.file.references], "1", "target to compare with"),
        **with_interval("front_result", ("front", "goal"), unsorted[order], "1", f"objective or bound, {of_search}"),
        **with_interval(
            "reference_result", ("reference", "goal"), ends_of_references, "1", f"objective or bound, {of_search}"
        ),
    }
    if len(design.file.threats) > 1 and targets:
        worst = [one.threats for one in targets]
        parts["front_worst_threat"] = column(
            ("front", "goal"), worst, "1", "threat whose hits count; empty if all count, or none"
        )
    hits = [one.hits for one in targets if one.hits is not None]
    if hits and len({one.sizes[v.HIT] for one in hits}) == 1:
        place = "hit point in the irreducible part of the cell"
        by_hit = ("front", "effect", "hit")
        parts |= {
            "front_hit_y": column(("front", "hit"), [one[v.HIT_Y].values for one in hits], "m", f"{place}, y"),
            "front_hit_z": column(("front", "hit"), [one[v.HIT_Z].values for one in hits], "m", f"{place}, z"),
            "front_hit_value": column(by_hit, [[one["value"].values] for one in hits], "1", "value of the hit"),
        }
    attributes = {
        "Conventions": "CF-1.11",
        attr.REFERENCES: "docs/howto/optimise.md of warpimpact",
        attr.KIND: FRONT.mark,
        attr.TITLE: design.base.get("title", ""),
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.file.search.seed,
        "design_file": design.text,
        "outcome": FEASIBLE if len(best) else NONE_FEASIBLE,
        "hits_per_design": design.file.search.hits if design.columns else 0,
        "confirm_hits": design.file.search.confirm_hits,
        "element_hits": design.continuum_hits or 0,
    }
    # A selected value keeps its unit and label.
    return xarray.Dataset(parts, attrs=attributes).set_coords(["variable_unit", "goal_label"])


def _described(design: Design) -> dict[str, tuple[Any, ...]]:
    """Columns on the variables and the goals of a design file."""
    goals, variables = design.goals, design.space.variables
    names, units = [goal.measure for goal in goals], [free.unit for free in variables]
    labels = [json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables]
    unique = [name if names.count(name) == 1 else f"{name}_{place}" for place, name in enumerate(names)]
    limits = [goal.limit if isinstance(goal, Bound) else np.nan for goal in goals]
    return {
        "variable": column("variable", [variable.name for variable in variables], "1", "free variable"),
        "variable_unit": column("variable", units, "1", "unit of the variable, as the design file has it"),
        "variable_labels": column("variable", labels, "1", "what a variable chooses from, as a JSON list"),
        "goal": column("goal", unique, "1", "objective or bound"),
        "goal_label": column("goal", [goal.spec.title for goal in goals], "1", "what it is, for people, with its unit"),
        "goal_sign": column("goal", [int(one.sign) for one in goals], "1", "1 where less is sought, -1 where more is"),
        "goal_limit": column("goal", limits, "1", "limit of a bound in its own units; no value of an objective"),
    }


def _range(design: Design, tables: dict[str, Any]) -> str:
    """Whether the plates of a design lie in the tested range, or in what they do not."""
    sentences = outside_tested_range(design.campaign(tables))
    return range_line(sentence for sentence in sentences if " (" in sentence.partition(": ")[0])  # names a plate


def _tables_of(design: Design, values: Array, threat: int) -> dict[str, Any]:
    return campaign_tables(design, design.tables(values), threat, design.space.text(values))


def write_campaigns(
    design: Design, dataset: xarray.Dataset, folder: Path, *, overwrite: bool, warn: Callable[[str], object]
) -> None:
    """Write a campaign file for each confirmed design, and further ones for further threats.

    Args:
        overwrite: replace campaigns of an earlier search, and remove files of designs that are no longer confirmed;
            otherwise a changed file is kept.
        warn: called with a sentence for each file that is kept.

    Raises:
        OutputError: a file cannot be written.
    """
    names = {Path(name).stem for name in dataset.front_file.values}
    for stale in folder.glob("design_[0-9]*.*") if overwrite else ():
        if stale.suffix == ".toml" or "_".join(stale.stem.split("_")[:2]) not in names:
            stale.unlink()
    for number, name in zip(dataset.front_design.values, dataset.front_file.values, strict=True):
        values = dataset.value.values[int(number)]
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
    """The confirmed designs with their answers, and the values of their variables."""
    attributes, (every, *_) = dataset.attrs, dataset.result.shape
    hits, pilots = count_text(dataset.hits_per_design, "hit"), count_text(dataset.pilots, "pilot")
    counts = f"{count_text(every, 'design')} computed by the fast law with {hits} each, {pilots}"
    computed = f"{counts}; {dataset.refused_designs} more broke a constraint and were not computed"
    elements = attributes["element_hits"]
    method = f"{count_text(elements, 'hit')} by finite elements" if elements else "by the fast law alone"
    answers = f"{count_text(attributes['confirm_hits'], 'fresh hit')} each, {method}"
    confirmed, on_front = dataset.sizes["front"], int(dataset.front_confirmed.sum())
    again = f"front: {on_front} of {count_text(confirmed, 'confirmed design')} ({answers}; 95 % intervals)"
    left = int(dataset.on_front.values.sum()) - on_front
    more = f"{count_text(left, 'design')} more may be on it: raise search.confirmed to confirm them"
    texts = zip(dataset.front_file.values, dataset.text.values[dataset.front_design.values], strict=True)
    none = [_nearest(dataset)] if attributes["outcome"] == NONE_FEASIBLE else []
    return {
        "": [computed, again, *([more] if left > 0 and not none else []), *none],
        "objectives and bounds": [front_table(dataset)],
        "variables": [f"{name}: {text}" for name, text in texts],
    }


def front_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives, bounds and notes by answers: a row for each confirmed design and each reference."""
    goals = [dataset[name].values for name in ("goal", "goal_label", "goal_sign", "goal_limit")]
    columns, rows = [_heading(*goal) for goal in zip(*goals, strict=True)], dict[str, list[str]]()
    for targets, of in (("front_file", "front"), ("reference", "reference")):
        names = [targets, *(f"{of}_result{end}" for end in ("", "_low", "_high"))]
        for target, *ends in zip(*(dataset[name].values for name in names), strict=True):
            rows[target] = [_cell(*of_goal) for of_goal in zip(goals[0], *goals[2:], *ends, strict=True)]
    table = pd.DataFrame.from_dict(rows, "index", columns=columns).rename_axis("design")
    for place, file in enumerate(dataset.front_file.values):
        threats = dataset.front_worst_threat.values[place] if "front_worst_threat" in dataset else ()
        worst, outside = dict.fromkeys(filter(None, threats)), dataset.front_outside.values[place]
        notes = {
            "not on the front": not dataset.front_confirmed.values[place],
            outside.rstrip("."): outside.startswith("Outside"),
            f"worst threat: {', '.join(worst)}": worst,
        }
        table.loc[file, "note"] = "; ".join(note for note, holds in notes.items() if holds)
    return table.fillna("")


def _heading(goal: str, label: str, sign: int, limit: float) -> str:
    """A goal with its limit and its unit."""
    bound = "" if np.isnan(limit) else f" {'<' if sign > 0 else '>'}= {number_text(limit, _digits(goal)[0])}"
    return f"{goal}{bound} [{label.partition(' [')[2]}".removesuffix(" [")


def _digits(goal: str) -> tuple[str, str]:
    """Formats of a value of a goal and of the ends of its interval; shares in percent."""
    return (".1%", ".1%") if goal.startswith("P(") else ("#.4g", ".4g")


def _cell(goal: str, sign: int, limit: float, value: float, low: float, high: float) -> str:
    """A value of a goal with its interval, if it has one, and the verdict on a bound."""
    digits, ends = _digits(goal)
    if np.isnan(value):
        return "not known"
    interval = "" if low == high or np.isnan(low) else f" ({interval_text(low, high, digits=ends)})"
    verdict = "" if np.isnan(limit) else f", {bound_verdict(sign, limit, low, high)}"
    return number_text(value, digits) + interval + verdict


def _nearest(dataset: xarray.Dataset) -> str:
    """The design that comes nearest to the bounds, where none keeps them."""
    bounds = dataset.isel(goal=np.isfinite(dataset.goal_limit.values))
    labels, limits, signs = (bounds[name].values for name in ("goal_label", "goal_limit", "goal_sign"))
    over = np.maximum(signs * (bounds["result"].values - limits) / np.maximum(np.abs(limits), 1e-30), 0.0).sum(axis=1)
    nearest = int(np.nanargmin(over)) if np.isfinite(over).any() else 0
    texts = [
        f"{label} {'<' if sign > 0 else '>'}= {limit:.4g} (nearest: {number_text(value)})"
        for label, limit, sign, value in zip(labels, limits, signs, bounds["result"].values[nearest], strict=True)
    ]
    missed = "; ".join(texts) or "no hit of any design could be computed"
    return f"no design meets the bounds: {missed}; the nearest has {dataset.text.values[nearest]}"
