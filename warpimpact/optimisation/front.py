"""The front of a search: its Dataset, campaign files, what people read of it, and its correction by finite elements.

design      every design that was computed
variable    the free variables
goal        objectives, then bounds
front       designs of the front, computed again with fresh hits
reference   targets to compare with, with the hits of the front
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
import xarray
from numpy.typing import NDArray

from warpimpact.analysis.correction import corrected_estimate
from warpimpact.analysis.numbers import View, interval_text, number_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import outside_tested_range, range_line
from warpimpact.campaign.places import relocated
from warpimpact.optimisation.design import Bound, Design, Objective, target_weights
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import FRONT
from warpimpact.results.dataset import column, with_interval
from warpimpact.results.files import atomic_path
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.store import Store
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text, list_text
from warpimpact.statistics.comparisons import ROUNDED
from warpimpact.statistics.intervals import ANY_NUMBER, estimate_of, pseudo_values
from warpimpact.studies.correction import run_corrected

FEASIBLE, NONE_FEASIBLE = "front", "no design within the bounds"
"""How a search ended, its attribute `outcome`."""
SCRAMBLINGS = 16
"""Number of scramblings of the hits of a search: hit k belongs to scrambling k modulo this number."""


def goal_numbers(
    design: Design, weights: Mapping[str, float], columns: Array, goal: Objective | Bound
) -> tuple[Array, str]:
    """Numbers whose mean is a goal, shape [hits], and the threat that they are of; "" if of all threats, or of none.

    Args:
        weights: masses per area of the target.
        columns: numbers of every hit by each threat, shape [threats, columns, hits].
    """
    measure, threats = goal.spec, design.file.threats
    if measure.kind == "target":
        return np.array([weights[measure.name]]), ""
    numbers = columns[:, design.columns.index(measure.column)]
    if measure.kind == "quantile":  # of Harrell and Davis, a smooth function of the hits (statistics/intervals.py)
        numbers = np.array([pseudo_values(of_hits, measure.share) for of_hits in numbers])
    elif not measure.is_binary:
        numbers = np.array([measure.averaged(measure.counted(of_hits)) for of_hits in numbers])
    if goal.threats == "mean":
        shares = np.array([threat.weight for threat in threats])
        return np.asarray(shares @ numbers / shares.sum()), ""
    signed = goal.sign * np.array([known_mean(of_hits) for of_hits in numbers])
    worst = int(np.argmax(np.nan_to_num(signed, nan=np.inf)))
    return np.asarray(numbers[worst]), threats[worst].name


def known_mean(numbers: Array) -> float:
    """Mean of the numbers that count; NaN if none does."""
    known = numbers[~np.isnan(numbers)]
    return float(known.mean()) if len(known) else float("nan")


def interval(design: Design, goal: Objective | Bound, numbers: Array) -> tuple[float, float, float]:
    """A goal with the ends of its interval, from `goal_numbers`."""
    if goal.spec.kind == "target":
        return (float(numbers[0]),) * 3
    is_share = goal.spec.is_binary and (goal.threats == "worst" or len(design.file.threats) == 1)
    bounds = goal.spec.bounds if goal.spec.kind == "mean" or goal.spec.is_binary else ANY_NUMBER
    estimate = estimate_of("share" if is_share else "mean", numbers, bounds=bounds, replicates=SCRAMBLINGS)
    return estimate.value, estimate.low, estimate.high


def objectives_and_excesses(design: Design, results: Array) -> tuple[Array, Array]:
    """Objectives to minimise, and by how much each bound is exceeded, of designs with these goals, shape [designs, …].

    An objective is infinite where no hit counts. An excess is a share of the limit, 0 where the bound is kept to
    rounding, and 1 where no hit counts.
    """
    signed, count = np.array([goal.sign for goal in design.goals]) * results, len(design.file.objectives)
    limits = np.array([bound.sign * bound.limit for bound in design.file.bounds])
    shares = np.nan_to_num((signed[:, count:] - limits) / np.where(limits, np.abs(limits), 1.0), nan=1.0)
    objectives = np.nan_to_num(signed[:, :count], nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return objectives, np.where(shares > ROUNDED, shares, 0.0)


def nondominated(design: Design, results: Array) -> NDArray[np.int64]:
    """Numbers of the designs within the bounds that no other one dominates, sorted by the first objective.

    Of designs that agree in seven digits the first counts.
    """
    import moocore

    objectives, excesses = objectives_and_excesses(design, results)
    within = np.flatnonzero(np.isfinite(objectives).all(axis=1) & ~excesses.any(axis=1))
    if not len(within):
        return within
    rounded = np.array([[float(f"{number:.7g}") for number in row] for row in objectives[within]])
    front = within[moocore.is_nondominated(rounded)]
    return np.asarray(front[np.lexsort(objectives[front].T[::-1])])


def designs_folder(output: Path) -> Path:
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
    """The Dataset of a search.

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
    each = [[interval(design, goal, of[0]) for goal, of in zip(goals, row, strict=True)] for row in of_targets]
    ends = np.array(each).reshape(-1, len(goals), 3)
    on_front = np.isin(np.arange(len(values)), front).astype(np.int8)
    confirmed = np.isin(np.arange(size), nondominated(design, ends[:size, :, 0])).astype(np.int8)
    tomls = [tomli_w.dumps(_tables_of(design, values[k], 0)) for k in numbers]
    units = [free.unit for free in variables]
    labels = [json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables]
    unique = [name if names.count(name) == 1 else f"{name}_{place}" for place, name in enumerate(names)]
    limits = [goal.limit if isinstance(goal, Bound) else np.nan for goal in goals]
    texts, of_search = [*map(design.space.text, values)], "objective or bound by the hits of the search"
    used = "value in its unit; number of a choice; none where unused"
    outside = [_range(design, tables) for tables in targets[:size]]
    confirms = "1 where fresh hits leave it on the front and within the bounds, else 0"
    parts: dict[str, tuple[Any, ...]] = {
        "variable": column("variable", [variable.name for variable in variables], "1", "free variable"),
        "variable_unit": column("variable", units, "1", "unit of the variable, as the design file has it"),
        "variable_labels": column("variable", labels, "1", "what a variable chooses from, as a JSON list"),
        "goal": column("goal", unique, "1", "objective or bound"),
        "goal_label": column("goal", [goal.spec.title for goal in goals], "1", "what it is, for people, with its unit"),
        "goal_sign": column("goal", [int(one.sign) for one in goals], "1", "1 where less is sought, -1 where more is"),
        "goal_limit": column("goal", limits, "1", "limit of a bound in its own units; no value of an objective"),
        "value": column(("design", "variable"), values, "1", used),
        "text": column("design", texts, "1", "names and values of the variables that count"),
        "result": column(("design", "goal"), results, "1", f"{of_search}, in its own units"),
        "on_front": column("design", on_front, "1", "1 on the front of the search, else 0"),
        "front_design": column("front", numbers, "1", "number of the design"),
        "front_confirmed": column("front", confirmed, "1", confirms),
        "front_campaign": column("front", tomls, "1", "campaign of the first threat, as TOML"),
        "front_file": column("front", [f"design_{k:02d}.toml" for k in range(size)], "1", "name of its campaign file"),
        "front_outside": column("front", outside, "1", "whether it is inside the tested range, or what is outside"),
        "reference": column("reference", [one.name for one in design.file.references], "1", "target to compare with"),
        **with_interval(
            "front_result", ("front", "goal"), ends[:size], "1", "objective or bound by fresh hits, in its own units"
        ),
        **with_interval(
            "reference_result", ("reference", "goal"), ends[size:], "1", "objective or bound, in its own units"
        ),
    }
    if len(design.file.threats) > 1 and size:
        worst = [[threat for _, threat in of_target] for of_target in of_targets[:size]]
        parts["front_worst_threat"] = column(
            ("front", "goal"), worst, "1", "threat whose hits count; empty if all count, or none"
        )
    if design.columns and size:
        fresh = (design.campaign(tables, seed=design.fresh_seed) for tables in targets[:size])
        shots = [campaign.sampler().shots(0, columns.shape[-1]) for campaign in fresh]
        place = "hit point in the irreducible part of the cell"
        by_hit = ("front", "effect", "hit")
        parts |= {
            "front_hit_y": column(("front", "hit"), [some.hit_y for some in shots], "m", f"{place}, y"),
            "front_hit_z": column(("front", "hit"), [some.hit_z for some in shots], "m", f"{place}, z"),
            "front_hit_value": column(by_hit, columns[:size, 0], "1", "value of the hit, of the first threat"),
        }
    attributes = {
        "Conventions": "CF-1.11",
        attr.REFERENCES: "docs/howto/optimise.md of warpimpact",
        attr.KIND: FRONT.mark,
        attr.TITLE: design.base.get("title", ""),
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.file.search.seed,
        "design_file": design.text,
        "outcome": FEASIBLE if size else NONE_FEASIBLE,
        "hits_per_design": design.file.search.hits if design.columns else 0,
        "confirm_hits": design.file.search.confirm_hits,
    }
    # A selected value keeps its unit and label.
    return xarray.Dataset(parts, attrs=attributes).set_coords(["variable_unit", "goal_label"])


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
    """The front with intervals, and the values of its variables."""
    attributes, (every, *_) = dataset.attrs, dataset.result.shape
    hits, pilots = count_text(dataset.hits_per_design, "hit"), count_text(dataset.pilots, "pilot")
    counts = f"{count_text(every, 'design')} computed with {hits} each, {pilots}"
    computed = f"{counts}; {dataset.refused_designs} more broke a constraint and were not computed"
    if attributes["outcome"] == NONE_FEASIBLE:
        return {"": [computed, _nearest(dataset)]}
    on_front, confirmed = int(dataset.on_front.sum()), dataset.sizes["front"]
    fresh = f"{confirmed} of them computed again with {count_text(attributes['confirm_hits'], 'fresh hit')} each"
    again = f"front: {count_text(on_front, 'design')}, {fresh}"
    texts = zip(dataset.front_file.values, dataset.text.values[dataset.front_design.values], strict=True)
    variables = [f"{name}: {text}" for name, text in texts]
    corrected: list[str | pd.DataFrame] = []
    if "front_corrected" in dataset:
        table = corrected_table(dataset)
        unknown = [str(name) for name, row in table.iterrows() if "-" in row.to_list()]
        why = f"Finite elements give no number of {list_text(unknown)}: too few of its hits ended soundly."
        corrected = [table, *([why] if unknown else []), *changed_places(dataset)]
    hits = count_text(attributes.get("continuum_hits", 0), "hit")
    return {
        "": [computed, again],
        "objectives and bounds": [front_table(dataset)],
        f"corrected by {hits} of each plate by finite elements": corrected,
        "variables": variables,
    }


def corrected_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives and bounds by fresh hits of the fast law, and as finite elements correct them."""
    law, corrected = _table(dataset, "result"), _table(dataset, "corrected", "corrected_low", "corrected_high")
    exact = (dataset.front_corrected_low == dataset.front_corrected_high).all(dim="front").values  # as a weight
    columns: list[tuple[str, pd.Series[str]]] = []
    for place, goal in enumerate(dataset.goal.values):
        columns.append((goal if exact[place] else f"{goal}, fast law", law.iloc[:, place]))
        columns += [] if exact[place] else [("corrected", corrected.iloc[:, place])]
    table: pd.DataFrame = pd.concat([texts for _, texts in columns], axis=1)
    return table.set_axis([name for name, _ in columns], axis=1)


def _table(dataset: xarray.Dataset, *numbers: str) -> pd.DataFrame:
    """Texts of every goal: a row for each design of the front and each reference, a column for each goal.

    The numbers are a value, and perhaps the ends of its interval.
    """
    rows = dict[str, list[str]]()
    for targets, of in (("front_file", "front"), ("reference", "reference")):
        names = [targets, *(f"{of}_{number}" for number in numbers)]
        for target, *ends in zip(*(dataset[name].values for name in names), strict=True):
            rows[target] = [_text(*of_goal) for of_goal in zip(dataset.goal.values, *ends, strict=True)]
    return pd.DataFrame.from_dict(rows, "index", columns=dataset.goal.values).rename_axis("design")


def _text(goal: str, value: float, low: float = np.nan, high: float = np.nan) -> str:
    """A value of a goal with its interval, if it has one; shares in percent."""
    digits, ends = (".1%", ".1%") if goal.startswith("P(") else ("#.4g", ".4g")
    interval = "" if low == high or np.isnan(value + low) else f" ({interval_text(low, high, digits=ends)})"
    return number_text(value, digits) + interval


def changed_places(dataset: xarray.Dataset) -> list[str]:
    """Which designs change places by the corrected values, a sentence for each objective."""
    sentences, names = [], np.array([Path(name).stem for name in dataset.front_file.values])
    for goal in np.flatnonzero(np.isnan(dataset.goal_limit.values)):
        sign, label = dataset.goal_sign.values[goal], dataset.goal.values[goal]
        law, value = (sign * dataset[name].values[:, goal] for name in ("front_result", "front_corrected"))
        known = np.flatnonzero(np.isfinite(value))
        before, after = (names[known[np.argsort(numbers[known], kind="stable")]] for numbers in (law, value))
        if (before != after).any():
            moved = list_text(sorted(before[before != after]))
            sentences.append(f"By corrected {label}, {moved} change places. Best first: {', '.join(after)}.")
    return sentences or ["No design changes its place by the corrected values."]


def front_table(dataset: xarray.Dataset) -> pd.DataFrame:
    """Objectives, bounds and notes by fresh hits: a row for each design of the front and each reference."""
    labels = zip(dataset.goal.values, dataset.goal_label.values, strict=True)
    columns = [f"{name} [{label.partition(' [')[2]}".removesuffix(" [") for name, label in labels]
    table = _table(dataset, "result", "result_low", "result_high").set_axis(columns, axis=1)
    for place, file in enumerate(dataset.front_file.values):
        threats = dataset.front_worst_threat.values[place] if "front_worst_threat" in dataset else ()
        worst, outside = dict.fromkeys(filter(None, threats)), dataset.front_outside.values[place]
        notes = {
            "not on the front by fresh hits": not dataset.front_confirmed.values[place],
            outside.rstrip("."): outside.startswith("Outside"),
            f"worst threat: {', '.join(worst)}": worst,
        }
        table.loc[file, "note"] = "; ".join(note for note, holds in notes.items() if holds)
    return table.fillna("")


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


def correct_front(design: Design, dataset: xarray.Dataset, store: Store, options: RunOptions) -> xarray.Dataset:
    """The front of a search with the corrected objectives and bounds of its designs and references.

    The corrected maps of design_00.toml, … are beside them as design_00.nc, …; those that are there are taken.

    Args:
        dataset: the Dataset of `optimise`.
        store, options: as in `optimise`.

    Raises:
        CampaignError: a plate has no material with constants of the continuum.
        OutputError, DeviceError, Interrupted: as in `optimise`.
    """
    plan = design.file.search
    tables = [design.tables(dataset.value.values[int(k)]) for k in dataset.front_design.values]
    targets = {Path(name).stem: of for name, of in zip(dataset.front_file.values, tables, strict=True)}
    for place, reference in enumerate(design.file.references):
        targets[f"reference_{place:02d}"] = reference.tables(design.base)
    assert store.path is not None
    folder, ends = designs_folder(store.path), []
    folder.mkdir(parents=True, exist_ok=True)
    for place, (name, of) in enumerate(targets.items()):
        results = []
        for threat, _ in enumerate(design.file.threats):
            text = tomli_w.dumps(campaign_tables(design, of, threat, name))
            path = folder / (f"{name}_{threat}.nc" if threat else f"{name}.nc")
            campaign = Campaign.from_text(text, name=name, folder=design.folder, count=plan.confirm_hits)

            def follow(now: RunProgress, name: str = name, place: int = place) -> None:
                words = f"{name} by finite elements, {now.done} of {count_text(now.total, 'hit')}"
                options.progress(RunProgress(place, len(targets), text=words))

            how, own = replace(options, progress=follow), replace(store, path=path)
            count = int(plan.continuum_hits or 0)
            results.append(run_corrected(campaign, own, continuum_hits=count, options=how))
        weights = target_weights(design.campaign(of).target)
        ends.append([corrected_goal(goal, weights, results, design) for goal in design.goals])
    numbers = np.array(ends).reshape(-1, len(design.goals), 3)
    meaning = "objective or bound, corrected by finite elements"
    of_front = with_interval("front_corrected", ("front", "goal"), numbers[: len(tables)], "1", meaning)
    of_references = with_interval("reference_corrected", ("reference", "goal"), numbers[len(tables) :], "1", meaning)
    return dataset.assign(of_front | of_references).assign_attrs({"continuum_hits": plan.continuum_hits})


def corrected_goal(
    goal: Objective | Bound, weights: dict[str, float], results: Sequence[xarray.DataTree], design: Design
) -> tuple[float, float, float]:
    """A goal with the ends of its interval, from the corrected results of a target by each threat; NaN where elements
    say nothing of it."""
    measure = goal.spec
    if measure.kind == "target":
        return (weights[measure.name],) * 3
    known = [None if measure.is_limit else corrected_estimate(result, measure) for result in results]
    estimates = [one for one in known if one is not None]
    if len(estimates) < len(results):
        return (math.nan,) * 3
    if goal.threats == "worst":
        worst = max(estimates, key=lambda one: goal.sign * one.value)
        return worst.value, worst.low, worst.high
    weight = np.array([threat.weight for threat in design.file.threats])
    shared = [*zip(weight / weight.sum(), estimates, strict=True)]
    mean = float(sum(share * one.value for share, one in shared))
    below, above = (  # the errors of different threats are independent
        math.hypot(*(share * (getattr(one, end) - one.value) for share, one in shared)) for end in ("low", "high")
    )
    return mean, mean - below, mean + above
