"""Catalogue: threats and materials by name, those of the package and those of a user's file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from warpimpact.catalogue.entries import Material, Threat
from warpimpact.catalogue.spelling import the_entry
from warpimpact.catalogue.strength import Resistance, resistance_of
from warpimpact.scene import Core
from warpimpact.scene.input_files import parsed, read_text
from warpimpact.scene.problems import complaint
from warpimpact.scene.units import quoted

Entry = TypeVar("Entry", Threat, Material)

HERE = Path(__file__).parent
FOLDERS: Mapping[type[Any], Path] = {Threat: HERE / "threats", Material: HERE / "materials"}
"""Folders of the entries of the package, one file each."""


@dataclass(frozen=True)
class Catalogue:
    """Entries by name. Entries of a user's file replace those of the package.

    Attributes:
        of_user: threats and materials of the user's file, by kind and name.
    """

    of_user: Mapping[type[Any], Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path | None) -> Catalogue:
        """The catalogue of the package with the tables `[[threat]]` and `[[material]]` of a TOML file.

        Raises:
            ValueError: the file cannot be read, or has an invalid entry.
        """
        if path is None:
            return cls()
        data = parsed(read_text(path), path.name)
        if foreign := [key for key in data if key not in ("threat", "material")]:
            raise ValueError(f"{path.name}: got the unknown key {quoted(foreign[0])}; allowed are threat, material")
        kinds: dict[type[Any], str] = {Threat: "threat", Material: "material"}
        return cls({kind: _entries(kind, data.get(key, []), f"{path.name}: {key}") for kind, key in kinds.items()})

    def resistance(self, material: Material, core: Core, thickness: float, obliquity: float) -> Resistance:
        """What is known of the resistance of a plate of this thickness [m] against a core at an obliquity [rad]."""
        diameter = 2.0 * core.max_radius
        if self.is_own(material):
            return material.resistance_at(thickness / diameter)
        return resistance_of(
            material.name, projectile=core.threat, diameter=diameter, thickness=thickness, obliquity=obliquity
        )

    def is_own(self, material: Material) -> bool:
        """Whether a material is an entry of the user's file; then its numbers are the whole evidence."""
        return material.name in self.of_user.get(Material, {})

    def entry(self, name: str) -> Threat | Material:
        """The threat or the material of this name or alias.

        Raises:
            ValueError: there is none, or an alias stands for several.
        """
        entries: dict[str, Threat | Material] = {**self.all(Material), **self.all(Threat)}
        return entries[the_entry(name, _spellings(entries))]

    def all(self, kind: type[Entry]) -> dict[str, Entry]:
        """All threats or all materials by name, those of the user first."""
        of_user: Mapping[str, Entry] = self.of_user.get(kind, {})
        packaged: list[Entry] = [_read(kind, path) for path in sorted(FOLDERS[kind].glob("*.toml"))]
        return {**of_user, **{entry.name: entry for entry in packaged if entry.name not in of_user}}

    def named(self, kind: type[Entry], name: str) -> Entry:
        """The entry of this name or alias; of a name of the package, only its file is read."""
        of_user: Mapping[str, Entry] = self.of_user.get(kind, {})
        if name in of_user:
            return of_user[name]
        path = FOLDERS[kind] / f"{file_name(name)}.toml"
        entry: Entry | None = _read(kind, path) if path.is_file() else None
        if entry is not None and entry.name == name:
            return entry
        entries = self.all(kind)
        return entries[the_entry(name, _spellings(entries))]


def _spellings(entries: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    return {name: entry.aliases for name, entry in entries.items()}


def file_name(name: str) -> str:
    """Name of the file of an entry, without its suffix."""
    return re.sub("[^a-z0-9]+", "_", name.lower()[:80]).rstrip("_")


@cache
def _read(kind: type[Any], path: Path) -> Any:
    """An entry of the package."""
    return kind.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))


def _entries(kind: type[Entry], tables: Any, place: str) -> dict[str, Entry]:
    if not isinstance(tables, list):
        raise ValueError(f"{place}: got {quoted(tables)}, but it must be a list: tables [[{place.split()[-1]}]]")
    entries: dict[str, Entry] = {}
    for number, table in enumerate(tables):
        try:
            entry = kind.model_validate(table)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"]))
            raise ValueError(f"{place}[{number}]{f'.{where}' if where else ''}: {complaint(first)}") from None
        if entry.name in entries:
            raise ValueError(f"{place}[{number}].name: got {quoted(entry.name)} again, but each entry needs its own")
        entries[entry.name] = entry
    return entries
