"""The Dataset of a search, and the campaign files of its front."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.campaign.places import relocated
from warpimpact.campaign.tested_range import outside_tested_range
from warpimpact.campaign.toml import toml_text
from warpimpact.optimisation.asked import Bound
from warpimpact.optimisation.confirm import Confirmed
from warpimpact.optimisation.design import Design, FacedThreat
from warpimpact.optimisation.evaluate import campaign_of
from warpimpact.optimisation.judged import DesignRecord, estimate
from warpimpact.optimisation.search import Searched
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results.dataset import dataset_of
from warpimpact.results.files import OutputError, aside
from warpimpact.results.kinds import FRONT
from warpimpact.runs.parts import remove
from warpimpact.scene.model import Array

if TYPE_CHECKING:
    import xarray

_LONGEST_ENDING = 80
"""Most bytes of a threat's name in a file name. File systems allow 255 in all."""


def key_of(design: Design, place: int) -> str:
    """Unique name of an objective or bound in the file."""
    names = [goal.measure for goal in design.asked]
    return names[place] if names.count(names[place]) == 1 else f"{names[place]}_{place}"


def to_dataset(design: Design, searched: Searched, confirmed: Confirmed, made_by: Mapping[str, str]) -> xarray.Dataset:
    """The Dataset of results/front.py."""
    asked, variables = design.asked, design.space.variables
    on_front = np.zeros(len(searched.records), dtype=np.int8)
    on_front[searched.front] = 1
    width = max(2, len(str(max(len(confirmed.numbers) - 1, 0))))
    columns: dict[Any, Any] = {
        f.NAME: _texts(variable.name for variable in variables),
        f.UNIT: _texts(variable.unit for variable in variables),
        f.LABELS: _texts(json.dumps(free.labels, ensure_ascii=False) if free.labels else "" for free in variables),
        f.ASKED: _texts(key_of(design, place) for place in range(len(asked))),
        f.LABEL: _texts(goal.asked.title for goal in asked),
        f.SIGN: [int(goal.sign) for goal in asked],
        f.ASKED_LIMIT: [goal.limit if isinstance(goal, Bound) else np.nan for goal in asked],
        f.VALUE: np.array([record.values for record in searched.records]).reshape(
            len(searched.records), len(variables)
        ),
        f.HITS: [record.hits for record in searched.records],
        f.LEVELS: _texts(_levels(record) for record in searched.records),
        f.COST: [record.seconds for record in searched.records],
        f.ON_FRONT: on_front,
        f.NUMBER: confirmed.numbers,
        f.KEPT: confirmed.kept.astype(np.int8),
        f.GROUP: confirmed.groups,
        f.CAMPAIGN: _texts(_campaign(design, record) for record in confirmed.records),
        f.FILE: _texts(f"design_{number:0{width}d}.toml" for number in range(len(confirmed.records))),
        f.FRESH_LEVELS: _texts(_levels(record) for record in confirmed.records),
        f.REFERENCE: _texts(reference.name for reference in design.references),
        f.REFERENCE_CAMPAIGN: _texts(_campaign(design, record) for record in confirmed.references),
        f.COMPUTED: searched.history[:, 0].astype(np.int64),
        f.VOLUME: searched.history[:, 1],
        f.UNTESTED: _texts(_untested(design, record) for record in confirmed.records),
    }
    for records, names in (
        (searched.records, (f.FOUND, f.FOUND_LOW, f.FOUND_HIGH)),
        (confirmed.records, (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)),
        (confirmed.references, (f.REFERENCE_FOUND, f.REFERENCE_LOW, f.REFERENCE_HIGH)),
        (confirmed.solids, (f.SOLID,)),
    ):
        columns |= dict(zip(names, _estimates(design, records), strict=False))
    if design.keys and len(confirmed.records):
        columns |= {f.HIT_Y: confirmed.places[:, 0], f.HIT_Z: confirmed.places[:, 1]}
        columns[f.HIT_VALUE] = np.array([record.said[0] for record in confirmed.records])
    dataset = dataset_of(columns, {attr.REFERENCES: f.REFERENCES, **_attributes(design, searched, made_by)})
    return dataset.set_coords([f.UNIT, f.LABEL])  # a selected value keeps its unit and its label


def _untested(design: Design, record: DesignRecord) -> str:
    """In what the plates of a design lie outside the tested range: the words before the plate's name."""
    sentences = outside_tested_range(campaign_of(design, record.tables, design.threats[0]))
    heads = (sentence.partition(": ")[0] for sentence in sentences)
    return ", ".join(dict.fromkeys(head.partition(" (")[0] for head in heads if " (" in head))


def _texts(texts: Any) -> Any:
    return np.array(list(texts), dtype=object)


def _levels(record: DesignRecord) -> str:
    return json.dumps([json.loads(level) for level in record.levels if level])


def _estimates(design: Design, records: Sequence[DesignRecord]) -> Array:
    """Values, and lower and upper ends of their intervals, shape [3, records, asked]."""
    rows = [[estimate(design, record, goal) for goal in design.asked] for record in records]
    ends = [[[number.value, number.low, number.high] for number in row] for row in rows]
    return np.moveaxis(np.array(ends, dtype=float).reshape(len(records), len(design.asked), 3), -1, 0)


def _attributes(design: Design, searched: Searched, made_by: Mapping[str, str]) -> dict[str, Any]:
    return {
        **made_by,
        attr.KIND: FRONT.mark,
        attr.TITLE: design.title,
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.search.seed,
        f.DESIGN: design.text,
        f.OUTCOME: f.FEASIBLE if len(searched.front) else f.NONE_FEASIBLE,
        f.BOX: np.concatenate([searched.reference, searched.scale]),
        f.REFUSED: searched.refused,
        f.PILOTS: searched.pilots,
    }


def _campaign(design: Design, record: DesignRecord) -> str:
    """The campaign of a target with the first threat, as TOML."""
    return toml_text(campaign_tables(design, record.tables, record.values, design.threats[0]))


def campaign_tables(design: Design, tables: Mapping[str, Any], values: Array, threat: FacedThreat) -> dict[str, Any]:
    """The tables of the campaign of a target and a threat, for `warpimpact run`. A reference has no values."""
    made = json.loads(json.dumps(tables, default=str))
    named = f", {threat.name}" if len(design.threats) > 1 else ""
    told = design.space.text(values) if len(values) else ""
    made["title"] = " ".join(f"{design.title}{named}: {told}"[:200].split()).rstrip(":")
    if threat.core:
        made["core"] = dict(threat.core)
    made["impact"] = made.get("impact", {}) | threat.impact
    made.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.search.seed})
    return dict(made)


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
        for threat, ending in zip(design.threats, endings(design.threats), strict=True):
            tables = relocated(campaign_tables(design, target, values, threat), design.folder, folder)
            texts[folder / f"{Path(str(name)).stem}{ending}.toml"] = toml_text(tables)
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


def endings(threats: Sequence[FacedThreat]) -> list[str]:
    """Unique endings of the names of campaign files, one per threat; empty for a single threat."""
    if len(threats) == 1:
        return [""]
    words = ["".join(c if c.isalnum() else "_" for c in threat.name) for threat in threats]
    short = [word.encode()[:_LONGEST_ENDING].decode(errors="ignore") for word in words]
    alike = len({word.casefold() for word in short}) < len(short)  # some file systems ignore the case
    return [f"_{number}_{word}" if alike else f"_{word}" for number, word in enumerate(short)]
