"""The catalogue in Python: threats and materials by name, and plates of a material.

Importing it gives `Plate` the catalogue of the package: `Plate(material="HHA Class 1", ...)`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic

from warpimpact.catalogue.catalogue import Catalogue, Entry
from warpimpact.catalogue.entries import OBLIQUITY, Material, Threat
from warpimpact.scene import Core, Layer, Plate

__all__ = ["Layer", "Plate", "material", "threat"]


class Entries(Mapping[str, Entry], Generic[Entry]):
    """Entries of the catalogue of the package by name or alias: `threat(".30 AP M2")`.

    `list(threat)` lists the names, showing it lists them with their evidence, and a notebook completes `threat["`.
    """

    def __init__(self, kind: type[Entry]) -> None:
        self.kind: type[Entry] = kind

    def __call__(self, name: str) -> Entry:
        """The entry of this name or alias, in any case.

        Raises:
            ValueError: there is none, or an alias stands for several; the message lists whom it may mean.
        """
        return Catalogue().named(self.kind, name)

    def __getitem__(self, name: str) -> Entry:
        try:
            return self(name)
        except ValueError as error:
            raise KeyError(str(error)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(Catalogue().all(self.kind))

    def __len__(self) -> int:
        return len(Catalogue().all(self.kind))

    def __repr__(self) -> str:
        """A line per entry, with the state of its evidence."""
        return "\n".join(f"{name}: {entry.evidence}" for name, entry in self.items())

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)


threat = Entries(Threat)
material = Entries(Material)


def _filled(model: type[Plate], given: dict[str, Any]) -> dict[str, Any]:
    """The keys of a plate with the numbers of its material against a threat.

    Raises:
        ValueError: threat or obliquity is missing or unknown.
    """
    steel = material(given["material"])
    keys = {key: value for key, value in given.items() if key not in ("threat", "obliquity")}
    if "resistance" in keys:
        raise ValueError(
            "got resistance with threat or obliquity, which only choose a resistance; give one or the other"
        )
    if missing := [key for key in ("threat", "obliquity") if given.get(key) is None]:
        raise ValueError(
            f"{' and '.join(missing)} must be given: the resistance of {steel.name} depends on threat, thickness and "
            'angle; give threat = ".30 AP M2" or a core, and obliquity, or else resistance'
        )
    hit_by, obliquity = given["threat"], OBLIQUITY.validate_python(given["obliquity"])
    core = hit_by if isinstance(hit_by, Core) else (hit_by if isinstance(hit_by, Threat) else threat(str(hit_by))).core
    thickness = model.model_validate(steel.table(keys, resistance=1.0)).thickness
    return steel.table(keys, Catalogue().resistance(steel, core, thickness, obliquity).median)


Plate.of_material = staticmethod(_filled)
