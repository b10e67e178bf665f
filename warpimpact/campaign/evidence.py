"""What the numbers of a campaign rest on: names of the catalogue with the state of their evidence, and where the
campaign leaves the tested limit velocities (docs/validation.md)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material, Threat
from ..catalogue.strength import NINETY
from ..results.attributes import NOT_TESTED
from ..scene import Core, Plate
from .catalogued import resistance_under
from .resistances import catalogue_resistance
from .tested import standings_of, summary_of

if TYPE_CHECKING:
    from .campaign import Campaign

_EQUAL = 1e-6
"""Largest relative difference of numbers that count as equal."""


def evidence_of(campaign: Campaign) -> list[str]:
    """Lines on what an answer rests on: a summary, a line for every name, and a sentence for each assumption."""
    catalogue = Catalogue.of(campaign.catalogue)
    standings = standings_of(campaign)
    lines = [summary_of(campaign, standings)]
    lines += [] if campaign.core.threat is None else [_of_threat(campaign.core, catalogue)]
    for place, plate in campaign.target.named:
        if plate.material is not None:
            lines.append(_of_material(campaign, place, plate, catalogue))
    return [*lines, *(f"{NOT_TESTED}{standing.sentence}" for standing in standings)]


def limit_velocity_factors(campaign: Campaign) -> tuple[float, float] | None:
    """Ends of the 90 % interval of a limit velocity, over the velocity, from the uncertainty of the resistance in the
    published rows, and from the scatter of a test.

    The limit velocity must go with the root of Y: a solid plate of a material that does not weaken, and whose
    resistance does not depend on the velocity. None for other campaigns.
    """
    plate, law = campaign.plate, campaign.interaction
    alone = not campaign.layer and plate == plate.solid and plate.degradation == 1.0
    if not alone or law.linear or law.quadratic or law.free_surface:
        return None
    known = catalogue_resistance(campaign, plate)
    if known is None or not known.deviation:
        return None
    factor = math.exp(0.5 * NINETY * math.hypot(known.deviation, known.test))
    return 1.0 / factor, factor


def _of_threat(core: Core, catalogue: Catalogue) -> str:
    name = core.threat
    assert name is not None  # asked for
    threat = catalogue.all(Threat).get(name)
    if threat is None:
        return f"core: {name}, which is not in the catalogue"
    entry = threat.shape
    differences = [] if entry is None else _differences(core, entry)
    return f"core: {name}{_own(differences)} ({threat.evidence})"


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
    obliquity = campaign.impact.obliquity
    known = resistance_under(campaign.interaction, material, campaign.core, plate, obliquity, catalogue)
    expected = {
        "resistance": (plate.resistance, known.median),
        "shear_coefficient": (plate.shear_coefficient, material.shear_coefficient),
        "density": (plate.density, material.density),
        **{name: (getattr(campaign.interaction, name), getattr(material, name)) for name in ("linear", "quadratic")},
        "onset": (campaign.interaction.onset, material.onset),
        "free_surface": (campaign.interaction.free_surface, None),
    }
    differing = [name for name, pair in expected.items() if not _same(*pair)]
    low, high = (end / 1e9 for end in known.ends)
    is_known = known.deviation and "resistance" not in differing
    interval = f", {low:.3g} to {high:.3g} with 90 %" if is_known else ""
    return (
        f"{place}: {material.name}{_own(differing)}, Y {plate.resistance / 1e9:.3g} GPa{interval} ({material.evidence})"
    )


def _own(names: list[str]) -> str:
    return f" with another {', '.join(names).replace('_', ' ')}" if names else ""


def _same(first: object, other: object) -> bool:
    if isinstance(first, float) and isinstance(other, float):
        return math.isclose(first, other, rel_tol=_EQUAL)
    return first == other
