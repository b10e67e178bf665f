"""Resistance of a campaign's plates by the catalogue, also at thicknesses that the campaign does not have."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..scene import Plate
from .catalogued import resistance_under

if TYPE_CHECKING:
    from ..catalogue.strength import Resistance
    from .campaign import Campaign

Curve = tuple[tuple[float, ...], tuple[float, ...]]

_SAME = 1e-6
"""Largest relative difference of a resistance from that of the catalogue at which it counts as the catalogue's."""
_THINNEST, _POINTS = 1e-3, 128
"""Least thickness of a curve as a share of the largest, and number of its points. The points are closer than a tenth of
the width within which the fit takes thicknesses as nearly equal (`catalogue.strength.SAME_THICKNESS`, as logarithms).
Linear interpolation is wrong by at most 0.1 %."""


def catalogue_resistance(campaign: Campaign, plate: Plate, thickness: float | None = None) -> Resistance | None:
    """The resistance of a plate, or of one of another thickness [m], by the catalogue; None where Y is the user's."""
    catalogue = Catalogue.of(campaign.catalogue)
    material = catalogue.all(Material).get(str(plate.material))
    if material is None:
        return None

    def known_of(plate: Plate) -> Resistance:
        given = campaign.interaction, material, campaign.core, plate, campaign.impact.obliquity, catalogue
        return resistance_under(*given)

    known = known_of(plate)
    if not math.isclose(known.median, plate.resistance, rel_tol=_SAME):
        return None
    return known if thickness is None else known_of(plate.model_copy(update={"thickness": thickness}))


def resistance_by_thickness(campaign: Campaign, layer: int, thickest: float, unit: float | None = None) -> Curve | None:
    """Thicknesses of a layer, ascending to the thickest [m], and its resistance there, where the catalogue gives it;
    None elsewhere. The resistance of the thickness `unit` [m], by default that of the layer, is 1."""
    plate = campaign.target.layers[layer]
    known = None if is_drawn(campaign, "resistance", [layer]) else catalogue_resistance(campaign, plate, unit)
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
