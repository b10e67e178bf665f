"""The resistance Y of a plate by the catalogue, also under another law than that with which it was determined.

A resistance belongs to its law. Under another law the observation stays: the limit velocity of a solid plate, or the
velocity that it takes from a core (docs/model.md §6.2).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..catalogue.strength import Z_90, Resistance
from ..scene import Core, Interaction, Plate
from ..scene.model import Array

Stress = tuple[Interaction, float]
"""Law of the normal stress on a core, and friction η."""
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
    as_given, as_used = (material.law, material.shear_coefficient), (law, plate.shear_coefficient)
    median, low, high = (
        equivalent_resistance(core, plate, obliquity, as_given, as_used, value) for value in (known.median, *known.ends)
    )
    ratio = math.log(high / low) / (2.0 * Z_90 * known.deviation) if known.deviation else 1.0
    return Resistance(median, ratio * known.deviation, ratio * known.test)


def equivalent_resistance(
    core: Core, plate: Plate, obliquity: float, before: Stress, after: Stress, resistance: float, velocity: float = 0.0
) -> float:
    """Resistance Y [Pa] with which a plate takes as much from a core under another stress.

    The core arrives with this velocity [m/s]. If the limit velocity is not less, it is kept instead.
    """
    limit, leaving = float(entry_velocity(core, plate, obliquity, before, resistance)), 0.0
    if velocity > limit:
        behind = np.linspace(0.0, velocity, _SPEEDS)
        leaving = float(np.interp(velocity, entry_velocity(core, plate, obliquity, before, resistance, behind), behind))
    tried = resistance * _FACTORS
    entered = entry_velocity(core, plate, obliquity, after, tried, leaving)
    return float(np.exp(np.interp(np.log(max(velocity, limit)), np.log(entered), np.log(tried))))


def entry_velocity(
    core: Core, plate: Plate, obliquity: float, stress: Stress, resistance: ArrayLike, leaving: ArrayLike = 0.0
) -> Array:
    """Velocity with which a core enters a solid plate [m/s], of the broadcast shape of the last two arguments.

    It goes straight on, without yaw, and leaves with the velocity `leaving` [m/s], 0 at the limit. The motion is
    followed from the rear face back to the front face. Of the plate, thickness and density count.
    """
    law, friction = stress
    station, radius, slope = _nose(core)
    facing, free = slope / np.sqrt(1.0 + slope * slope), law.free_surface
    touching = np.minimum(facing / law.onset, 1.0) if law.onset > 0.0 else (facing > 0.0).astype(float)
    area = 2.0 * np.pi * radius * np.gradient(station) * touching * (slope + friction)
    near, steep = np.ones_like(radius), 0.0
    if free is not None:
        near /= 1.0 + radius / (free.reach * plate.thickness)
        steep = free.attack
    way = plate.thickness / math.cos(obliquity)
    edges = np.linspace(way + station[-1], 0.0, _DEPTHS + 1)
    depth, step = 0.5 * (edges[1:] + edges[:-1])[:, None], edges[0] - edges[1]
    inside = (depth > station) & (depth < station + way)
    tip = np.pi * radius[0] ** 2 * inside[:, 0]
    static, linear, quadratic = (
        inside @ (area * share) + tip * at_tip
        for share, at_tip in ((near + steep * facing, near[0] + steep), (facing, 1.0), (facing**2, 1.0))
    )
    strength, behind = np.broadcast_arrays(np.asarray(resistance, dtype=float), np.asarray(leaving, dtype=float))
    by_speed, square = law.linear * np.sqrt(plate.density * strength), behind**2
    for at, once, twice in zip(static, linear, quadratic, strict=True):
        force = law.static * strength * at + by_speed * np.sqrt(square) * once
        force += law.quadratic * plate.density * square * twice
        square = square + 2.0 * step / core.mass_properties.mass * force
    return np.asarray(np.sqrt(square))


def _nose(core: Core) -> tuple[Array, Array, Array]:
    """Stations, radii [m] and slopes of a core from its tip to where it is widest."""
    station = np.linspace(0.0, core.length, _STATIONS)
    radius = np.asarray(core.radius(station))
    widest = int(np.argmax(radius >= core.max_radius * (1.0 - _WIDEST))) + 1
    station, radius = station[:widest], radius[:widest]
    return station, radius, np.maximum(np.gradient(radius, station), 0.0)
