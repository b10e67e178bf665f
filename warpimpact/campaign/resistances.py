"""What the catalogue knows of a campaign: its names, and the resistance of its plates, also at other thicknesses."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material, Threat
from ..catalogue.strength import NINETY
from ..scene import Core, Plate
from .campaign import Campaign
from .materials import SAME, resistance_under

Curve = tuple[tuple[float, ...], tuple[float, ...]]

_THINNEST, _POINTS = 1e-3, 128
"""Least thickness of a curve as a share of the largest, and number of its points. The points are closer than a tenth of
the width within which the fit takes thicknesses as nearly equal (`catalogue.strength.SAME_THICKNESS`, as logarithms).
Linear interpolation is wrong by at most 0.1 %."""


def resistance_by_thickness(campaign: Campaign, layer: int, thickest: float) -> Curve | None:
    """Thicknesses of a layer, ascending to the thickest [m], and its resistance there, where the catalogue gives it;
    None elsewhere. The resistance of the layer is 1."""
    plate = campaign.target.layers[layer]
    known = None if is_drawn(campaign, "resistance", [layer]) else campaign.catalogue_resistance(plate)
    if known is None:
        return None
    thicknesses = np.geomspace(_THINNEST * thickest, thickest, _POINTS).tolist()
    others = (campaign.catalogue_resistance(plate, thickness) for thickness in thicknesses)
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
    known = campaign.catalogue_resistance(plate)
    if known is None or not known.deviation:
        return None
    factor = math.exp(0.5 * NINETY * math.hypot(known.deviation, known.test))
    return 1.0 / factor, factor


def catalogue_names(campaign: Campaign) -> list[str]:
    """A line for each name of the catalogue in a campaign: how well it is known, and which values are the user's."""
    catalogue, lines = Catalogue.of(campaign.catalogue), list[str]()
    if campaign.core.threat is not None:
        lines.append(_of_threat(campaign.core, catalogue.all(Threat).get(campaign.core.threat)))
    for place, plate in campaign.target.named:
        if plate.material is not None:
            material = catalogue.all(Material).get(plate.material)
            known = None if material is None else _of_material(campaign, plate, material, catalogue)
            lines.append(f"{place}: {known or f'{plate.material}, which is not in the catalogue'}")
    return lines


def _of_threat(core: Core, threat: Threat | None) -> str:
    if threat is None:
        return f"core: {core.threat}, which is not in the catalogue"
    entry, changed = threat.shape, list[str]()
    if entry is not None and type(core) is not type(entry):
        changed = ["shape"]
    elif entry is not None:
        names = [name for name in type(core).model_fields if name not in ("threat", "standard", "velocity_tolerance")]
        changed = [name for name in names if not _same(getattr(core, name), getattr(entry, name))]
    return f"core: {core.threat}{_with_another(changed)} ({threat.evidence})"


def _of_material(campaign: Campaign, plate: Plate, material: Material, catalogue: Catalogue) -> str:
    law, obliquity = campaign.interaction, campaign.impact.obliquity
    known = resistance_under(law, material, campaign.core, plate, obliquity, catalogue)
    expected = {name: (getattr(plate, name), getattr(material, name)) for name in ("shear_coefficient", "density")}
    expected |= {name: (getattr(law, name), getattr(material, name)) for name in ("linear", "quadratic", "onset")}
    expected = {"resistance": (plate.resistance, known.median)} | expected | {"free_surface": (law.free_surface, None)}
    changed = [name for name, pair in expected.items() if not _same(*pair)]
    low, high = (end / 1e9 for end in known.ends)
    is_known = known.deviation and "resistance" not in changed
    interval = f", {low:.3g} to {high:.3g} with 90 %" if is_known else ""
    y = plate.resistance / 1e9
    return f"{material.name}{_with_another(changed)}, Y {y:.3g} GPa{interval} ({material.evidence})"


def _with_another(names: list[str]) -> str:
    return f" with another {', '.join(names).replace('_', ' ')}" if names else ""


def _same(first: object, other: object) -> bool:
    if isinstance(first, float) and isinstance(other, float):
        return math.isclose(first, other, rel_tol=SAME)
    return first == other
