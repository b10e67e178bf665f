"""From a design file to its front: search, fresh hits, file and campaigns."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray

from warpimpact.campaign.places import relocated
from warpimpact.campaign.tested_range import outside_tested_range
from warpimpact.optimisation.design import Bound, Design, FacedThreat, read_design
from warpimpact.optimisation.objectives import Candidate, estimate
from warpimpact.optimisation.search import (
    Confirmed,
    Follow,
    Searched,
    check_installed,
    confirm,
    fresh_seed,
    references,
    search,
)
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import front as f
from warpimpact.results.dataset import dataset_of
from warpimpact.results.files import OutputError, aside
from warpimpact.results.kinds import FRONT
from warpimpact.runs.executor import Executor, executor_for, opened
from warpimpact.runs.parts import is_begun, remove
from warpimpact.runs.questions import Question, Store, answered, content_of, stored
from warpimpact.scene.model import Array


def optimise(design: Design | str | Path, *, device: str = "auto", progress: Follow | None = None) -> xarray.Dataset:
    """Search the best designs, in memory.

    Args:
        design: the design, or its file.
        device: "auto" (CUDA if there is one, else the CPU), "cpu" or "cuda:0".

    Returns:
        The Dataset of results/front.py: every computed design, and the front by fresh hits.

    Raises:
        CampaignError: the file has a value that is not allowed, or no design keeps the constraints.
        DeviceError: the device is absent.
    """
    design = design if isinstance(design, Design) else read_design(design)
    with executor_for(device) as executor:
        return _answered(design, executor, progress)


def optimise_to_file(
    design: Design,
    output: Path,
    *,
    device: str | Executor = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> list[Path]:
    """Search the best designs into a file, with a campaign file for each design of the front in `folder_of(output)`.
    Computed designs are on the disk at once, in `output`.parts.

    Args:
        resume: continue what is in `output`.parts; for a complete search, write the missing campaigns.
        overwrite: replace an existing result with its campaigns, and begin anew in place of an unfinished search.
        tell: called with a sentence for each damaged part, which is computed again, and for each changed campaign,
            which is kept.

    Returns:
        The campaign files.

    Raises:
        OutputError: a file cannot be written, must not be overwritten or belongs to another search.
        CampaignError: no design keeps the constraints.
        Interrupted: the user interrupted the search; what is saved can be resumed.
    """
    folder = folder_of(output)
    check_campaigns(folder, overwrite=overwrite or (resume and is_begun(output)))
    with opened(device) as computing:
        content = content_of(design.text, design.name, design.folder, computing.made_by)
        with stored(output, content, "search", resume=resume, overwrite=overwrite, tell=tell) as store:
            if store is not None:
                dataset = _answered(design, computing, progress, store)
                files.write(dataset.assign_attrs({attr.FINGERPRINT: store.parts.fingerprint}), output)
    return write_campaigns(design, files.read(output, FRONT), folder, overwrite=overwrite, tell=tell)


def folder_of(output: Path) -> Path:
    """Folder of the campaigns of the designs of a front."""
    return output.with_name(f"{output.stem}_designs")


def _answered(
    design: Design, executor: Executor, progress: Follow | None, store: Store | None = None
) -> xarray.Dataset:
    check_installed()
    references(design)  # refused before anything is computed

    def question() -> Question[tuple[Searched, Confirmed]]:
        searched = yield from search(design, progress or (lambda now: None))
        return searched, (yield from confirm(design, searched, progress or (lambda now: None)))

    return to_dataset(design, *answered(question(), executor, store), executor.made_by)


def to_dataset(design: Design, searched: Searched, confirmed: Confirmed, made_by: Mapping[str, str]) -> xarray.Dataset:
    """The Dataset of results/front.py."""
    goals, variables, front = design.goals, design.space.variables, len(confirmed.numbers)
    names = [goal.measure for goal in goals]
    fresh, rivals = confirmed.candidates[:front], confirmed.candidates[front:]
    count = len(searched.candidates)
    columns: dict[Any, Any] = {
        f.NAME: _texts(variable.name for variable in variables),
        f.UNIT: _texts(variable.unit for variable in variables),
        f.LABELS: _texts(json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables),
        f.GOAL: _texts(name if names.count(name) == 1 else f"{name}_{place}" for place, name in enumerate(names)),
        f.GOAL_LABEL: _texts(goal.spec.title for goal in goals),
        f.GOAL_SIGN: [int(goal.sign) for goal in goals],
        f.GOAL_LIMIT: [goal.limit if isinstance(goal, Bound) else np.nan for goal in goals],
        f.VALUE: np.array([one.point for one in searched.candidates]).reshape(count, len(variables)),
        f.RESULT: np.array([one.results for one in searched.candidates]).reshape(count, len(goals)),
        f.LEVELS: _texts(_levels(one) for one in searched.candidates),
        f.ON_FRONT: np.isin(np.arange(count), searched.front).astype(np.int8),
        f.NUMBER: confirmed.numbers,
        f.CONFIRMED: confirmed.on_front.astype(np.int8),
        f.CAMPAIGN: _texts(_campaign(design, one) for one in fresh),
        f.FILE: _texts(f"design_{number:02d}.toml" for number in range(front)),
        f.FRESH_LEVELS: _texts(_levels(one) for one in fresh),
        f.OUTSIDE: _texts(_outside(design, one) for one in fresh),
        f.REFERENCE: _texts(reference.name for reference in design.references),
        f.REFERENCE_CAMPAIGN: _texts(_campaign(design, one) for one in rivals),
    }
    ends = np.array(
        [
            [
                [number.value, number.low, number.high]
                for number in (estimate(design, one.weights, hits, goal) for goal in goals)
            ]
            for one, hits in zip(confirmed.candidates, confirmed.columns, strict=True)
        ]
    ).reshape(len(confirmed.candidates), len(goals), 3)
    columns |= zip((f.FRESH, f.FRESH_LOW, f.FRESH_HIGH), np.moveaxis(ends[:front], -1, 0), strict=True)
    columns |= zip(
        (f.REFERENCE_RESULT, f.REFERENCE_LOW, f.REFERENCE_HIGH), np.moveaxis(ends[front:], -1, 0), strict=True
    )
    if design.columns and front:
        seed, hits = fresh_seed(design), confirmed.columns.shape[-1]
        shots = [design.campaign(one.tables, seed=seed).sampler().shots(0, hits) for one in fresh]
        columns |= {f.HIT_Y: [some.hit_y for some in shots], f.HIT_Z: [some.hit_z for some in shots]}
        columns[f.HIT_VALUE] = confirmed.columns[:front, 0]
    attributes = {
        attr.REFERENCES: f.REFERENCES,
        **made_by,
        attr.KIND: FRONT.mark,
        attr.TITLE: design.title,
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.search.seed,
        f.DESIGN: design.text,
        f.OUTCOME: f.FEASIBLE if front else f.NONE_FEASIBLE,
        f.HITS: design.search.hits if design.columns else 0,
        f.REFUSED: searched.refused,
        f.PILOTS: searched.pilots,
    }
    # a selected value keeps its unit and its label
    return dataset_of(columns, attributes).set_coords([f.UNIT, f.GOAL_LABEL])


def _outside(design: Design, candidate: Candidate) -> str:
    """In what the plates of a design lie outside the tested range: the words before the plate's name."""
    sentences = outside_tested_range(design.campaign(candidate.tables))
    heads = (sentence.partition(": ")[0] for sentence in sentences)
    return ", ".join(dict.fromkeys(head.partition(" (")[0] for head in heads if " (" in head))


def _texts(texts: Any) -> Any:
    return np.array(list(texts), dtype=object)


def _levels(candidate: Candidate) -> str:
    return json.dumps([json.loads(level) for level in candidate.levels])


def _campaign(design: Design, candidate: Candidate) -> str:
    """The campaign of a target with the first threat, as TOML."""
    return tomli_w.dumps(campaign_tables(design, candidate.tables, candidate.point, design.threats[0]))


def campaign_tables(design: Design, tables: Mapping[str, Any], point: Array, threat: FacedThreat) -> dict[str, Any]:
    """The tables of the campaign of a target and a threat, for `warpimpact run`. A reference has no point."""
    made: dict[str, Any] = json.loads(json.dumps(design.against(tables, threat), default=str))
    made.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.search.seed})
    named = f", {threat.name}" if len(design.threats) > 1 else ""
    values = design.space.text(point) if len(point) else ""
    return made | {"title": " ".join(f"{design.title}{named}: {values}"[:200].split()).rstrip(":")}


def check_campaigns(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder for campaigns that is not empty, before anything is computed.

    Raises:
        OutputError: the folder has content, or is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is no folder, but the campaigns of the designs need one of this name")
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise OutputError(
            f"{folder}: contains files already, and the campaigns of the designs belong there; name another file or "
            "give --overwrite"
        )


def write_campaigns(
    design: Design,
    dataset: xarray.Dataset,
    folder: Path,
    *,
    overwrite: bool,
    tell: Callable[[str], object] = warnings.warn,
) -> list[Path]:
    """Write a campaign file per design of the front, and per threat if there are several.

    Args:
        overwrite: replace campaigns of an earlier search, and remove those of designs that are no longer on the front;
            otherwise a changed file is kept.
        tell: called with a sentence for each file that is kept.

    Returns:
        The campaign files.

    Raises:
        OutputError: a file cannot be written.
    """
    numbers, names = dataset[f.NUMBER].values, dataset[f.FILE].values
    texts = {}
    for number, name in zip(numbers, names, strict=True):
        values = dataset[f.VALUE].values[int(number)]
        target = design.tables(values)
        for place, threat in enumerate(design.threats):
            tables = relocated(campaign_tables(design, target, values, threat), design.folder, folder)
            ending = f"_{place}" if len(design.threats) > 1 else ""
            texts[folder / f"{Path(str(name)).stem}{ending}.toml"] = tomli_w.dumps(tables)
    if overwrite:
        for stale in set(folder.glob("design_[0-9]*.toml")) - texts.keys():
            remove(stale)
    if texts:
        folder.mkdir(parents=True, exist_ok=True)
    for path, text in texts.items():
        if overwrite or not path.exists():
            with aside(path) as file:
                file.write_text(text, encoding="utf-8")
        elif not path.is_file() or path.read_bytes() != text.encode():
            tell(f"{path}: differs from the design of the front and is kept; --overwrite replaces it")
    return list(texts)
