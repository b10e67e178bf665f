"""The resistance Y of a plate by the catalogue, also under another law than that with which it was determined.

A resistance belongs to its law. Under another law the observation stays: the limit velocity of a solid plate, or the
velocity that it takes from a core (docs/model.md §6.2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..catalogue.strength import NINETY, Resistance
from ..scene import Core, Interaction, Plate
from ..scene.model import Array

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


def resistance_under(
    law: Interaction, material: Material, core: Core, plate: Plate, obliquity: float, catalogue: Catalogue
) -> Resistance:
    """What is known of Y of a plate of a material under a law, with the friction of the plate.

    The catalogue has it under the law and the friction of the material. Under others Y is such that the limit velocity
    of a solid plate stays (docs/model.md §6.2).

    Of the plate thickness, friction and density count. The obliquity is that of the shot [rad].
    """
    known = catalogue.resistance(material, core, plate.thickness, obliquity)
    if law == material.law and plate.shear_coefficient == material.shear_coefficient:
        return known
    given = material.law, material.shear_coefficient, plate.thickness, plate.density
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
