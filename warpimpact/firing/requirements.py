"""Named requirements: threat, velocity, directions and shots that a standard asks for, as far as known here.

Threats and their velocities are those of the catalogue. No text of a standard was at hand: these values come from
secondary sources, and `assumed` says what was not found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Threat, Velocity
from warpimpact.firing.directions import Directions
from warpimpact.firing.plan import FiringTest
from warpimpact.scene.units import meant, quoted


@dataclass(frozen=True)
class Requirement:
    """What a standard asks for.

    Attributes:
        name: name in a test file.
        standard: name in the catalogue.
        shots: shots of a proof; None for the fewest that show P(stop) ≥ 0.9 at 90 % confidence.
        azimuth, elevation: directions of the threat at which a plate shall hold [degree]; empty for the normal alone.
        source: source of these values.
        assumed: what is unknown, and what is taken instead.
    """

    name: str
    standard: str
    shots: int | None
    azimuth: tuple[float, ...]
    elevation: tuple[float, ...]
    source: str
    assumed: str


_ALL_AZIMUTHS = (-80.0, -60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 80.0)
_TABLE = "a second-hand table of threats"
_STANAG = "a second-hand table of threats, and public summaries of STANAG 4569"
_STANAG_ASSUMED = (
    "all azimuths that meet the face of a plate, in steps of 20 deg up to 80 deg, and elevations of 0 to 30 deg; 90 % "
    "stopped at 90 % confidence, every shot at any place"
)


def _stanag(level: int) -> Requirement:
    names = f"STANAG 4569 L{level}", f"STANAG 4569 level {level}"
    return Requirement(*names, None, _ALL_AZIMUTHS, (0.0, 15.0, 30.0), _STANAG, _STANAG_ASSUMED)


REQUIREMENTS = (
    *(_stanag(level) for level in (2, 3, 4)),
    Requirement("VPAM 9", "VPAM 9", 3, (), (), _TABLE, "none may perforate; shots at any place"),
    Requirement("VPAM 10", "VPAM 10", 3, (), (), _TABLE, "3 shots, as of VPAM 9, of which none may perforate"),
    Requirement("NIJ RF3", "NIJ RF3 / Level IV", None, (), (), _TABLE, "90 % stopped at 90 % confidence"),
    Requirement("GOST 34286-2017 Br5", "GOST 34286-2017 Br5", 5, (), (), _TABLE, "none may perforate"),
)


def named_requirement(name: str) -> Requirement:
    """The requirement with this name.

    Raises:
        CampaignError: there is none.
    """
    known = {requirement.name: requirement for requirement in REQUIREMENTS}
    if name not in known:
        raise CampaignError(f"requirement: got {quoted(name)}, which is not known; {meant(name, known)}")
    return known[name]


def threat_of(requirement: Requirement, name: str | None) -> tuple[Threat, Velocity]:
    """The threat of a requirement, and the velocity that the standard asks for.

    Raises:
        CampaignError: the requirement has several threats and none is named, or has none of that name.
    """
    asked = {
        threat.name: (threat, velocity)
        for threat in Catalogue().all(Threat).values()
        for velocity in threat.velocities
        if velocity.standard == requirement.standard
    }
    if name is None and len(asked) == 1:
        return next(iter(asked.values()))
    if name is None:
        raise CampaignError(f"threat: is missing, but {requirement.name} has {len(asked)}: {', '.join(asked)}")
    if name not in asked:
        raise CampaignError(f"threat: got {quoted(name)}, but {requirement.name} has {', '.join(asked)}")
    return asked[name]


def with_requirement(test: FiringTest) -> FiringTest:
    """The test with the proof, the window of velocity and the directions of its named requirement, unless it gives
    others.

    Raises:
        CampaignError: the requirement or the threat is not known.
    """
    if test.requirement is None:
        return test
    asked = named_requirement(test.requirement)
    _, velocity = threat_of(asked, test.threat)
    proof = {} if test.proof is None else test.proof.model_dump(exclude_none=True, exclude_unset=True)
    plan = {"velocity": velocity.value} | ({"shots": asked.shots} if asked.shots else {})
    updates: dict[str, object] = {"proof": plan | proof}
    if velocity.tolerance and test.gun.window is None:
        updates["gun"] = {"deviation": test.gun.deviation, "window": velocity.tolerance}
    if asked.azimuth and test.target.campaign is not None:
        test_directions = Directions() if test.directions is None else test.directions
        given = {name: getattr(test_directions, name) for name in test_directions.model_fields_set}
        angles = {
            "azimuth": [f"{math.radians(angle)!r} rad" for angle in asked.azimuth],
            "elevation": [f"{math.radians(angle)!r} rad" for angle in asked.elevation],
        }
        updates["directions"] = Directions.model_validate({"velocity": velocity.value} | angles | given)
    completed = test.model_copy(update=updates)
    completed._source = test._source
    return completed


def with_threat(campaign: Campaign, test: FiringTest) -> Campaign:
    """The campaign with core and velocity of the threat of a test's requirement. It keeps its own core if the catalogue
    does not have the threat's."""
    if test.requirement is None:
        return campaign
    threat, velocity = threat_of(named_requirement(test.requirement), test.threat)
    impact = campaign.impact.model_copy(update={"velocity": velocity.value})
    core = {} if threat.shape is None else {"core": threat.shape}
    return campaign.model_copy(update={"impact": impact, **core})


def requirement_line(test: FiringTest) -> str:
    """A line on what a requirement asks for as understood here, its source and what is assumed; empty without one."""
    if test.requirement is None:
        return ""
    asked = named_requirement(test.requirement)
    threat, velocity = threat_of(asked, test.threat)
    tolerance = f" ± {velocity.tolerance:g}" if velocity.tolerance else ""
    core = "" if threat.shape is not None else "; the core of this threat is not known: that of the campaign is used"
    return (
        f"{asked.name}: {threat.name} at {velocity.value:g}{tolerance} m/s ({threat.evidence}); source: "
        f"{asked.source}; assumed: {asked.assumed}{core}"
    )
