"""Catalogue: threats and materials by name, those of the package and those of a user's file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from pydantic import ValidationError

from warpimpact.catalogue.entries import Material, Threat, reason
from warpimpact.catalogue.strength import Resistance, resistance_of
from warpimpact.scene import Core
from warpimpact.scene.toml_text import parsed, read_text
from warpimpact.scene.units import quoted

Entry = TypeVar("Entry", Threat, Material)

HERE = Path(__file__).parent
FOLDERS: Mapping[type[Any], Path] = {Threat: HERE / "threats", Material: HERE / "materials"}
"""A file of each entry of the package."""


@dataclass(frozen=True)
class Catalogue:
    """Entries by name. Those of a user's file come before those of the package.

    Attributes:
        own: a user's threats and materials.
    """

    own: Mapping[type[Any], Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path | None) -> Catalogue:
        """The package's, with the entries of a TOML file of tables `[[threat]]` and `[[material]]`.

        Raises:
            ValueError: the file cannot be read, or has an entry that is not valid.
        """
        if path is None:
            return cls()
        data = parsed(read_text(path), path.name)
        if foreign := [key for key in data if key not in ("threat", "material")]:
            raise ValueError(f"{path.name}: got the unknown key {quoted(foreign[0])}; allowed are threat, material")
        kinds: dict[type[Any], str] = {Threat: "threat", Material: "material"}
        return cls({kind: _entries(kind, data.get(key, []), f"{path.name}: {key}") for kind, key in kinds.items()})

    def threat(self, name: str) -> Threat:
        """A threat.

        Raises:
            ValueError: there is none of that name.
        """
        return self._found(Threat, name)

    def material(self, name: str) -> Material:
        """A material.

        Raises:
            ValueError: there is none of that name.
        """
        return self._found(Material, name)

    def resistance(self, material: Material, core: Core, thickness: float, obliquity: float) -> Resistance:
        """What is known of the resistance of a plate of a material against a core.

        Args:
            thickness, obliquity: of the plate [m], and of the shot [rad].
        """
        diameter = 2.0 * core.max_radius
        if self.is_own(material):
            return material.resistance_at(thickness / diameter)
        return resistance_of(
            material.name, projectile=core.threat, diameter=diameter, thickness=thickness, obliquity=obliquity
        )

    def is_own(self, material: Material) -> bool:
        """Whether a material is of the user's file, so that its own numbers are all that is known."""
        return material.name in self.own.get(Material, {})

    def entry(self, name: str) -> Threat | Material:
        """A threat or a material.

        Raises:
            ValueError: there is none of that name.
        """
        threats, materials = self.all(Threat), self.all(Material)
        if name in threats:
            return threats[name]
        return materials[name] if name in materials else self._refuse(name, [*threats, *materials])

    def all(self, kind: type[Entry]) -> dict[str, Entry]:
        """All threats or all materials by name, the user's own first."""
        packaged = [_packaged(kind, path) for path in sorted(FOLDERS[kind].glob("*.toml"))]
        own: Mapping[str, Entry] = self.own.get(kind, {})
        return {**own, **{one.name: one for one in packaged if one.name not in own}}

    def _found(self, kind: type[Entry], name: str) -> Entry:
        own: Mapping[str, Entry] = self.own.get(kind, {})
        if name in own:
            return own[name]
        path = FOLDERS[kind] / f"{file_name(name)}.toml"
        if path.is_file() and (entry := _packaged(kind, path)).name == name:
            return entry
        return self._refuse(name, list(self.all(kind)))

    @staticmethod
    def _refuse(name: str, known: list[str]) -> NoReturn:
        meant = get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f'did you mean "{meant[0]}"?' if meant else f"allowed are {', '.join(known)}"
        raise ValueError(f"got {quoted(name)}, which is not in the catalogue; {hint}")


def file_name(name: str) -> str:
    """Name of the file of an entry, without its suffix."""
    return re.sub("[^a-z0-9]+", "_", name.lower()[:80]).rstrip("_")


def _packaged(kind: type[Entry], path: Path) -> Entry:
    entry: Entry = _read(kind, path)
    return entry


@cache
def _read(kind: type[Any], path: Path) -> Any:
    return kind.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))


def _entries(kind: type[Entry], tables: Any, place: str) -> dict[str, Entry]:
    if not isinstance(tables, list):
        raise ValueError(f"{place}: got {quoted(tables)}, but it must be a list: tables [[{place.split()[-1]}]]")
    found: dict[str, Entry] = {}
    for number, table in enumerate(tables):
        try:
            entry = kind.model_validate(table)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"]))
            raise ValueError(f"{place}[{number}]{f'.{where}' if where else ''}: {reason(first)}") from None
        if entry.name in found:
            raise ValueError(f"{place}[{number}].name: got {quoted(entry.name)} again, but each entry needs its own")
        found[entry.name] = entry
    return found
