"""The quantities of a scene that may differ from shot to shot: their place in a campaign, their type, and their uses.

Units are in units.py. These and all other values of a campaign may be swept.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from . import units


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
    "degradation_length": Quantity("plate", units.PositiveLength, "length within which it weakens", scatters=False),
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
