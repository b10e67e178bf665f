"""What stands behind the numbers of a campaign: names of the catalogue, the state of their evidence, and where the
campaign leaves what limit velocities have tested (docs/validation.md)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material, Threat
from ..results.attributes import NOT_TESTED
from ..scene import Core, Plate
from .catalogued import calibres_of
from .doubts import doubts_of

if TYPE_CHECKING:
    from .campaign import Campaign

_CLOSE = 1e-6
"""Relative difference of numbers that are the same."""


def evidence_of(campaign: Campaign) -> list[str]:
    """A line for every name and a sentence for every doubt; empty for a campaign of which nothing is to be said."""
    catalogue = Catalogue.of(campaign.catalogue)
    lines = [] if campaign.core.threat is None else [_of_threat(campaign.core, catalogue)]
    for place, plate in campaign.target.named:
        if plate.material is not None:
            lines.append(_of_material(campaign, place, plate, catalogue))
    return lines + [f"{NOT_TESTED}{doubt}" for doubt in dict.fromkeys(doubts_of(campaign, catalogue.all(Material)))]


def _of_threat(core: Core, catalogue: Catalogue) -> str:
    name = core.threat
    assert name is not None  # asked for
    threat = catalogue.all(Threat).get(name)
    if threat is None:
        return f"core: {name}, which is not in the catalogue"
    entry = threat.shape
    own = [] if entry is None else _differences(core, entry)
    return f"core: {name}{_own(own)} ({threat.evidence})"


def _differences(core: Core, entry: Core) -> list[str]:
    """Keys in which a core differs from that of its entry."""
    if type(core) is not type(entry):
        return ["shape"]
    labels = ("threat", "standard", "velocity_tolerance")
    names = (name for name in type(core).model_fields if name not in labels)
    return [name for name in names if not _same(getattr(core, name), getattr(entry, name))]


def _of_material(campaign: Campaign, place: str, plate: Plate, catalogue: Catalogue) -> str:
    material = catalogue.all(Material).get(str(plate.material))
    if material is None:
        return f"{place}: {plate.material}, which is not in the catalogue"
    resistance = material.resistance_at(calibres_of(campaign.core, plate))
    expected = {
        "resistance": (plate.resistance, resistance),
        "shear_coefficient": (plate.shear_coefficient, material.shear_coefficient),
        "density": (plate.density, material.density),
        **{name: (getattr(campaign.interaction, name), getattr(material, name)) for name in ("linear", "quadratic")},
        "onset": (campaign.interaction.onset, material.onset),
    }
    own = [name for name, pair in expected.items() if not _same(*pair)]
    return f"{place}: {material.name}{_own(own)}, Y {plate.resistance / 1e9:.3g} GPa ({material.evidence})"


def _own(names: list[str]) -> str:
    return f" with another {', '.join(names).replace('_', ' ')}" if names else ""


def _same(one: object, other: object) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=_CLOSE)
    return one == other
