"""Scatter: distributions of quantities that differ from shot to shot, from scipy.stats.

Long because every distribution, and every quantity that may scatter, stands here once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import (
    Field,
    FieldSerializationInfo,
    SerializerFunctionWrapHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_serializer,
    field_validator,
)

from .distributions import EDGE, PURE_NUMBERS, AnyDistribution, Distribution
from .model import Model
from .shots import OF_A_BURST, Obliquity, Shots, Tilt
from .units import (
    Angle,
    AngularVelocity,
    Length,
    NonNegativeNumber,
    NonNegativeStress,
    Number,
    PositiveLength,
    PositiveMass,
    PositiveSpeed,
    PositiveStress,
    Radians,
    in_radians,
    quantity,
)


class Quantity(NamedTuple):
    """A quantity that may scatter: its table in a campaign file, and its type."""

    table: str
    type: Any


QUANTITIES = {
    "velocity": Quantity("impact", PositiveSpeed),
    "obliquity": Quantity("impact", Obliquity),
    "azimuth": Quantity("impact", Angle),
    "pitch": Quantity("impact", Tilt),
    "yaw": Quantity("impact", Tilt),
    "spin": Quantity("impact", AngularVelocity),
    "resistance": Quantity("plate", NonNegativeStress),
    "shear_coefficient": Quantity("plate", NonNegativeNumber),
    "degradation": Quantity("plate", Annotated[Number, Field(ge=0, le=1)]),
    "thickness": Quantity("plate", PositiveLength),
    "mass": Quantity("core", PositiveMass),
    "strength": Quantity("core", PositiveStress),
}
"""By name. The position in this table is the column of the random numbers. So the draws of a quantity do not depend on
which other quantities scatter."""
OF_A_LAYER = {
    "thickness": Quantity("layer", PositiveLength),
    "resistance": Quantity("layer", NonNegativeStress),
    "shear_coefficient": Quantity("layer", NonNegativeNumber),
    "degradation": Quantity("layer", Annotated[Number, Field(ge=0, le=1)]),
    "offset_y": Quantity("layer", Length),
    "offset_z": Quantity("layer", Length),
}
"""Quantities of each layer behind the plate, likewise: their columns follow, layer by layer."""
OF_THE_SCENE = tuple(name for name, quantity in QUANTITIES.items() if quantity.table != "impact")
"""Quantities of plate and core that may differ from shot to shot."""


def check_range(name: str, low: float, high: float, known: Mapping[str, Quantity] = QUANTITIES) -> None:
    """Refuse a range of a quantity, `low` to `high`, that contains values which are not allowed.

    Raises:
        ValueError: says what was reached and what is allowed.
    """
    read = quantity(known[name].type)
    for value in (low, high):
        try:
            TypeAdapter(known[name].type).validate_python(read.as_read(float(value)))
        except ValidationError as error:
            allowed = error.errors()[0]["msg"].replace("Input should", "it must")
            reached = f"{math.degrees(value):.6g} deg" if read.unit == "rad" else f"{value:.6g}"
            raise ValueError(f"reaches {reached}, but {allowed}") from None


class Scattering(Model):
    """Distributions of quantities; None does not differ from shot to shot."""

    _quantities: ClassVar[Mapping[str, Quantity]]

    @field_validator("*", mode="before")
    @classmethod
    def _in_si(cls, value: Any, info: ValidationInfo) -> Any:
        """Parameters may have units of their quantity."""
        assert info.field_name is not None
        if not isinstance(value, dict) or info.field_name not in cls._quantities:
            return value
        read = quantity(cls._quantities[info.field_name].type)
        return {name: part if name in PURE_NUMBERS else _read(read, name, part) for name, part in value.items()}

    @field_validator("*", mode="after")
    @classmethod
    def _is_possible(cls, value: Any, info: ValidationInfo) -> Any:
        assert info.field_name is not None
        if isinstance(value, Distribution):
            low, high = value.quantile(np.array([EDGE, 1.0 - EDGE]))
            try:
                check_range(info.field_name, low, high, cls._quantities)
            except ValueError as error:
                raise ValueError(f"got a {value.distribution} distribution that {error}") from None
        return value

    @field_serializer("*", mode="wrap")
    def _as_read(self, value: Any, write: SerializerFunctionWrapHandler, info: FieldSerializationInfo) -> Any:
        """Angles as they are read again."""
        written = write(value)
        known = self._quantities.get(info.field_name)
        if not isinstance(written, dict) or known is None or quantity(known.type).unit != "rad":
            return written
        mark = in_radians if info.mode == "json" else Radians
        return {name: part if name in PURE_NUMBERS else _marked(part, mark) for name, part in written.items()}

    @property
    def given(self) -> dict[str, Distribution]:
        """The distributions that are given, by name."""
        return {name: value for name in self._quantities if (value := getattr(self, name)) is not None}


class LayerScatter(Scattering):
    """Distributions of the quantities of one layer that differ from shot to shot; None does not differ."""

    _quantities = OF_A_LAYER

    thickness: AnyDistribution | None = None
    resistance: AnyDistribution | None = None
    shear_coefficient: AnyDistribution | None = None
    degradation: AnyDistribution | None = None
    offset_y: AnyDistribution | None = None
    offset_z: AnyDistribution | None = None


class Scatter(Scattering):
    """Distributions of the quantities that differ from shot to shot, beside the hit point; None does not differ.

    In a campaign file a distribution takes the place of the value:
    ``velocity = { distribution = "normal", mean = "820 m/s", std = "10 m/s" }``.

    Attributes:
        layers: of the layers behind the plate, in order; empty if none of them differs.
    """

    _quantities = QUANTITIES

    velocity: AnyDistribution | None = None
    obliquity: AnyDistribution | None = None
    azimuth: AnyDistribution | None = None
    pitch: AnyDistribution | None = None
    yaw: AnyDistribution | None = None
    spin: AnyDistribution | None = None
    resistance: AnyDistribution | None = None
    shear_coefficient: AnyDistribution | None = None
    degradation: AnyDistribution | None = None
    thickness: AnyDistribution | None = None
    mass: AnyDistribution | None = None
    strength: AnyDistribution | None = None
    layers: tuple[LayerScatter, ...] = ()

    @property
    def of_layers(self) -> dict[tuple[str, int], Distribution]:
        """The distributions of layers, by name and number of the layer behind the plate."""
        return {(name, k): one for k, layer in enumerate(self.layers) for name, one in layer.given.items()}


def _marked(value: Any, mark: Callable[[float], Any]) -> Any:
    return [mark(one) for one in value] if isinstance(value, list | tuple) else mark(value)


def _read(read: Any, name: str, value: Any) -> Any:
    try:
        return [read(one) for one in value] if isinstance(value, list | tuple) else read(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


assert set(QUANTITIES) == set(Scatter.model_fields) - {"layers"}
assert {"hit_y", "hit_z", *QUANTITIES, *OF_A_BURST, *(f"layer_{name}" for name in OF_A_LAYER)} == set(
    Shots.__dataclass_fields__
)
