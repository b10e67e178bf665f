"""The catalogue in Python: threats and materials by name, and plates of a material."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeVar

from warpimpact.catalogue.catalogue import Catalogue, Entry
from warpimpact.catalogue.entries import OBLIQUITY, Material, Threat
from warpimpact.scene import Core, Layer, Plate

AnyPlate = TypeVar("AnyPlate", bound=Plate)


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


def plate(material: str, threat: str | Threat | Core, obliquity: float | str, **keys: Any) -> Plate:
    """A plate of a material of the catalogue.

    Its resistance is that of its thickness against the threat at the obliquity. Friction and density are those of the
    material. A copy with another thickness keeps its resistance.

    Args:
        material: name or alias.
        threat: name or alias, a threat, or its core.
        obliquity: of the shot: a number of degrees, or a string with a unit.
        keys: fields of `Plate`, or `areal_density` in the place of `thickness`.

    Raises:
        ValueError: a name is not known, a field is not valid, or the resistance is given, too.
    """
    return _of_material(Plate, material, threat, obliquity, keys)


def layer(material: str, threat: str | Threat | Core, obliquity: float | str, **keys: Any) -> Layer:
    """A layer of a material of the catalogue; as `plate`."""
    return _of_material(Layer, material, threat, obliquity, keys)


def _of_material(
    model: type[AnyPlate], name: str, hit_by: str | Threat | Core, obliquity: float | str, keys: dict[str, Any]
) -> AnyPlate:
    if "resistance" in keys:
        raise ValueError("resistance: the material gives it; leave it out, or make a Plate with it")
    of_material = material(name)
    known = threat(hit_by) if isinstance(hit_by, str) else hit_by
    core = known.core if isinstance(known, Threat) else known
    thickness = model.model_validate(of_material.table(keys, resistance=1.0)).thickness
    resistance = Catalogue().resistance(of_material, core, thickness, OBLIQUITY.validate_python(obliquity))
    return model.model_validate(of_material.table(keys, resistance.median))
