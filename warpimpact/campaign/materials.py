"""Names of the catalogue in a campaign, replaced by their entries, and resistances under another law.

A key beside a name overrides its value. A resistance belongs to the law with which it was determined. Under another law
the observation stays: the limit velocity of a solid plate, or the velocity that it takes from a core
(docs/model.md §6.2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import CORE, OBLIQUITY, Material, Threat
from ..catalogue.strength import NINETY, Resistance
from ..scene import Core, Interaction, Layer, Plate
from ..scene.model import Array
from ..scene.target import layer_name
from ..scene.units import quoted
from .text import CampaignError, as_campaign_error

_Table = dict[str, Any]
_OF_ANY_CORE = set(Core.model_fields)
SEARCHED_FROM = 800.0
"""Impact velocity at which a search of limit velocities begins if the threat has none [m/s]."""
SAME = 1e-6
"""Largest relative difference of a resistance from that of the catalogue at which it counts as the catalogue's."""
_STATIONS, _DEPTHS = 1001, 200
"""Points along a core, and steps of its way."""
_WIDEST = 1e-6
"""Relative difference from the largest radius at which a core counts as fully wide."""
_FACTORS = np.geomspace(0.02, 50.0, 401)
"""Resistances to try, over the one before."""
_SPEEDS = 401
"""Number of velocities behind the plate to try."""
_LAW = ("linear", "quadratic", "onset")
"""Keys of [interaction] that belong to a material."""


def catalogue_of(data: Mapping[str, Any], name: str, folder: Path) -> Catalogue:
    """The catalogue of a file: the package's entries, and those in the file that its key `catalogue` names.

    Raises:
        CampaignError: that file cannot be read; `name` is the campaign's name in errors.
    """
    given = data.get("catalogue")
    if not isinstance(given, str) or not (folder / given).is_file():
        return Catalogue()  # the validation of the campaign refuses a wrong name
    with as_campaign_error(f"{name}: catalogue: "):
        return Catalogue.of(folder / given)


def with_threat(data: _Table, catalogue: Catalogue, name: str, *, needs_velocity: bool = True) -> _Table:
    """Tables with the core of their threat, and with its velocity unless they give one. Unless it needs a velocity, a
    shot of a threat without one gets `SEARCHED_FROM`.

    Raises:
        CampaignError: the catalogue has no such threat, or its entry lacks a needed value.
    """
    core, impact = data.get("core"), data.get("impact", {})
    threat = _threat(core, catalogue, f"{name}: core")
    if threat is None:
        return data
    assert isinstance(core, dict)  # it names a threat
    resolved = data | {"core": core_of(threat, core, f"{name}: core")}
    if not isinstance(impact, dict) or "velocity" in impact:
        return resolved
    velocity = _velocity(threat, core, f"{name}: core", needs_velocity=needs_velocity)
    return resolved | {"impact": {"velocity": velocity} | impact}


def with_cores(data: _Table, catalogue: Catalogue, name: str) -> _Table:
    """Tables of a fit with the cores of the threats that it and its shots name. Velocities of shots are measured.

    Raises:
        CampaignError: as `with_threat`.
    """
    resolved, core, shots = dict(data), data.get("core"), data.get("shot")
    if (threat := _threat(core, catalogue, f"{name}: core")) is not None:
        resolved["core"] = core_of(threat, core, f"{name}: core")
    if isinstance(shots, list):
        resolved["shot"] = [
            with_cores(shot, catalogue, f"{name}: shot[{k}]") if isinstance(shot, dict) else shot
            for k, shot in enumerate(shots)
        ]
    return resolved


def _threat(core: Any, catalogue: Catalogue, place: str) -> Threat | None:
    """The threat that a table [core] names; None if it names none."""
    if not isinstance(core, dict) or not isinstance(core.get("threat"), str):
        return None
    with as_campaign_error(f"{place}.threat: "):
        return catalogue.named(Threat, core["threat"])


def core_of(threat: Threat, given: Any, place: str) -> _Table:
    """The table [core] of a threat, overridden by the given keys.

    Raises:
        CampaignError: the threat's core is unknown, and no shape is given.
    """
    given_core = dict(given) | {"threat": threat.name}
    base = {} if threat.shape is None else threat.shape.model_dump(exclude_unset=True)
    if threat.shape is None and "shape" not in given_core:
        raise CampaignError(
            f'{place}.threat: the catalogue does not know the core of "{threat.name}", only its velocities; give shape '
            "and what belongs to it"
        )
    if given_core.get("shape", base.get("shape")) != base.get("shape"):
        base = {key: value for key, value in base.items() if key in _OF_ANY_CORE}
    if any(given_core.get(key) is not None for key in ("mass", "density")):
        base = {key: value for key, value in base.items() if key not in ("mass", "density")}
    return base | given_core


def _velocity(threat: Threat, core: Mapping[str, Any], place: str, *, needs_velocity: bool) -> Any:
    """The impact velocity of a threat by its standard, or its distribution."""
    known, standard = {velocity.standard: velocity for velocity in threat.velocities}, core.get("standard")
    if not known and standard is None and not needs_velocity:
        return SEARCHED_FROM
    if not known:
        raise CampaignError(f'{place}.threat: the catalogue has no velocity of "{threat.name}"; give impact.velocity')
    if standard is not None and standard not in known:
        raise CampaignError(f"{place}.standard: got {quoted(standard)}, but it must be one of {', '.join(known)}")
    velocity = threat.velocities[0] if standard is None else known[standard]
    if core.get("velocity_tolerance") is not True:
        return velocity.value
    if velocity.tolerance is None:
        unknown = f"the catalogue has no tolerance of {velocity.standard}; give impact.velocity"
        raise CampaignError(f"{place}.velocity_tolerance: {unknown}")
    low, high = velocity.value - velocity.tolerance, velocity.value + velocity.tolerance
    return {"distribution": "uniform", "low": low, "high": high}


def with_materials(data: _Table, catalogue: Catalogue, name: str, folder: Path = Path()) -> _Table:
    """Tables with the numbers of the materials of plate and layers, and with their law. No value is a distribution.

    Raises:
        CampaignError: the catalogue has no such material, or the laws of two materials differ.
    """
    materials: dict[str, Material] = {}

    def filled(place: str, table: Any) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("material"), str):
            return table
        with as_campaign_error(f"{name}: {place}.material: "):
            materials[place] = material = catalogue.named(Material, table["material"])
        return material.table(table, _resistance(data, material, table, catalogue, folder))

    resolved = dict(data)
    if "plate" in data:
        resolved["plate"] = filled("plate", data["plate"])
    if isinstance(layers := data.get("layer"), list):
        resolved["layer"] = [filled(layer_name(k), table) for k, table in enumerate(layers, start=1)]
    interaction = data.get("interaction", {})
    if not materials or not isinstance(interaction, dict):
        return resolved
    law: dict[str, float] = {}  # one for the whole target
    for key in _LAW:
        values = {getattr(material, key): place for place, material in materials.items()}
        if len(values) > 1 and key not in interaction:
            places = " and ".join(f"{value:g} ({place})" for value, place in values.items())
            raise CampaignError(f"{name}: interaction.{key}: the materials were found with {places}; give one value")
        law[key] = next(iter(values))
    return resolved | {"interaction": law | interaction}


def _resistance(
    data: Mapping[str, Any], material: Material, plate: Mapping[str, Any], catalogue: Catalogue, folder: Path
) -> float:
    """Y of a plate of a material under the law of a campaign [Pa]; that of the entry if something of core, plate, law
    or shot is not valid, which the validation of the whole campaign reports better."""
    keys = {key: value for key, value in plate.items() if key != "pattern" or "areal_density" in plate}
    impact, interaction = data.get("impact", {}), data.get("interaction", {})
    try:
        core = CORE.validate_python(data.get("core"), context={"folder": folder})
        model = Layer if {"gap", "offset"} & set(plate) else Plate
        shot = model.model_validate(material.table(keys, 1.0))
        obliquity = OBLIQUITY.validate_python(impact.get("obliquity", 0.0) if isinstance(impact, dict) else 0.0)
        law = Interaction.model_validate(law_of(material).model_dump() | interaction)
    except (ValidationError, TypeError):
        return material.resistance
    return resistance_under(law, material, core, shot, obliquity, catalogue).median


def law_of(material: Material) -> Interaction:
    """The law that the resistance of a material was found with."""
    return Interaction(**{key: getattr(material, key) for key in _LAW})


def resistance_under(
    law: Interaction, material: Material, core: Core, plate: Plate, obliquity: float, catalogue: Catalogue
) -> Resistance:
    """What is known of Y of a plate of a material under a law, with the friction of the plate.

    The catalogue has it under the law and the friction of the material. Under others Y is such that the limit velocity
    of a solid plate stays (docs/model.md §6.2).

    Of the plate thickness, friction and density count. The obliquity is that of the shot [rad].
    """
    known = catalogue.resistance(material, core, plate.thickness, obliquity)
    of_material = law_of(material)
    if law == of_material and plate.shear_coefficient == material.shear_coefficient:
        return known
    given = of_material, material.shear_coefficient, plate.thickness, plate.density
    passage = StraightPassage(core, *given, obliquity)
    median, low, high = (
        passage.resistance_under(law, plate.shear_coefficient, value) for value in (known.median, *known.ends)
    )
    ratio = math.log(high / low) / (2.0 * NINETY * known.deviation) if known.deviation else 1.0
    return Resistance(median, ratio * known.deviation, ratio * known.test)


def known_resistance(
    law: Interaction, core: Core, plate: Plate, obliquity: float, file: Path | None, thickness: float | None = None
) -> Resistance | None:
    """The resistance of a plate, or of one of another thickness [m], by the catalogue; None where Y is the user's."""
    catalogue = Catalogue.of(file)
    material = catalogue.all(Material).get(str(plate.material))
    if material is None:
        return None
    known = resistance_under(law, material, core, plate, obliquity, catalogue)
    if not math.isclose(known.median, plate.resistance, rel_tol=SAME):
        return None
    if thickness is None:
        return known
    other = plate.model_copy(update={"thickness": thickness})
    return resistance_under(law, material, core, other, obliquity, catalogue)


def calibres_of(core: Core, plate: Plate) -> float:
    """Thickness of a plate in diameters of the core."""
    return plate.thickness / (2.0 * core.max_radius)


@dataclass(frozen=True)
class StraightPassage:
    """A core that goes straight on through a solid plate, without yaw.

    Attributes:
        core: the core.
        law: stress of an element.
        friction: η.
        thickness: of the plate [m].
        density: of the plate [kg/m³].
        obliquity: of the shot [rad]; the way through the plate is as much longer.
    """

    core: Core
    law: Interaction
    friction: float
    thickness: float
    density: float
    obliquity: float = 0.0

    def entry(self, resistance: ArrayLike, leaving: ArrayLike = 0.0) -> Array:
        """Velocity with which the core enters [m/s], of the broadcast shape of the arguments. The motion is followed
        from the rear face back to the front face. `leaving` is the velocity behind the plate [m/s], 0 at the limit.
        """
        station, radius, slope = self._nose()
        facing, law, free = slope / np.sqrt(1.0 + slope * slope), self.law, self.law.free_surface
        touching = np.minimum(facing / law.onset, 1.0) if law.onset > 0.0 else (facing > 0.0).astype(float)
        area = 2.0 * np.pi * radius * np.gradient(station) * touching * (slope + self.friction)
        near, steep = np.ones_like(radius), 0.0
        if free is not None:
            near /= 1.0 + radius / (free.reach * self.thickness)
            steep = free.attack
        way = self.thickness / math.cos(self.obliquity)
        edges = np.linspace(way + station[-1], 0.0, _DEPTHS + 1)
        depth, step = 0.5 * (edges[1:] + edges[:-1])[:, None], edges[0] - edges[1]
        inside = (depth > station) & (depth < station + way)
        tip = np.pi * radius[0] ** 2 * inside[:, 0]
        static, linear, quadratic = (
            inside @ (area * share) + tip * at_tip
            for share, at_tip in ((near + steep * facing, near[0] + steep), (facing, 1.0), (facing**2, 1.0))
        )
        strength, behind = np.broadcast_arrays(np.asarray(resistance, dtype=float), np.asarray(leaving, dtype=float))
        by_speed, square = law.linear * np.sqrt(self.density * strength), behind**2
        for at, once, twice in zip(static, linear, quadratic, strict=True):
            force = law.static * strength * at + by_speed * np.sqrt(square) * once
            force += law.quadratic * self.density * square * twice
            square = square + 2.0 * step / self.core.mass_properties.mass * force
        return np.asarray(np.sqrt(square))

    def resistance_under(self, law: Interaction, friction: float, resistance: float, velocity: float = 0.0) -> float:
        """Resistance Y [Pa] with which the plate takes as much from the core, which arrives with this velocity [m/s],
        under another law and friction. If the limit velocity is not less, it is kept instead."""
        limit, leaving = float(self.entry(resistance)), 0.0
        if velocity > limit:
            behind = np.linspace(0.0, velocity, _SPEEDS)
            leaving = float(np.interp(velocity, self.entry(resistance, behind), behind))
        tried = resistance * _FACTORS
        entered = replace(self, law=law, friction=friction).entry(tried, leaving)
        return float(np.exp(np.interp(np.log(max(velocity, limit)), np.log(entered), np.log(tried))))

    def _nose(self) -> tuple[Array, Array, Array]:
        """Stations, radii [m] and slopes of the core from its tip to where it is widest."""
        station = np.linspace(0.0, self.core.length, _STATIONS)
        radius = np.asarray(self.core.radius(station))
        widest = int(np.argmax(radius >= self.core.max_radius * (1.0 - _WIDEST))) + 1
        station, radius = station[:widest], radius[:widest]
        return station, radius, np.maximum(np.gradient(radius, station), 0.0)
