"""Materials of the continuum by name, a file each in flows/, or of a user's file."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from warpimpact.catalogue.entries import Name, evidence
from warpimpact.catalogue.spelling import the_entry
from warpimpact.scene.flow import Flow
from warpimpact.scene.input_files import parsed, read_text
from warpimpact.scene.problems import complaint
from warpimpact.scene.units import Title

FLOWS = Path(__file__).parent / "flows"


class FlowEntry(Flow):
    """A material of the continuum.

    Attributes:
        name: by which `--material` finds it.
        known, assumed: source, or assumption, by property.
        tested: what the continuum gives for a plate test that somebody published, and what was measured, by the plate.
    """

    name: Name
    known: dict[str, Title] = Field(default_factory=dict)
    assumed: dict[str, Title] = Field(default_factory=dict)
    tested: dict[str, Title] = Field(default_factory=dict)

    @property
    def flow(self) -> Flow:
        """Its constants."""
        return Flow(**{name: getattr(self, name) for name in Flow.model_fields})

    @property
    def evidence(self) -> str:
        """State of the evidence in words."""
        tests = "; ".join(f"{plate}: {words}" for plate, words in self.tested.items())
        return evidence(self.known, self.assumed) + (f"; beside a plate test: {tests}" if tests else "")


def flow_entry(name: str) -> FlowEntry:
    """The material of a name, or of a TOML file.

    Raises:
        ValueError: there is no such entry, or the file has an invalid value.
    """
    if name.endswith(".toml"):
        return _entry(parsed(read_text(Path(name)), name), name)
    entries = _packaged()
    try:
        return entries[the_entry(name, dict.fromkeys(entries, ()))]
    except ValueError as error:
        raise ValueError(f"{error} (or a TOML file)") from None


@cache
def _packaged() -> dict[str, FlowEntry]:
    tables = {path: tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted(FLOWS.glob("*.toml"))}
    return {table["name"]: FlowEntry.model_validate(table) for table in tables.values()}


def flow_names() -> tuple[str, ...]:
    """Names of the materials of the package."""
    return tuple(_packaged())


def _entry(table: dict[str, Any], place: str) -> FlowEntry:
    try:
        return FlowEntry.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place}{f': {where}' if where else ''}: {complaint(first)}") from None
