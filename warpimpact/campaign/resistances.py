"""What the catalogue knows of a campaign: its names, and the resistance of its plates, also at other thicknesses."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material, Threat
from ..catalogue.strength import NINETY, Resistance
from ..scene import Core, Plate
from .campaign import Campaign
from .catalogued import SAME, known_resistance, resistance_under

Curve = tuple[tuple[float, ...], tuple[float, ...]]

_THINNEST, _POINTS = 1e-3, 128
"""Least thickness of a curve as a share of the largest, and number of its points. The points are closer than a tenth of
the width within which the fit takes thicknesses as nearly equal (`catalogue.strength.SAME_THICKNESS`, as logarithms).
Linear interpolation is wrong by at most 0.1 %."""


def catalogue_resistance(campaign: Campaign, plate: Plate, thickness: float | None = None) -> Resistance | None:
    """The resistance of a plate, or of one of another thickness [m], by the catalogue; None where Y is the user's."""
    given = campaign.interaction, campaign.core, plate, campaign.impact.obliquity, campaign.catalogue
    return known_resistance(*given, thickness)


def resistance_by_thickness(campaign: Campaign, layer: int, thickest: float) -> Curve | None:
    """Thicknesses of a layer, ascending to the thickest [m], and its resistance there, where the catalogue gives it;
    None elsewhere. The resistance of the layer is 1."""
    plate = campaign.target.layers[layer]
    known = None if is_drawn(campaign, "resistance", [layer]) else catalogue_resistance(campaign, plate)
    if known is None:
        return None
    thicknesses = np.geomspace(_THINNEST * thickest, thickest, _POINTS).tolist()
    others = (catalogue_resistance(campaign, plate, thickness) for thickness in thicknesses)
    return tuple(thicknesses), tuple(other.median / known.median for other in others if other is not None)


def is_drawn(campaign: Campaign, quantity: str, layers: Collection[int] = (0,)) -> bool:
    """Whether a quantity differs from shot to shot, by a distribution or a file of hits."""
    scattered = any(name == quantity and k in layers for name, k in campaign.scatter.given)
    listed = campaign.hits.listed is not None and quantity in campaign.hits.listed
    return scattered or listed


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


def catalogue_names(campaign: Campaign) -> list[str]:
    """A line for each name of the catalogue in a campaign: how well it is known, and which values are the user's."""
    catalogue = Catalogue.of(campaign.catalogue)
    lines = [] if campaign.core.threat is None else [_of_threat(campaign.core, catalogue)]
    named = [(place, plate) for place, plate in campaign.target.named if plate.material is not None]
    return lines + [_of_material(campaign, place, plate, catalogue) for place, plate in named]


def _of_threat(core: Core, catalogue: Catalogue) -> str:
    name = core.threat
    threat = catalogue.all(Threat).get(str(name))
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
        return math.isclose(first, other, rel_tol=SAME)
    return first == other
