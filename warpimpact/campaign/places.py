"""Dotted places of a campaign, such as "plate.pattern.width" or "layer 1.gap", resolved, filled and read; and the files
that its tables name. Layer 0 is the plate, and layer 1 the first table [[layer]]."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..scene import Impact, Interaction, Plate
from ..scene.units import PositiveArealDensity, quoted, typed
from .campaign import Campaign
from .text import CampaignError

_TABLES: Mapping[str, Any] = {"impact": Impact, "plate": Plate, "interaction": Interaction}
"""Tables whose keys may be given without the table, because their names are unique."""
_WHOLE = ("core", "plate", "plate.pattern", "interaction")
"""Tables that may be given as a whole, beside those of layers."""
_LAYER = re.compile(r"layer \d+(\.pattern)?")
"""Tables that may be given as a whole."""
_LAYER = re.compile(r"layer (\d{1,3})")
_NAMES_A_FILE = ("file", "catalogue")


def is_table(place: str) -> bool:
    """Whether a whole table stands at a place."""
    return place in _WHOLE or re.fullmatch(r"layer \d+(\.pattern)?", place) is not None


def resolved(key: str, name: str) -> str:
    """The dotted place of a key, which may be that of an input of [impact], [plate] or [interaction] alone. Errors have
    the name of the table of keys, such as "sweep.toml: sweep".

    Raises:
        CampaignError: there is no such key.
    """
    if key.startswith("layer."):
        raise CampaignError(f'{name}: got {quoted(key)}; write "layer 1" for the first table [[layer]]')
    if re.match(r"layer 0(\.|$)", key):
        return f"plate{key.removeprefix('layer 0')}"
    if "." in key or is_table(key):
        return key
    for table, model in _TABLES.items():
        if key in model._keys():
            return f"{table}.{key}"
    known = ", ".join(name for model in _TABLES.values() for name in model._keys())
    raise CampaignError(
        f"{name}: got the unknown input {quoted(key)}; give one of {', '.join(_WHOLE)}, {known}, or a dotted "
        'place such as "core.mass"'
    )


def labels_of(options: list[Any], where: str, *, whole: bool) -> tuple[str, ...]:
    """Labels of the values of an input as written, or the names of tables.

    Args:
        where: place of the list in errors.
        whole: whether they are tables, each with a name.

    Raises:
        CampaignError: a table has no name, or a label is not one line or is given twice.
    """
    if whole and not all(isinstance(option, dict) and isinstance(option.get("name"), str) for option in options):
        raise CampaignError(f"{where}: must be a list of tables, each with a name")
    texts = [option["name"] if whole else option for option in options]
    labels = tuple(text if isinstance(text, str) else json.dumps(text, default=str) for text in texts)
    if wrong := next((label for label in labels if not label.isprintable()), None):
        raise CampaignError(f"{where}: got {quoted(wrong)}, but it must be one line without control characters")
    if len(set(labels)) < len(labels):
        raise CampaignError(f"{where}: got a value twice, but each must differ")
    return labels


def put(data: dict[str, Any], key: str, value: Any, name: str) -> None:
    """Put a value at its place in the tables of a campaign.

    Raises:
        CampaignError: the tables have no such place; `name` is as in `resolved`.
    """
    *tables, last = _parts(key)
    if tables[:1] == ["layer"] and "layer" not in data:
        raise CampaignError(f"{name}: got {quoted(key)}, but the campaign has no [[layer]]")
    inside: Any = data
    for part in tables:
        entries: dict[Any, Any] = dict(enumerate(inside)) if isinstance(inside, list) else inside
        inside = entries.setdefault(part, {} if entries is inside else None)
        if not isinstance(inside, dict | list):
            raise CampaignError(f"{name}: {key} leads through {part}, which is no table")
    if isinstance(inside, list) and last not in range(len(inside)):
        raise CampaignError(f"{name}: {key} leads to {last}, but its list has {len(inside)} entries")
    inside[last] = value


def _parts(key: str) -> list[str | int]:
    """The parts of a dotted place. A number is the index of an entry in a list."""
    first, *rest = key.split(".")
    layer = _LAYER.fullmatch(first)
    parts = ["layer", int(layer[1]) - 1] if layer else [first]
    return [*parts, *(int(part) if part.isdecimal() else part for part in rest)]


def files_in(tables: Any, key: str = "") -> Iterator[str]:
    """Names of the files that the tables of a campaign, a design file or a fit file refer to."""
    if isinstance(tables, Mapping):
        for name, value in tables.items():
            yield from files_in(value, name)
    elif isinstance(tables, list):
        for value in tables:
            yield from files_in(value)
    elif key in _NAMES_A_FILE and isinstance(tables, str):
        yield tables


def relocated(tables: Any, before: Path, now: Path, key: str = "") -> Any:
    """Tables whose file names count from the folder `now` instead of `before`."""
    if isinstance(tables, Mapping):
        return {name: relocated(value, before, now, name) for name, value in tables.items()}
    if isinstance(tables, list):
        return [relocated(value, before, now) for value in tables]
    if key in _NAMES_A_FILE and isinstance(tables, str) and not Path(tables).is_absolute():
        return os.path.relpath(before / tables, now)
    return tables


def type_at(key: str, campaign: Campaign) -> Any:
    """The type of an input, with its annotations; None where it is in no model."""
    table, _, last = key.rpartition(".")
    if last == "areal_density":  # a plate reads it and has it, but not as a field
        return PositiveArealDensity
    field = getattr(type(value_at(table, campaign)), "model_fields", {}).get(last)
    return None if field is None else typed(field)


def value_at(key: str, campaign: Campaign) -> Any:
    """The value at a place of a campaign; None if there is none."""
    value: Any = campaign
    for part in _parts(key) if key else ():
        value = value[part] if isinstance(part, int) and isinstance(value, tuple) else getattr(value, str(part), None)
    return value
