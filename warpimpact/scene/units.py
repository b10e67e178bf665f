"""Quantities: a number is SI, an angle's degrees, a string carries its unit; inside there are only SI and radians."""

import json
import math
import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, get_args, get_origin

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, WithJsonSchema
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from .display import UNITS, Unit
from .unit_text import UnitError, factor, number_and_unit

MOST_QUOTED = 80
"""Largest number of characters of input in a message, and of a number with its unit."""
LARGEST = 1e30
"""Largest quantity in SI; results such as a volume then stay finite."""
RIGHT_ANGLE = math.pi / 2
_STRING = r"^\s*[-+−]?[\d.,]+"
"""Strings that editors accept, in the dialect of JSON schemas; only the reader knows the units."""

if TYPE_CHECKING:
    Read: TypeAlias = float | Any  # what a field holds, or what is read into it: a string with a unit, above all
else:
    Read = float


def _of_angles(operate: Callable[[float, Any], Any], *, with_angles: bool) -> Any:
    """An operator whose number is an angle, with another angle only if `with_angles`."""

    def applied(angle: "Radians", other: Any) -> Any:
        value = operate(float(angle), other)
        is_angle = isinstance(value, Real) and (with_angles or not isinstance(other, Radians))
        return Radians(value) if is_angle else value

    return applied


class Radians(float):
    """An angle that was read [rad]; it is not converted again, unlike plain numbers, which are degrees.

    Sums, differences, and products and quotients with numbers are `Radians`, too: half an `impact.obliquity` is half
    the angle in any field. Added numbers are radians.
    """

    __array_priority__ = 1000.0  # numpy's numbers then use the operators of this class
    __add__ = __radd__ = _of_angles(operator.add, with_angles=True)
    __sub__ = _of_angles(operator.sub, with_angles=True)
    __rsub__ = _of_angles(lambda angle, other: other - angle, with_angles=True)
    __mul__ = __rmul__ = _of_angles(operator.mul, with_angles=False)
    __truediv__ = _of_angles(operator.truediv, with_angles=False)

    def __neg__(self) -> "Radians":
        return Radians(-float(self))

    def __abs__(self) -> "Radians":
        return Radians(abs(float(self)))

    def __round__(self, digits: int | None = None) -> Any:  # type: ignore[override]  # a float would lose the unit
        return Radians(round(float(self), digits))


@dataclass(frozen=True)
class _Quantity:
    """Reader of one physical quantity.

    Attributes:
        name: in words, with its article.
        unit: SI unit of the result; empty for a plain number.
        example: an accepted string.
    """

    name: str
    unit: str
    example: str

    def __call__(self, value: object) -> float:
        """SI value of a number or of a string with a unit.

        Raises:
            ValueError: the message says what is allowed.
        """
        if isinstance(value, str):
            number = self._from_text(value)
        elif isinstance(value, Real) and not isinstance(value, bool):
            in_degrees = self.unit == "rad" and not isinstance(value, Radians)
            number = math.radians(float_of(value)) if in_degrees else float_of(value)
        else:
            raise self._error(value, f"which is not {self.name}")
        if not math.isfinite(number):
            raise self._error(value, "which is not finite")
        if abs(number) > LARGEST:
            raise self._error(value, f"which is more than {LARGEST:g}")
        return self.as_read(number)

    def as_read(self, number: float) -> float:
        """A number in SI as a value that the reader does not convert."""
        return Radians(number) if self.unit == "rad" else number

    @property
    def display(self) -> Unit:
        """Stored and shown unit."""
        return UNITS[self.unit]

    def text(self, value: float) -> str:
        """A value in SI as text."""
        return self.display.text(math.degrees(value) if self.unit == "rad" else value)

    def _from_text(self, text: str) -> float:
        if len(text) > MOST_QUOTED:
            raise self._error(text, f"which has more than {MOST_QUOTED} characters")
        try:
            number, unit = number_and_unit(text)
            if self.unit and not unit:
                raise UnitError("which has no unit")
            return number * factor(unit, self.unit)
        except UnitError as error:
            raise self._error(text, str(error) or f"which is not {self.name}") from None

    def _error(self, value: object, complaint: str) -> ValueError:
        unit = "deg" if self.unit == "rad" else self.unit
        in_unit = f" in {unit}" if unit else ""
        return ValueError(
            f'got {quoted(value)}, {complaint}; give a number{in_unit} or a string such as "{self.example}"'
        )


def float_of(value: Real | float | str) -> float:
    """A number as a float; infinite if it is too large for one."""
    try:
        return float(value)
    except OverflowError:  # of an integer with more than 308 digits
        return math.inf


def meant(name: str, allowed: Iterable[str]) -> str:
    """What an unknown name probably means, or what is allowed in its place."""
    known = list(allowed)
    close = get_close_matches(name[:MOST_QUOTED], known, n=1)
    return f'did you mean "{close[0]}"?' if close else f"allowed are {', '.join(known)}"


def brief(text: str, most: int = MOST_QUOTED) -> str:
    """A text, cut to the length that messages quote."""
    return text if len(text) <= most else f"{text[: MOST_QUOTED - 1]}…"


def quoted(value: object) -> str:
    """A value as JSON, which equals TOML except for dates, cut to the length that messages quote."""
    try:
        return brief(json.dumps(value, ensure_ascii=False, default=str))
    except (TypeError, ValueError, RecursionError):  # keys of any class, thousands of digits, or nested too deep
        return f"a value of class {type(value).__name__}"


def _quantity(name: str, unit: str, example: str) -> BeforeValidator:
    """The reader of a quantity, with its JSON schema."""
    schema = {"type": ["number", "string", "object"], "pattern": _STRING, "examples": [example]}
    if unit:
        schema["unit"] = "deg" if unit == "rad" else unit
    return BeforeValidator(
        _Quantity(name, unit, example), json_schema_input_type=Annotated[float | str, WithJsonSchema(schema)]
    )


def in_radians(value: float) -> str:
    """An angle [rad] as a string that keeps every bit."""
    return f"{float(value)!r} rad"


def quantity(kind: Any) -> _Quantity:
    """The reader of one of the types below, or of a type that contains it."""
    reader = reader_in(kind)
    assert reader is not None, kind
    return reader


def reader_in(kind: Any) -> _Quantity | None:
    """The reader of the quantity in a type such as `PositiveLength | None`; None without a quantity or with a tuple."""
    for mark in getattr(kind, "__metadata__", ()):
        if isinstance(mark, BeforeValidator) and isinstance(mark.func, _Quantity):
            return mark.func
    if get_origin(kind) is tuple:
        return None
    return next((reader for part in get_args(kind) if (reader := reader_in(part)) is not None), None)


def typed(field: FieldInfo) -> Any:
    """The type of a field of a model, with its metadata."""
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def _is_printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError(f"got {quoted(text)}, but it must be one line without control characters")
    return text


def _whole(value: object) -> object:
    return int(value) if isinstance(value, float) and value.is_integer() else value


Title = Annotated[str, Field(max_length=200), AfterValidator(_is_printable)]
"""One line that figures and terminals show."""
Whole = Annotated[int, BeforeValidator(_whole), Field(strict=True)]
"""A whole number; TOML reads 1e4 as a float."""
Number = Annotated[Read, _quantity("a number", "", "0.05")]
Length = Annotated[Read, _quantity("a length", "m", "4 mm")]
Mass = Annotated[Read, _quantity("a mass", "kg", "4 g")]
Time = Annotated[Read, _quantity("a time", "s", "1 us")]
Stress = Annotated[Read, _quantity("a stress", "Pa", "2600 MPa")]
Moment = Annotated[Read, _quantity("a moment", "N m", "50 N m")]
Density = Annotated[Read, _quantity("a density", "kg/m^3", "7850 kg/m^3")]
ArealDensity = Annotated[Read, _quantity("an areal density", "kg/m^2", "31.4 kg/m^2")]
Speed = Annotated[Read, _quantity("a speed", "m/s", "825 m/s")]
Angle = Annotated[
    Read,
    _quantity("an angle", "rad", "20 deg"),
    AfterValidator(Radians),
    PlainSerializer(in_radians, return_type=str, when_used="json"),
]
"""A plain number is in degrees. The field holds radians, and JSON says so."""


def _is_obliquity(angle: float) -> float:
    if not 0.0 <= angle < RIGHT_ANGLE:
        raise PydanticCustomError("obliquity", "Input should be at least 0 and less than 90 deg")
    return angle


def _is_tilt(angle: float) -> float:
    if not abs(angle) < RIGHT_ANGLE:
        raise PydanticCustomError("tilt", "Input should be greater than -90 and less than 90 deg")
    return angle


Obliquity = Annotated[
    Angle, AfterValidator(_is_obliquity), Field(json_schema_extra={"minimum": 0, "exclusiveMaximum": 90})
]
Tilt = Annotated[
    Angle, AfterValidator(_is_tilt), Field(json_schema_extra={"exclusiveMinimum": -90, "exclusiveMaximum": 90})
]
AngularVelocity = Annotated[Read, _quantity("an angular velocity", "rad/s", "17000 rad/s")]
Energy = Annotated[Read, _quantity("an energy", "J", "10 J")]
EnergyDensity = Annotated[Read, _quantity("an energy per area", "J/m^2", "5 J/mm^2")]
Inertia = Annotated[Read, _quantity("a moment of inertia", "kg m^2", "1.5e-8 kg m^2")]

PositiveLength = Annotated[Length, Field(gt=0)]
NonNegativeLength = Annotated[Length, Field(ge=0)]
PositiveMass = Annotated[Mass, Field(gt=0)]
PositiveTime = Annotated[Time, Field(gt=0)]
PositiveDensity = Annotated[Density, Field(gt=0)]
PositiveArealDensity = Annotated[ArealDensity, Field(gt=0)]
PositiveAngle = Annotated[Angle, Field(gt=0)]
PositiveSpeed = Annotated[Speed, Field(gt=0)]
PositiveInertia = Annotated[Inertia, Field(gt=0)]
PositiveStress = Annotated[Stress, Field(gt=0)]
NonNegativeNumber = Annotated[Number, Field(ge=0)]
PositiveNumber = Annotated[Number, Field(gt=0)]
NonNegativeStress = Annotated[Stress, Field(ge=0)]
