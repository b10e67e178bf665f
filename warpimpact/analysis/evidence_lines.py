"""The lines on what results rest on, as commands print them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from warpimpact.results import attributes as attr

if TYPE_CHECKING:
    from warpimpact.results.table import Result


def evidence_lines(dataset: Result, *, file: str | None = None) -> list[str]:
    """A line on what a result rests on, with names and the state of their evidence. What was not measured is only
    counted; `inspect` of the file of the result says more."""
    lines = str(dataset.attrs.get(attr.EVIDENCE, "")).splitlines()
    shown = [line for line in lines if not line.startswith(attr.NOT_TESTED)]
    if len(shown) < len(lines) and file is not None:
        shown[0] += f" (warpimpact inspect {file} says by how much)"
    return shown


def evidence_of_all(datasets: Mapping[str, Result]) -> list[str]:
    """What results rest on, by name: one line for all results that rest on the same."""
    names: dict[str, list[str]] = {}
    for name, dataset in datasets.items():
        for line in evidence_lines(dataset)[:1]:
            names.setdefault(line, []).append(name)
    return list(names) if len(names) == 1 else [f"{', '.join(those)}: {line}" for line, those in names.items()]
