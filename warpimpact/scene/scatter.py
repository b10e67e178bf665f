"""Scatter: distributions of quantities that differ from shot to shot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import (
    FieldSerializationInfo,
    SerializerFunctionWrapHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_serializer,
    field_validator,
)

from .distributions import PURE_NUMBERS, AnyDistribution, Distribution
from .model import Model
from .quantities import LISTED, QUANTITIES, SCATTERED
from .shots import Shots
from .units import Radians, in_radians, quantity


def check_range(name: str, low: float, high: float) -> None:
    """Refuse a range of a quantity, `low` to `high`, with values that the quantity may not have.

    Raises:
        ValueError: the message has the value that is reached and what is allowed.
    """
    kind = QUANTITIES[name].type
    read = quantity(kind)
    for value in (low, high):
        try:
            TypeAdapter(kind).validate_python(read.as_read(value))
        except ValidationError as error:
            allowed = error.errors()[0]["msg"].replace("Input should", "it must")
            reached = f"{math.degrees(value):.6g} deg" if read.unit == "rad" else f"{value:.6g}"
            raise ValueError(f"reaches {reached}, but {allowed}") from None


def in_si(read: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a distribution in SI; `read` is the reader of its quantity.

    Raises:
        ValueError: the message names the parameter.
    """
    values = {}
    for name, part in given.items():
        try:
            values[name] = part if name in PURE_NUMBERS else _of_each(read, part)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return values


def _of_each(change: Callable[[Any], Any], value: Any) -> Any:
    """The changed value, or a list of the changed values of a list."""
    return [change(number) for number in value] if isinstance(value, list | tuple) else change(value)


_ByLayer = tuple[AnyDistribution | None, ...]


class Scatter(Model):
    """Distributions of the quantities that differ from shot to shot, beside the hit point; None for all others.

    In a campaign file a distribution takes the place of the value:
    ``velocity = { distribution = "normal", mean = "820 m/s", std = "10 m/s" }``.
    A quantity of layers has a distribution or None for each layer; a single distribution is that of the plate.
    """

    velocity: AnyDistribution | None = None
    obliquity: AnyDistribution | None = None
    azimuth: AnyDistribution | None = None
    pitch: AnyDistribution | None = None
    yaw: AnyDistribution | None = None
    spin: AnyDistribution | None = None
    resistance: _ByLayer = ()
    shear_coefficient: _ByLayer = ()
    degradation: _ByLayer = ()
    thickness: _ByLayer = ()
    mass: AnyDistribution | None = None
    strength: AnyDistribution | None = None
    offset_y: _ByLayer = ()
    offset_z: _ByLayer = ()

    @field_validator("*", mode="before")
    @classmethod
    def _in_si(cls, value: Any, info: ValidationInfo) -> Any:
        """Read parameters with the unit of their quantity."""
        known = SCATTERED[str(info.field_name)]
        if known.by_layer and isinstance(value, dict | Distribution):
            value = (value,)
        return _of_each(lambda given: in_si(quantity(known.type), given) if isinstance(given, dict) else given, value)

    @field_validator("*", mode="after")
    @classmethod
    def _is_possible(cls, value: Any, info: ValidationInfo) -> Any:
        for distribution in value if isinstance(value, tuple) else (value,):
            if isinstance(distribution, Distribution):
                try:
                    check_range(str(info.field_name), *distribution.ends)
                except ValueError as error:
                    raise ValueError(f"got a {distribution.distribution} distribution that {error}") from None
        return value

    @field_serializer("*", mode="wrap")
    def _as_read(self, value: Any, write: SerializerFunctionWrapHandler, info: FieldSerializationInfo) -> Any:
        """Write angles in the form in which they are read."""
        written = write(value)
        if not isinstance(written, dict) or quantity(SCATTERED[info.field_name].type).unit != "rad":
            return written
        mark = in_radians if info.mode == "json" else Radians
        return {name: part if name in PURE_NUMBERS else _of_each(mark, part) for name, part in written.items()}

    @field_validator("offset_y", "offset_z")
    @classmethod
    def _of_a_layer(cls, value: _ByLayer) -> _ByLayer:
        if value and value[0] is not None:
            raise ValueError("got a distribution for the plate, but only layers behind it have an offset")
        return value

    @property
    def given(self) -> dict[tuple[str, int], Distribution]:
        """The given distributions by name and layer; the layer is 0, the plate, for quantities of the shot."""
        by_layer = {name: value if isinstance(value := getattr(self, name), tuple) else (value,) for name in SCATTERED}
        return {
            (name, layer): distribution
            for name, layers in by_layer.items()
            for layer, distribution in enumerate(layers)
            if distribution is not None
        }

    @property
    def layers(self) -> int:
        """One more than the number of the last layer with a distribution."""
        return 1 + max((layer for _, layer in self.given), default=0)


assert set(SCATTERED) == set(Scatter.model_fields)
assert {*LISTED, *SCATTERED} == set(Shots.__dataclass_fields__)
