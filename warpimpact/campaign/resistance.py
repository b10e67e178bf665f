"""The resistance Y of a plate by the catalogue, also under another law than that with which it was determined.

A resistance belongs to its law. Under another law the observation stays: the limit velocity of a solid plate, or the
velocity that it takes from a core (docs/model.md §6.2).
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material
from ..catalogue.strength import Z_90, Resistance
from ..scene import Core, Interaction, Plate
from ..scene.interaction import normal_stress
from ..scene.model import Array

Stress = tuple[Interaction, float]
"""Law of the normal stress on a core, and friction η."""
SAME = 1e-6
"""Largest relative difference of a resistance from that of the catalogue at which it counts as the catalogue's."""
_STATIONS, _DEPTHS = 1001, 200
"""Points along a core, and steps of its way."""
_WIDEST = 1e-6
"""Relative difference from the largest radius at which a core counts as fully wide."""
_FACTORS = 0.02, 50.0
"""Least and largest resistance to try, over the one before."""


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
    entered = partial(entry_velocity, core, plate, obliquity)
    square = max(velocity, float(entered(before, resistance))) ** 2
    leaving = math.sqrt(_root(lambda behind: entered(before, resistance, math.sqrt(behind)), 0.0, square, square))
    low, high = (factor * resistance for factor in _FACTORS)
    return _root(lambda tried: entered(after, tried, leaving), low, high, square)


def _root(velocity: Callable[[float], Array], low: float, high: float, square: float) -> float:
    """Where the square of a velocity that increases has this value, or the end of the range that is nearest to it."""

    def excess(place: float) -> float:
        return float(velocity(place)) ** 2 - square

    if excess(low) >= 0.0:
        return low
    return float(brentq(excess, low, high)) if excess(high) > 0.0 else high


def entry_velocity(
    core: Core, plate: Plate, obliquity: float, stress: Stress, resistance: ArrayLike, leaving: ArrayLike = 0.0
) -> Array:
    """Velocity with which a core enters a solid plate [m/s], of the broadcast shape of the last two arguments.

    It goes straight on, without yaw, and leaves with the velocity `leaving` [m/s], 0 at the limit. The motion is
    followed from the rear face back to the front face. Of the plate, thickness and density count.
    """
    law, friction = stress
    station, radius, facing, area = _surface(core, law.onset, friction)
    way = plate.thickness / math.cos(obliquity)
    edges = np.linspace(way + station[-1], 0.0, _DEPTHS + 1)
    depth, step = 0.5 * (edges[1:] + edges[:-1])[:, None], edges[0] - edges[1]
    inside = (depth > station) & (depth < station + way)
    strength, behind = np.broadcast_arrays(np.asarray(resistance, dtype=float), np.asarray(leaving, dtype=float))
    strength, square = strength[..., None], behind**2
    for first, count in zip(inside.argmax(axis=1), inside.sum(axis=1), strict=True):
        part = slice(first, first + count)
        closing = np.sqrt(square)[..., None] * facing[part]
        force = normal_stress(law, plate, strength, closing, facing[part], radius[part]) @ area[part]
        square = square + 2.0 * step / core.mass_properties.mass * force
    return np.asarray(np.sqrt(square))


def _surface(core: Core, onset: float, friction: float) -> tuple[Array, Array, Array, Array]:
    """Stations and radii [m] of a core from its tip to where it is widest, the sines of its slopes, and the areas [m²]
    by which normal stresses with their friction drive it back. The flat of the tip is the first."""
    station = np.linspace(0.0, core.length, _STATIONS)
    radius = np.asarray(core.radius(station))
    widest = int(np.argmax(radius >= core.max_radius * (1.0 - _WIDEST))) + 1
    station, radius = station[:widest], radius[:widest]
    slope = np.maximum(np.gradient(radius, station), 0.0)
    facing = slope / np.sqrt(1.0 + slope * slope)
    touching = np.minimum(facing / onset, 1.0) if onset > 0.0 else (facing > 0.0).astype(float)
    area = 2.0 * np.pi * radius * np.gradient(station) * touching * (slope + friction)
    tip = np.pi * radius[0] ** 2
    return np.append(0.0, station), np.append(radius[0], radius), np.append(1.0, facing), np.append(tip, area)
