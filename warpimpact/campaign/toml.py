"""The tables of a campaign as TOML, which the standard library reads but does not write."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """Tables of strings, numbers, truth values, lists and tables as TOML. Values that are None are left out."""
    return "\n".join(_lines(tables, ())).strip() + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Lines of a table: first its values, then the tables below it, as TOML needs them."""
    lines, below = [], []
    for key, value in table.items():
        if isinstance(value, Mapping) and (not path or len(value) > 3):
            below += ["", f"[{_dotted((*path, key))}]", *_lines(value, (*path, key))]
        elif (
            isinstance(value, list | tuple)
            and value
            and all(isinstance(entry, Mapping) for entry in value)
            and not path
        ):
            for entry in value:
                below += ["", f"[[{_dotted((*path, key))}]]", *_lines(entry, (*path, key))]
        elif value is not None:
            lines.append(f"{_key(key)} = {_value(value)}")
    return lines + below


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {_value(inner)}" for key, inner in value.items() if inner is not None)
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def _dotted(path: tuple[str, ...]) -> str:
    return ".".join(map(_key, path))
