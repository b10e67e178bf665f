"""The quantities of a scene that something is done with: where a campaign has them, how they are read, and what may be
done with each. Their units are in units.py.

Any of them, and all else that a campaign has, may be swept.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from .units import (
    Angle,
    AngularVelocity,
    Length,
    NonNegativeNumber,
    NonNegativeStress,
    Number,
    Obliquity,
    PositiveDensity,
    PositiveLength,
    PositiveMass,
    PositiveSpeed,
    PositiveStress,
    PositiveTime,
    Tilt,
)


class Quantity(NamedTuple):
    """A quantity of a scene.

    Attributes:
        table: that of a campaign file which has it; of what layers have, that of the plate.
        type: as it is read.
        meaning: long name of its column in a result.
        by_layer: whether each layer has its own.
        scatters: whether it may have a distribution, and so differ from shot to shot.
        listed: whether a list of hits may have it.
        drawn: whether it may be drawn from a posterior.
        column: name of its column in a result, where it is not its own.
    """

    table: str
    type: Any
    meaning: str = ""
    by_layer: bool = False
    scatters: bool = True
    listed: bool = True
    drawn: bool = False
    column: str | None = None


def _of_material(table: str, kind: Any) -> Quantity:
    """What only a posterior gives shot by shot."""
    return Quantity(table, kind, scatters=False, listed=False, drawn=True)


QUANTITIES: Mapping[str, Quantity] = {
    "hit_y": Quantity("hits", Length, "hit point on the front face, y", scatters=False),
    "hit_z": Quantity("hits", Length, "hit point on the front face, z", scatters=False),
    "velocity": Quantity("impact", PositiveSpeed, "impact velocity", column="impact_velocity"),
    "obliquity": Quantity("impact", Obliquity, "angle between line of fire and plate normal"),
    "azimuth": Quantity("impact", Angle, "direction of the obliquity, from +y towards +z"),
    "pitch": Quantity(
        "impact", Tilt, "pitch of the core on impact, relative to the line of fire", column="impact_pitch"
    ),
    "yaw": Quantity("impact", Tilt, "yaw of the core on impact, relative to the line of fire", column="impact_yaw"),
    "spin": Quantity("impact", AngularVelocity, "spin of the core about its axis on impact"),
    "resistance": Quantity("plate", NonNegativeStress, "resistance", by_layer=True, drawn=True),
    "shear_coefficient": Quantity("plate", NonNegativeNumber, "friction per normal stress", by_layer=True, drawn=True),
    "degradation": Quantity(
        "plate",
        Annotated[Number, Field(ge=0, le=1)],
        "share that an interval of contact leaves of the resistance",
        by_layer=True,
        drawn=True,
    ),
    "thickness": Quantity("plate", PositiveLength, "thickness", by_layer=True),
    "mass": Quantity("core", PositiveMass, "mass of the core"),
    "strength": Quantity("core", PositiveStress, "strength of the core, a nominal bending stress"),
    "offset_y": Quantity(
        "layer", Length, "place of its origin in the plane of the plate, y", by_layer=True, listed=False
    ),
    "offset_z": Quantity(
        "layer", Length, "place of its origin in the plane of the plate, z", by_layer=True, listed=False
    ),
    "degradation_interval": _of_material("plate", PositiveTime),
    "degradation_distance": _of_material("plate", PositiveLength),
    "degradation_length": _of_material("plate", PositiveLength),
    "degradation_depth": _of_material("plate", PositiveLength),
    "density": Quantity("plate", PositiveDensity, scatters=False, listed=False),
    "static": _of_material("interaction", NonNegativeNumber),
    "linear": _of_material("interaction", NonNegativeNumber),
    "quadratic": _of_material("interaction", NonNegativeNumber),
    "onset": _of_material("interaction", NonNegativeNumber),
}
"""By name."""
SCATTERED = {name: quantity for name, quantity in QUANTITIES.items() if quantity.scatters}
LISTED = tuple(name for name, quantity in QUANTITIES.items() if quantity.listed)
BY_LAYER = tuple(name for name, quantity in QUANTITIES.items() if quantity.by_layer)
OF_THE_SCENE = tuple(name for name, quantity in SCATTERED.items() if quantity.table in ("plate", "core"))
"""Quantities of plate and core that may differ from shot to shot."""
OF_A_DRAW = ("degradation_length", "degradation_depth", "static", "linear", "quadratic", "onset")
"""Quantities of plate and interaction that a shot has of its own only where a posterior draws them. A unit of exposure
becomes a degradation."""

_IN_FRONT = [name for name, quantity in SCATTERED.items() if quantity.table != "layer"]
_BEHIND = ("thickness", "resistance", "shear_coefficient", "degradation", "offset_y", "offset_z")
DRAWN = len(_IN_FRONT)
"""Columns of random numbers that all but the layers behind the plate have."""


def drawn_columns(layers: int) -> int:
    """How many columns of random numbers there are for a target of so many layers."""
    return DRAWN + len(_BEHIND) * (layers - 1)


def drawn_column(name: str, layer: int = 0) -> int:
    """The column of random numbers of a quantity. So its draws do not depend on which other quantities scatter."""
    return drawn_columns(layer) + _BEHIND.index(name) if layer else _IN_FRONT.index(name)
