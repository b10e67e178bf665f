"""What nobody measured of a campaign, chosen otherwise: resistance, weakening, friction, onset, obliquity and yaw.

Each alternative changes one thing of a campaign and leaves its hits in their places.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import ValidationError

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..scene import Plate
from .campaign import Campaign

AS_GIVEN = "as given"
UNKNOWN = 0.3
"""How far a resistance that a user gives may be off, as a share of it: more than two steels of one hardness differ."""
WEAK, SOON = 0.8, 1e-6
"""β and its interval [s] where a plate is taken to weaken: those of the paper."""
FRICTIONS, ONSETS = (0.0, 0.1), (0.0, 0.02)
"""η and κ that fits of published shots cannot tell apart from the usual ones (docs/validation.md)."""
OBLIQUE, YAWED = math.radians(5.0), math.radians(2.0)
"""How far a shot of a test may lie from the line of fire, and its core from that [rad]."""
_DIFFERENT = 1e-6
"""Relative change of a value below which an alternative is none."""


class Alternative(NamedTuple):
    """A choice that may be wrong.

    Attributes:
        name: what is chosen otherwise, for people.
        changed: gives a campaign with it; None where the campaign has it already, or has no such thing.
    """

    name: str
    changed: Callable[[Campaign], Campaign | None]


def alternatives(campaigns: Mapping[str, Campaign]) -> dict[str, dict[str, Campaign]]:
    """Campaigns by name, under every assumption that changes one of them; as they are given comes first."""
    found = {AS_GIVEN: dict(campaigns)}
    for name, changed in _ALTERNATIVES:
        try:
            others = {plate: changed(campaign) for plate, campaign in campaigns.items()}
        except ValidationError:  # no campaign can have it, such as a line of flight along the plate
            continue
        if any(others.values()):
            found[name] = {plate: other or campaigns[plate] for plate, other in others.items()}
    return found


def _of_plates(change: Callable[[Campaign, Plate], Mapping[str, Any]]) -> Callable[[Campaign], Campaign | None]:
    """An alternative that changes every plate and layer of a campaign by itself."""

    def changed(campaign: Campaign) -> Campaign | None:
        plates: list[Plate] = [campaign.plate, *campaign.layer]
        updates = [dict(change(campaign, plate)) for plate in plates]
        drawn = set() if campaign.drawn is None else {str(path[1]) for path in campaign.drawn.values}
        scattered = {name for name, _ in campaign.scatter.given} | drawn
        if not any(_differs(plate, update) for plate, update in zip(plates, updates, strict=True)):
            return None
        if scattered & {name for update in updates for name in update}:
            return None  # its values are drawn
        first, *others = (plate.model_copy(update=update) for plate, update in zip(plates, updates, strict=True))
        return campaign.model_copy(update={"plate": first, "layer": tuple(others)})

    return changed


def _differs(plate: Plate, update: Mapping[str, Any]) -> bool:
    return any(
        value is not None and not math.isclose(value, getattr(plate, name) or 0.0, rel_tol=_DIFFERENT)
        for name, value in update.items()
    )


def _resistance(end: int) -> Callable[[Campaign, Plate], Mapping[str, Any]]:
    """The low (0) or high (1) end of what Y may be: the catalogue's interval, or a share of a value of the user."""

    def change(campaign: Campaign, plate: Plate) -> Mapping[str, Any]:
        catalogue = Catalogue.of(campaign.catalogue)
        material = catalogue.all(Material).get(str(plate.material))
        if material is not None:
            known = catalogue.resistance(material, campaign.core, plate.thickness, campaign.impact.obliquity)
            if known.deviation and math.isclose(known.median, plate.resistance, rel_tol=_DIFFERENT):
                return {"resistance": known.ends[end]}
        return {"resistance": plate.resistance * (1.0 + UNKNOWN * (2 * end - 1))}

    return change


def _never_weak(_: Campaign, plate: Plate) -> Mapping[str, Any]:
    return {"degradation": 1.0} if plate.degradation < 1.0 else {}


def _weak(_: Campaign, plate: Plate) -> Mapping[str, Any]:
    if plate.degradation < 1.0 or not plate.open_area:
        return {}
    return {"degradation": WEAK, "degradation_interval": SOON, "degradation_distance": None}


def _reach(factor: float) -> Callable[[Campaign, Plate], Mapping[str, Any]]:
    """Another reach of weakening, in the plane and along the thickness."""

    def change(_: Campaign, plate: Plate) -> Mapping[str, Any]:
        if plate.degradation == 1.0:
            return {}
        return {
            "degradation_length": factor * plate.degradation_length,
            "degradation_depth": factor * plate.degradation_depth,
        }

    return change


def _friction(value: float) -> Callable[[Campaign, Plate], Mapping[str, Any]]:
    return lambda campaign, plate: {"shear_coefficient": value}


def _onset(value: float) -> Callable[[Campaign], Campaign | None]:
    def changed(campaign: Campaign) -> Campaign | None:
        if math.isclose(campaign.interaction.onset, value):
            return None
        return campaign.model_copy(update={"interaction": campaign.interaction.model_copy(update={"onset": value})})

    return changed


def _turned(name: str, angle: float) -> Callable[[Campaign], Campaign | None]:
    """Another obliquity or yaw; not where these scatter."""

    def changed(campaign: Campaign) -> Campaign | None:
        degrees = math.degrees(getattr(campaign.impact, name) + angle)
        if any(scattered == name for scattered, _ in campaign.scatter.given):
            return None
        impact = campaign.impact.model_copy(update={name: f"{degrees!r} deg"})
        return campaign.model_copy(update={"impact": impact})

    return changed


_ALTERNATIVES: Sequence[Alternative] = (
    Alternative("Y at its low end", _of_plates(_resistance(0))),
    Alternative("Y at its high end", _of_plates(_resistance(1))),
    Alternative("no weakening (β = 1)", _of_plates(_never_weak)),
    Alternative(f"weakening (β = {WEAK:g} in 1 µs)", _of_plates(_weak)),
    Alternative("weakening reaches half as far", _of_plates(_reach(0.5))),
    Alternative("weakening reaches twice as far", _of_plates(_reach(2.0))),
    *(Alternative(f"friction η = {value:g}", _of_plates(_friction(value))) for value in FRICTIONS),
    *(Alternative(f"onset κ = {value:g}", _onset(value)) for value in ONSETS),
    Alternative(f"{math.degrees(OBLIQUE):g}° more oblique", _turned("obliquity", OBLIQUE)),
    Alternative(f"{math.degrees(YAWED):g}° of yaw", _turned("yaw", YAWED)),
)
