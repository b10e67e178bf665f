"""The quantities of a scene that may differ from shot to shot: where a campaign has them, and what may be done with
them."""

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
    PositiveLength,
    PositiveMass,
    PositiveSpeed,
    PositiveStress,
    Tilt,
)


class Quantity(NamedTuple):
    """A quantity that may differ from shot to shot.

    Attributes:
        table: that of a campaign file which has it; of what layers have, that of the plate.
        type: as it is read.
        by_layer: whether each layer has its own.
    """

    table: str
    type: Any
    by_layer: bool = False


QUANTITIES: Mapping[str, Quantity] = {
    "velocity": Quantity("impact", PositiveSpeed),
    "obliquity": Quantity("impact", Obliquity),
    "azimuth": Quantity("impact", Angle),
    "pitch": Quantity("impact", Tilt),
    "yaw": Quantity("impact", Tilt),
    "spin": Quantity("impact", AngularVelocity),
    "resistance": Quantity("plate", NonNegativeStress, by_layer=True),
    "shear_coefficient": Quantity("plate", NonNegativeNumber, by_layer=True),
    "degradation": Quantity("plate", Annotated[Number, Field(ge=0, le=1)], by_layer=True),
    "thickness": Quantity("plate", PositiveLength, by_layer=True),
    "mass": Quantity("core", PositiveMass),
    "strength": Quantity("core", PositiveStress),
    "offset_y": Quantity("layer", Length, by_layer=True),
    "offset_z": Quantity("layer", Length, by_layer=True),
}
"""By name."""
BY_LAYER = tuple(name for name, quantity in QUANTITIES.items() if quantity.by_layer)
OF_THE_SCENE = tuple(name for name, quantity in QUANTITIES.items() if quantity.table in ("plate", "core"))
"""Quantities of plate and core that may differ from shot to shot."""

_DRAWN = [name for name, quantity in QUANTITIES.items() if quantity.table != "layer"]
_DRAWN_BEHIND = ("thickness", "resistance", "shear_coefficient", "degradation", "offset_y", "offset_z")
DRAWN = len(_DRAWN)
"""Columns of random numbers that all but the layers behind the plate have."""


def drawn_columns(layers: int) -> int:
    """How many columns of random numbers there are for a target of so many layers."""
    return DRAWN + len(_DRAWN_BEHIND) * (layers - 1)


def drawn_column(name: str, layer: int = 0) -> int:
    """The column of random numbers of a quantity. So its draws do not depend on which other quantities scatter."""
    return drawn_columns(layer) + _DRAWN_BEHIND.index(name) if layer else _DRAWN.index(name)
