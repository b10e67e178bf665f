"""Dotted places of a campaign, such as "plate.pattern.width" or "layer 1.gap", and the files that its tables name.

Layer 0 is the plate, and layer 1 the first table [[layer]].
"""

import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from warpimpact.errors import CampaignError

from ..scene import Impact, Interaction, Plate
from ..scene.units import PositiveArealDensity, quoted, typed
from .campaign import Campaign

_TABLES: Mapping[str, Any] = {"impact": Impact, "plate": Plate, "interaction": Interaction}
"""Tables whose keys may be given without the table, because their names are unique."""
_WHOLE = re.compile(r"core|interaction|(plate|layer \d+)(\.pattern)?")
"""Tables that may be given as a whole."""
_LAYER = re.compile(r"layer (\d{1,3})")


def is_table(place: str) -> bool:
    """Whether a whole table stands at a place."""
    return _WHOLE.fullmatch(place) is not None


def resolved(key: str, name: str) -> str:
    """The dotted place of a key, which may be that of an input of [impact], [plate] or [interaction] alone. Errors have
    the name of the table of keys, such as "sweep.toml: sweep".

    Raises:
        CampaignError: there is no such key.
    """
    if key.startswith("layer."):
        raise CampaignError(f'{name}: got {quoted(key)}; write "layer 1" for the first table [[layer]]')
    if "." in key or is_table(key):
        return re.sub(r"^layer 0\b", "plate", key)
    for table, model in _TABLES.items():
        if key in model._keys():
            return f"{table}.{key}"
    known = ", ".join(name for model in _TABLES.values() for name in model._keys())
    raise CampaignError(
        f"{name}: got the unknown input {quoted(key)}; give one of core, plate, {known}, or a dotted place such as "
        '"core.mass" or "plate.pattern"'
    )


def options_of(values: list[Any], where: str, *, whole: bool) -> dict[str, Any]:
    """The values of an input by their labels: as written, or the names of tables, which are then without them.

    Args:
        where: place of the list in errors.
        whole: whether they are tables, each with a name.

    Raises:
        CampaignError: a table has no name, or a label is not one line or is given twice.
    """
    if whole and not all(isinstance(value, dict) and isinstance(value.get("name"), str) for value in values):
        raise CampaignError(f"{where}: must be a list of tables, each with a name")
    texts = [value["name"] if whole else value for value in values]
    labels = tuple(text if isinstance(text, str) else json.dumps(text, default=str) for text in texts)
    if len(set(labels)) < len(labels) or not all(map(str.isprintable, labels)):
        raise CampaignError(f"{where}: got {quoted(labels)}, but each must differ, and be one line of printed text")
    if whole:
        values = [{key: part for key, part in value.items() if key != "name"} for value in values]
    return dict(zip(labels, values, strict=True))


def set_value(data: dict[str, Any], key: str, value: Any, name: str) -> None:
    """Put a value at its place in the tables of a campaign.

    Raises:
        CampaignError: the tables have no such place; `name` is as in `resolved`.
    """
    *tables, last = _parts(key)
    inside: Any = data
    for part in tables:
        if isinstance(inside, dict) and part != "layer":
            inside = inside.setdefault(part, {})
        else:
            inside = dict(enumerate(inside) if isinstance(inside, list) else inside).get(part)
        if not isinstance(inside, dict | list):
            missing = "[[layer]]" if part == "layer" else "table at this place"
            raise CampaignError(f"{name}: got {quoted(key)}, but the campaign has no {missing}")
    if isinstance(inside, list) and last not in range(len(inside)):
        raise CampaignError(f"{name}: got {quoted(key)}, but the length of that list is {len(inside)}")
    inside[last] = value


def _parts(key: str) -> list[Any]:
    """The parts of a dotted place. A number is the index of an entry in a list."""
    first, *rest = key.split(".")
    layer = _LAYER.fullmatch(first)
    parts = ["layer", int(layer[1]) - 1] if layer else [first]
    return [*parts, *(int(part) if part.isdecimal() else part for part in rest)]


def with_files(tables: Any, change: Callable[[str], str], key: str = "") -> Any:
    """Tables of a campaign, a design file or a fit file with the names of files in them changed."""
    if isinstance(tables, Mapping):
        return {name: with_files(value, change, name) for name, value in tables.items()}
    if isinstance(tables, list):
        return [with_files(value, change) for value in tables]
    return change(tables) if key in ("file", "catalogue") and isinstance(tables, str) else tables


def files_in(tables: Any) -> list[str]:
    """Names of the files that tables refer to."""
    names: dict[str, str] = {}
    with_files(tables, lambda name: names.setdefault(name, name))
    return [*names]


def relocated(tables: Any, before: Path, now: Path) -> Any:
    """Tables whose file names count from the folder `now` instead of `before`."""
    return with_files(tables, lambda name: name if Path(name).is_absolute() else os.path.relpath(before / name, now))


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
