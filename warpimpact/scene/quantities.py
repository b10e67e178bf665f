"""The quantities of a scene that may differ from shot to shot, and the usual and possible range of each."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from . import units
from .units import UNITS


class Quantity(NamedTuple):
    """A quantity of a scene.

    Attributes:
        table: table of a campaign file that has it; for a quantity of layers, that of the plate.
        type: annotated type that reads it.
        meaning: long name of its column in a result.
        by_layer: whether each layer has a value.
        scatters: whether it may have a distribution.
        listed: whether it may be a column in a file of hits.
        column: name of its column in a result; None if it is the name of the quantity.
    """

    table: str
    type: Any
    meaning: str = ""
    by_layer: bool = False
    scatters: bool = True
    listed: bool = True
    column: str | None = None


_SHARE = Annotated[units.Number, Field(ge=0, le=1)]
_PLACE = "place of its origin in the plane of the plate"
QUANTITIES: Mapping[str, Quantity] = {
    "hit_y": Quantity("hits", units.Length, "hit point on the front face, y", scatters=False),
    "hit_z": Quantity("hits", units.Length, "hit point on the front face, z", scatters=False),
    "velocity": Quantity("impact", units.PositiveSpeed, "impact velocity", column="impact_velocity"),
    "obliquity": Quantity("impact", units.Obliquity, "angle between line of fire and plate normal"),
    "azimuth": Quantity("impact", units.Angle, "direction of the obliquity, from +y towards +z"),
    "pitch": Quantity("impact", units.Tilt, "pitch of the core, relative to the line of fire", column="impact_pitch"),
    "yaw": Quantity("impact", units.Tilt, "yaw of the core, relative to the line of fire", column="impact_yaw"),
    "spin": Quantity("impact", units.AngularVelocity, "spin of the core about its axis on impact"),
    "resistance": Quantity("plate", units.NonNegativeStress, "resistance", by_layer=True),
    "shear_coefficient": Quantity("plate", units.NonNegativeNumber, "friction per normal stress", by_layer=True),
    "degradation": Quantity(
        "plate", _SHARE, "share of the resistance that an interval of contact leaves", by_layer=True
    ),
    "thickness": Quantity("plate", units.PositiveLength, "thickness", by_layer=True),
    "mass": Quantity("core", units.PositiveMass, "mass of the core"),
    "strength": Quantity("core", units.PositiveStress, "strength of the core, a nominal bending stress"),
    "offset_y": Quantity("layer", units.Length, f"{_PLACE}, y", by_layer=True, listed=False),
    "offset_z": Quantity("layer", units.Length, f"{_PLACE}, z", by_layer=True, listed=False),
    "degradation_interval": Quantity("plate", units.PositiveTime, scatters=False, listed=False),
    "degradation_distance": Quantity("plate", units.PositiveLength, scatters=False, listed=False),
    "degradation_length": Quantity("plate", units.PositiveLength, scatters=False, listed=False),
    "density": Quantity("plate", units.PositiveDensity, scatters=False, listed=False),
    "static": Quantity("interaction", units.NonNegativeNumber, "normal stress at rest per resistance", scatters=False),
    "linear": Quantity("interaction", units.NonNegativeNumber, "linear part of the normal stress", scatters=False),
    "quadratic": Quantity("interaction", units.NonNegativeNumber, "quadratic part of it", scatters=False),
    "onset": Quantity("interaction", units.NonNegativeNumber, "closing speed of full contact", scatters=False),
}
"""All quantities by name."""
SCATTERED = {name: quantity for name, quantity in QUANTITIES.items() if quantity.scatters}
LISTED = tuple(name for name, quantity in QUANTITIES.items() if quantity.listed)
BY_LAYER = tuple(name for name, quantity in QUANTITIES.items() if quantity.by_layer)
OF_THE_SCENE = tuple(name for name in LISTED if QUANTITIES[name].table in ("plate", "core", "interaction"))
"""Quantities of plate, core and interaction that may differ from shot to shot."""

_OF_THE_PLATE = [name for name, quantity in SCATTERED.items() if quantity.table != "layer"]
_OF_LAYERS_BEHIND = ("thickness", "resistance", "shear_coefficient", "degradation", "offset_y", "offset_z")
DRAWN = len(_OF_THE_PLATE)
"""Columns of random numbers without those of layers behind the plate."""


def drawn_columns(layers: int) -> int:
    """Number of columns of random numbers for a target of this number of layers."""
    return DRAWN + len(_OF_LAYERS_BEHIND) * (layers - 1)


def drawn_column(name: str, layer: int = 0) -> int:
    """Column of random numbers of a quantity, which does not depend on the other quantities that scatter."""
    return drawn_columns(layer) + _OF_LAYERS_BEHIND.index(name) if layer else _OF_THE_PLATE.index(name)


class Bounds(NamedTuple):
    """Usual and possible range of a quantity, in SI or radians. Zero is always usual.

    Attributes:
        low, high: usual range, outside which there is a warning.
        unit: SI unit.
        least, most: possible range, outside which a value is refused.
        why: reason for the possible range.
    """

    low: float
    high: float
    unit: str
    least: float = 0.0
    most: float = math.inf
    why: str = ""

    def complaint(self, place: str, value: float, *, usual: bool, has_unit: bool = False) -> str | None:
        """A sentence about a value out of the usual range, or of the possible one; None within it. One that was written
        without a unit may lack it."""
        low, high, what = (self.low, self.high, "usual") if usual else (self.least, self.most, f"allowed: {self.why}")
        if value == 0.0 or low <= abs(value) <= high:
            return None
        shown, in_degrees = UNITS[self.unit], math.degrees if self.unit == "rad" else float
        read = shown.text(in_degrees(value)) if self.unit == "rad" else f"{value:g} {self.unit}".rstrip()
        least = f"{low * shown.factor:g}" if low else "up"
        advice = "but a hit list is in SI" if place.startswith("hits.file") else "which needs its unit"
        meant = [
            f'; "{value:g} {unit}" was probably meant, {advice}'
            for unit in _LEFT_OUT.get(self.unit, ())
            if not has_unit
            if self.low <= abs(value) * units.factor(unit, self.unit) <= self.high
        ]
        return f"{place}: read as {read}, but {least} to {shown.text(in_degrees(high))} is {what}{''.join(meant[:1])}"


_LEFT_OUT = {
    "m": ("mm", "cm", "um"),
    "kg": ("g", "mg"),
    "kg/m^3": ("g/cm^3",),
    "Pa": ("MPa", "GPa"),
    "s": ("us", "ns"),
    "m/s": ("km/s",),
}
"""Units that may have been left out."""
_MM, _DEG = 1e-3, math.radians(1.0)
_OF_MATTER = "metals have up to 22,600 kg/m^3, and foams from 10 on"


def _length(low: float, high: float, most: float = math.inf, why: str = "") -> Bounds:
    """Bounds given in millimetres."""
    return Bounds(low * _MM, high * _MM, "m", 0.0, most * _MM, why)


USUAL = {
    "core.length": _length(2.0, 300.0, 1_000.0, "the longest rods that guns fire are shorter"),
    "core.diameter": _length(1.0, 60.0, 1_000.0, "no gun has a larger bore"),
    "core.mass": Bounds(5e-5, 1.0, "kg"),
    "core.density": Bounds(500.0, 25_000.0, "kg/m^3", 10.0, 25_000.0, _OF_MATTER),
    "plate.thickness": _length(0.1, 60.0, 1_000.0, "no bullet goes through a metre of anything"),
    "plate.thickness.light": _length(0.1, 100.0, 1_000.0, "no bullet goes through a metre of anything"),
    "plate.size": _length(5.0, 20_000.0, 50_000.0, "no plate is larger; an unbounded one has no size"),
    "plate.resistance": Bounds(1e7, 2e10, "Pa", 2e4, 2e11, "gelatine resists more than the least, diamond less"),
    "plate.shear_coefficient": Bounds(0.0, 1.0, ""),
    "plate.degradation_interval": Bounds(1e-9, 1e-3, "s", 0.0, 0.1, "any passage is over by then"),
    "plate.degradation_length": _length(0.01, 20.0, 100.0, "a core weakens a plate about itself"),
    "plate.density": Bounds(500.0, 25_000.0, "kg/m^3", 10.0, 25_000.0, _OF_MATTER),
    "plate.pattern.cell": _length(0.5, 500.0, 2_000.0, "a plate with its holes as far apart is a solid one to a core"),
    "plate.pattern.ligament": Bounds(0.25e-3, 2.0, "m", 0.05e-3, 2.0, "no tool leaves a thinner one between holes"),
    "plate.pattern.rotation": Bounds(0.0, 360.0 * _DEG, "rad", 0.0, 360.0 * _DEG, "a turn has 360 deg"),
    "layer.gap": _length(0.05, 3_000.0),
    "impact.velocity": Bounds(20.0, 3e3, "m/s", 1.0, 1e4, "a fall from 5 cm is faster, and no gun is as fast"),
    "impact.azimuth": Bounds(0.0, 360.0 * _DEG, "rad"),
    "impact.pitch": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.yaw": Bounds(0.0, 60.0 * _DEG, "rad"),
    "impact.spin": Bounds(0.0, 1e5, "rad/s", 0.0, 1e6, "a core would burst"),
    "output.standoffs": _length(5.0, 100_000.0, 1_000_000.0, "nothing behind a target is as far"),
}
"""Bounds by the place in a campaign. Most quantities have no smallest possible value, since foils, slow cores and
shallow depths may be studied. Listed hits may lie anywhere, since a pattern repeats. Published rows of small arms end
at 31 mm of steel and at 99 mm of aluminium, which is light."""


def hit_bounds(period: tuple[float, float], size: tuple[float, float] | None) -> Bounds:
    """Usual coordinates of listed hits [m]: within a few cells from the origin, or on a finite plate."""
    return _length(0.0, 1e3 * (10.0 * max(period) if size is None else 0.5 * max(size)))
