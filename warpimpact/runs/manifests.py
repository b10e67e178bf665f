"""Manifests: nested dictionaries of everything that determines the bits of a result, and how two of them differ."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def digest(path: Path) -> str:
    """The name and the contents of a file, for a manifest."""
    with path.open("rb") as file:
        return f"{path.name}, sha256 {hashlib.file_digest(file, 'sha256').hexdigest()}"


def fingerprint(content: Mapping[str, Any]) -> str:
    """Short hash of a manifest. Results with the same hash have the same bits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def difference(begun: Any, now: Any) -> str | None:
    """The first difference between two manifests as a phrase, None if there is none."""
    where = first_difference(begun, now)
    return where and "{} was {} and is {}".format(*where)


def first_difference(left: Any, right: Any, place: str = "") -> tuple[str, str, str] | None:
    """Place and both values of the first difference between two nested dictionaries; None if they are equal."""
    if _are_tables(left) and _are_tables(right) and len(left) == len(right):
        left, right = ({str(place): table for place, table in enumerate(tables)} for tables in (left, right))
    if isinstance(left, dict) and isinstance(right, dict):
        for name in sorted(left.keys() | right.keys()):
            inner = f"{place}.{name}".removeprefix("campaign.").strip(".")
            if inner_difference := first_difference(left.get(name), right.get(name), inner):
                return inner_difference
        return None
    return None if left == right else (place, _brief(left), _brief(right))


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(entry, dict) for entry in value)


def _brief(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}..."
