"""Catalogue: threats, materials and flows by name, those of the package and those of a user's file.

Case, spaces and hyphens of a name do not count, and entries have aliases.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import Field, ValidationError

from warpimpact.catalogue.entries import Material, Name, Threat, evidence
from warpimpact.catalogue.strength import Resistance, resistance_of
from warpimpact.scene import Core
from warpimpact.scene.flow import Flow
from warpimpact.scene.input_files import parsed, read_text
from warpimpact.scene.model import sentence
from warpimpact.scene.units import MOST_QUOTED, NonNegativeNumber, PositiveNumber, Title, list_text, quoted

Entry = TypeVar("Entry", Threat, Material)

DATA_FOLDER = Path(__file__).parent
FOLDERS: Mapping[type[Any], Path] = {Threat: DATA_FOLDER / "threats", Material: DATA_FOLDER / "materials"}
"""Folders of the entries of the package, one file each."""
FLOWS = DATA_FOLDER / "flows"


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
        kinds: dict[str, type[Any]] = {"threat": Threat, "material": Material}
        if foreign := data.keys() - kinds.keys():
            raise ValueError(f"{path.name}: got the unknown key {quoted(min(foreign))}; allowed are threat, material")
        return cls({kind: _entries(kind, data.get(key, []), f"{path.name}: {key}") for key, kind in kinds.items()})

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
        return entries[find_entry(name, entries)]

    def all(self, kind: type[Entry]) -> dict[str, Entry]:
        """All threats or all materials by name, those of the user first."""
        of_user: Mapping[str, Entry] = self.of_user.get(kind, {})
        packaged: list[Entry] = [_read(kind, path) for path in sorted(FOLDERS[kind].glob("*.toml"))]
        return {**of_user, **{entry.name: entry for entry in packaged if entry.name not in of_user}}

    def named(self, kind: type[Entry], name: str) -> Entry:
        """The entry of this name or alias."""
        entries = self.all(kind)
        return entries[find_entry(name, entries)]


@cache
def _read(kind: type[Any], path: Path) -> Any:
    """An entry of the package."""
    return kind.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))


def _entries(kind: type[Entry], tables: Any, place: str) -> dict[str, Entry]:
    if not isinstance(tables, list):
        raise ValueError(f"{place}: got {quoted(tables)}, but it must be a list: tables [[{place.split()[-1]}]]")
    entries: dict[str, Entry] = {}
    for number, table in enumerate(tables):
        entry: Entry = _valid(kind, table, f"{place}[{number}]")
        if entry.name in entries:
            raise ValueError(f"{place}[{number}].name: got {quoted(entry.name)} again, but each entry needs its own")
        entries[entry.name] = entry
    return entries


class FlowEntry(Flow):
    """A material of the continuum.

    Attributes:
        name, aliases: by which `--material` and the layers of a campaign find it.
        friction: between core and target, with which the constants are to be used.
        strength_factor, strength_error: what its strength was multiplied by to meet published limit velocities with
            rigid cores, and the relative standard error of that for another plate; None where no limit was met.
        whole_factor, whole_error: the same with whole bullets whose cores deform; None where that is not known.
        limits: factor that a published limit asks for, and its velocity by the factor of the others, by the plate.
        known, assumed: source, or assumption, by property.
        tested: what the continuum gives for a plate test that somebody published, and what was measured, by the plate.
    """

    name: Name
    aliases: tuple[Name, ...] = ()
    friction: NonNegativeNumber = 0.0
    strength_factor: NonNegativeNumber = 1.0
    strength_error: NonNegativeNumber | None = None
    whole_factor: PositiveNumber | None = None
    whole_error: NonNegativeNumber | None = None
    known: dict[str, Title] = Field(default_factory=dict)
    assumed: dict[str, Title] = Field(default_factory=dict)
    limits: dict[str, Title] = Field(default_factory=dict)
    tested: dict[str, Title] = Field(default_factory=dict)

    @property
    def flow(self) -> Flow:
        """Its constants."""
        return Flow(**{name: getattr(self, name) for name in Flow.model_fields})

    @property
    def of_whole_bullets(self) -> FlowEntry:
        """The entry as whole bullets whose cores deform ask for it, with their strength factor and its error."""
        if self.whole_factor is None:
            return self
        strengths = self.flow.scaled(self.whole_factor / self.strength_factor).model_dump()
        factors = {"strength_factor": self.whole_factor, "strength_error": self.whole_error}
        return self.model_copy(update=strengths | factors)

    @property
    def evidence(self) -> str:
        """State of the evidence in words."""
        return "; ".join([evidence(self.known, self.assumed), *(f"{plate}: {of}" for plate, of in self.tested.items())])


def flow_entry(name: str) -> FlowEntry:
    """The material of a name, or of a TOML file.

    Raises:
        ValueError: there is no such entry, or the file has an invalid value.
    """
    if name.endswith(".toml"):
        entry: FlowEntry = _valid(FlowEntry, parsed(read_text(Path(name)), name), name)
        return entry
    entries, materials = flow_entries(), Catalogue().all(Material)
    try:
        canonical = find_entry(name, {**materials, **entries})
    except ValueError as error:
        raise ValueError(f"{error} (or a TOML file)") from None
    if canonical not in entries:
        raise ValueError(
            f"got {quoted(name)}, of which the catalogue has the resistance, but no continuum constants: its published "
            f"limits ({1e3 * materials[canonical].thickness_low:.3g} mm and more) were not computed by elements; give "
            "a TOML file with your own constants"
        )
    return entries[canonical]


def flow_entries() -> dict[str, FlowEntry]:
    """Materials of the continuum in the package, by name."""
    return {entry.name: entry for entry in (_read(FlowEntry, path) for path in sorted(FLOWS.glob("*.toml")))}


def _valid(kind: type[Any], table: Any, place: str) -> Any:
    """An entry of a user's file.

    Raises:
        ValueError: names what is wrong.
    """
    try:
        return kind.model_validate(table)
    except ValidationError as error:
        raise ValueError(f"{place}: {sentence(error, table)}") from None


_EQUAL_LETTERS = 0.75
"""Smallest share of equal letters of a slip of the keyboard."""
_FEW = 12
"""Most entries that a message lists."""
_CALIBRE = r"\.?\d+(?:\.\d+)?(?:mm)?"
_ALUMINIUM = r"^(?:enaw|aa|aluminium|aluminum|al)(?=\d{4})"


def key(name: str) -> str:
    """What all spellings of a name have in common.

    Case, spaces, hyphens and slashes do not count. "7.62 mm" is "7.62", but "30 mm" is not ".30". Aluminium alloys need
    no prefix: "6061-T6", "AA6061-T6" and "EN AW-6061 T6" are one name.
    """
    compact = re.sub(r"[^a-z0-9.×]", "", name[:MOST_QUOTED].casefold()).replace("×", "x")
    decimal = re.sub(r"(\d\.\d+)mm", r"\1", compact)
    return re.sub(_ALUMINIUM, "", re.sub(r"\.(?!\d)", "", decimal))


def find_entry(name: str, entries: Mapping[str, Threat | Material | FlowEntry]) -> str:
    """Name of the entry that a name or an alias stands for.

    Raises:
        ValueError: there is none, or an alias stands for several; the message lists whom it may mean.
    """
    spellings = {entry: one.aliases for entry, one in entries.items()}
    if named := [entry for entry in spellings if key(entry) == key(name)]:
        return named[0]
    called = [entry for entry, aliases in spellings.items() if key(name) in map(key, aliases)]
    if len(called) == 1:
        return called[0]
    close = (entry for entry, aliases in spellings.items() if any(_close(name, word) for word in (entry, *aliases)))
    meant = list_text([quoted(entry) for entry in called or close], "or")
    if called:
        raise ValueError(f"got {quoted(name)}, which several entries of the catalogue are: {meant}; name one")
    few = f"allowed are {', '.join(spellings)}" if len(spellings) <= _FEW else "warpimpact catalogue lists all"
    hint = f"did you mean {meant}?" if meant else few
    raise ValueError(f"got {quoted(name)}, which is not in the catalogue; {hint}")


def _close(name: str, spelling: str) -> bool:
    """Whether a name is part of a spelling or a slip of it.

    Numbers tell calibres and alloys apart: those of a part must be in the spelling, those of a slip are the same."""
    given, known = key(name), key(spelling)
    numbers, others = _numbers(given), _numbers(known)
    if len(given) > 1 and given in known and numbers <= others:
        return True
    letters, other_letters = (re.sub(_CALIBRE, "", word) for word in (given, known))
    return numbers == others and SequenceMatcher(None, letters, other_letters).ratio() >= _EQUAL_LETTERS


def _numbers(word: str) -> set[str]:
    return {number.removeprefix(".") for number in re.findall(_CALIBRE, word)}
