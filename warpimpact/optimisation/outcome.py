"""A search as the Dataset of its file, and as campaign files of its front."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.toml import toml_text
from warpimpact.optimisation.confirm import Confirmed
from warpimpact.optimisation.design import Bound, Design, Objective, Threat
from warpimpact.optimisation.judged import Record, estimate
from warpimpact.optimisation.measures import AREAL_DENSITY, WORST_TENTH
from warpimpact.optimisation.search import Searched
from warpimpact.results import attributes as attr
from warpimpact.results import front as f
from warpimpact.results.files import aside

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

LABELS = {
    AREAL_DENSITY: ("areal density", "kg/m²"),
    "residual_energy_fraction": ("residual energy fraction", ""),
    "residual_energy_density": ("energy per presented area", "J/mm²"),
    "tilted_share": ("P(inclined > {angle:g}°, or stopped)", ""),
    "stopped_share": ("P(stopped)", ""),
    "broken_share": ("P(broken)", ""),
    "stopped_or_broken_share": ("P(stopped, or broken)", ""),
    "base_perforated_share": ("P(base perforated)", ""),
    "base_pierced_share": ("P(base pierced)", ""),
    "base_depth": ("depth in the base", "mm"),
    "limit_velocity": ("limit velocity", "m/s"),
    "limit_thickness": ("limit thickness", "mm"),
    "limit_areal_density": ("areal density needed", "kg/m²"),
}


def label_of(one: Objective | Bound) -> str:
    """An objective or a bound for people, with its unit."""
    name, unit = LABELS[one.measure.removesuffix(WORST_TENTH)]
    text = name.format(angle=np.degrees(float(one.angle)))
    if one.standoff is not None:
        text += f" at {1e3 * one.standoff:g} mm"
    text += f" of layer {one.layer}" if one.layer else ""
    text += ", worst tenth" if one.measure.endswith(WORST_TENTH) else ""
    return f"{text} [{unit}]" if unit else text


def key_of(design: Design, place: int) -> str:
    """Name of an objective or bound in the file, each its own."""
    names = [one.measure for one in design.asked]
    return names[place] if names.count(names[place]) == 1 else f"{names[place]}_{place}"


def to_dataset(design: Design, found: Searched, confirmed: Confirmed, made_by: Mapping[str, str]) -> xarray.Dataset:
    """The Dataset of results/front.py."""
    asked, variables = design.asked, design.space.variables
    on_front = np.zeros(len(found.records), dtype=np.int8)
    on_front[found.front] = 1
    width = max(2, len(str(max(len(confirmed.numbers) - 1, 0))))
    columns: dict[Any, Any] = {
        f.NAME: _texts(one.name for one in variables),
        f.UNIT: _texts(one.unit for one in variables),
        f.LABELS: _texts(json.dumps(one.labels, ensure_ascii=False) if one.labels else "" for one in variables),
        f.ASKED: _texts(key_of(design, place) for place in range(len(asked))),
        f.LABEL: _texts(map(label_of, asked)),
        f.SIGN: [int(one.sign) for one in asked],
        f.LIMIT: [one.limit if isinstance(one, Bound) else np.nan for one in asked],
        f.VALUE: np.array([one.values for one in found.records]).reshape(len(found.records), len(variables)),
        f.HITS: [one.hits for one in found.records],
        f.LEVELS: _texts(_levels(one) for one in found.records),
        f.COST: [one.seconds for one in found.records],
        f.ON_FRONT: on_front,
        f.NUMBER: confirmed.numbers,
        f.KEPT: confirmed.kept.astype(np.int8),
        f.GROUP: confirmed.groups,
        f.SURVIVAL: confirmed.survival[..., 0],
        f.SURVIVAL_AT_LEAST: confirmed.survival[..., 1],
        f.CAMPAIGN: _texts(toml_text(campaign_tables(design, one, 0)) for one in confirmed.records),
        f.FILE: _texts(f"design_{number:0{width}d}.toml" for number in range(len(confirmed.records))),
        f.FRESH_LEVELS: _texts(_levels(one) for one in confirmed.records),
        f.REFERENCE: _texts(one.name for one in design.references),
        f.REFERENCE_CAMPAIGN: _texts(toml_text(campaign_tables(design, one, 0)) for one in confirmed.references),
        f.COMPUTED: found.history[:, 0].astype(np.int64),
        f.VOLUME: found.history[:, 1],
    }
    for records, names in (
        (found.records, (f.FOUND, f.FOUND_LOW, f.FOUND_HIGH)),
        (confirmed.records, (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)),
        (confirmed.references, (f.REFERENCE_FOUND, f.REFERENCE_LOW, f.REFERENCE_HIGH)),
        (confirmed.solids, (f.SOLID,)),
    ):
        columns |= dict(zip(names, _estimates(design, records), strict=False))
    if design.keys and len(confirmed.records):
        columns |= {f.HIT_Y: confirmed.places[:, 0], f.HIT_Z: confirmed.places[:, 1]}
        columns[f.HIT_VALUE] = np.array([one.said[0] for one in confirmed.records])
    return f.dataset_of(columns, _attributes(design, found, made_by))


def _texts(texts: Any) -> Any:
    return np.array(list(texts), dtype=object)


def _levels(record: Record) -> str:
    return json.dumps([json.loads(level) for level in record.levels if level])


def _estimates(design: Design, records: Sequence[Record]) -> Array:
    """Values and both ends of their intervals, shape [3, records, asked]."""
    rows = [[estimate(design, record, one) for one in design.asked] for record in records]
    ends = [[[one.value, one.low, one.high] for one in row] for row in rows]
    return np.moveaxis(np.array(ends, dtype=float).reshape(len(records), len(design.asked), 3), -1, 0)


def _attributes(design: Design, found: Searched, made_by: Mapping[str, str]) -> dict[str, Any]:
    return {
        **made_by,
        attr.TITLE: design.title,
        attr.HISTORY: attr.history_line("optimise"),
        attr.SEED: design.search.seed,
        f.DESIGN: design.text,
        f.OUTCOME: f.FEASIBLE if len(found.front) else f.NONE_FEASIBLE,
        f.BOX: np.concatenate([found.reference, found.scale]),
        f.REFUSED: found.refused,
        f.PILOTS: found.pilots,
    }


def campaign_tables(design: Design, record: Record, threat: int) -> dict[str, Any]:
    """The tables of the campaign of a design and a threat, which `warpimpact run` takes."""
    one: Threat = design.threats[threat]
    tables = json.loads(json.dumps(record.tables, default=str))
    named = f", {one.name}" if len(design.threats) > 1 else ""
    told = design.space.text(record.values) if len(record.values) else ""
    tables["title"] = " ".join(f"{design.title}{named}: {told}"[:200].split()).rstrip(":")
    if one.core:
        tables["core"] = dict(one.core)
    tables["impact"] = tables.get("impact", {}) | one.impact
    tables.setdefault("hits", {"sampling": "sobol", "count": 4096, "seed": design.search.seed})
    return dict(tables)


def write_campaigns(design: Design, confirmed: Confirmed, names: Sequence[str], folder: Path) -> list[Path]:
    """A campaign file per design of the front, and per threat where there are several.

    Raises:
        OutputError: one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for record, name in zip(confirmed.records, names, strict=True):
        for number, threat in enumerate(design.threats):
            ending = "" if len(design.threats) == 1 else "_" + "".join(c if c.isalnum() else "_" for c in threat.name)
            path = folder / f"{Path(name).stem}{ending}.toml"
            tables = _relocated(campaign_tables(design, record, number), design.folder, folder)
            with aside(path) as file:
                file.write_text(toml_text(tables), encoding="utf-8")
            written.append(path)
    return written


def _relocated(part: Any, before: Path, now: Path, key: str = "") -> Any:
    """Tables whose file names count from another folder."""
    if isinstance(part, dict):
        return {name: _relocated(one, before, now, name) for name, one in part.items()}
    if isinstance(part, list):
        return [_relocated(one, before, now) for one in part]
    if key in ("file", "posterior", "catalogue") and isinstance(part, str) and not Path(part).is_absolute():
        return os.path.relpath(before / part, now)
    return part
