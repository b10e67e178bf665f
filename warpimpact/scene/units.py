"""Quantities: a number is SI, an angle's degrees, a string carries its unit; inside there are only SI and radians.

The units are those of the trade. Libraries of units know thousands more, read names that mean two things here (mil,
grad, gr, ton) as one of them, and multiply all numbers of a text. An angle is a dimension, so neither a ratio nor a
frequency passes for one.
"""

import json
import math
import operator
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, get_args, get_origin

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, WithJsonSchema
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

_BASES = ("m", "kg", "s", "rad")
_NAMED = {
    "cc": "0.000001 m^3",
    "in": "0.0254 m",
    "thou": "0.0000254 m",
    "ft": "0.3048 m",
    "yd": "0.9144 m",
    "g": "0.001 kg",
    "t": "1000 kg",
    "lb": "0.45359237 kg",
    "oz": "0.028349523125 kg",
    "grain": "0.00006479891 kg",
    "min": "60 s",
    "h": "3600 s",
    "Hz": "1 s^-1",
    "deg": "0.017453292519943295 rad",
    "gon": "0.015707963267948967 rad",
    "arcmin": "0.0002908882086657216 rad",
    "arcsec": "0.00000484813681109536 rad",
    "nato_mil": "0.0009817477042468104 rad",
    "turn": "6.283185307179586 rad",
    "rpm": "0.10471975511965977 rad/s",
    "rps": "1 turn/s",
    "N": "1 kg m/s^2",
    "Nm": "1 N m",
    "kgf": "9.80665 N",
    "lbf": "4.4482216152605 N",
    "Pa": "1 N/m^2",
    "bar": "100000 Pa",
    "psi": "6894.757293168361 Pa",
    "ksi": "6894757.293168361 Pa",
    "J": "1 N m",
    "kmh": "1000 m/h",
    "mph": "1609.344 m/h",
    "fps": "0.3048 m/s",
}
_PREFIXES = {"n": "1e-9", "µ": "1e-6", "m": "1e-3", "c": "1e-2", "k": "1e3", "M": "1e6", "G": "1e9"}
_PREFIXED = {"m": "nµmck", "g": "m", "s": "nµm", "rad": "m", "N": "k", "Pa": "kMG", "J": "mkM", "Hz": "k"}
_UNITS = _NAMED | {f"{p}{unit}": f"{_PREFIXES[p]} {unit}" for unit, prefixes in _PREFIXED.items() for p in prefixes}
"""Units of the trade, each by others."""
_SPELLINGS = (
    {"um": "µm", "micron": "µm", "microns": "µm", "us": "µs", "sec": "s", "msec": "ms", "usec": "µs", "hr": "h"}
    | {"metre": "m", "metres": "m", "meter": "m", "meters": "m", "millimetre": "mm", "millimetres": "mm"}
    | {"millimeter": "mm", "millimeters": "mm", "inch": "in", "inches": "in", "foot": "ft", "feet": "ft"}
    | {"gram": "g", "grams": "g", "gramme": "g", "grammes": "g", "kilogram": "kg", "kilograms": "kg"}
    | {"tonne": "t", "tonnes": "t", "lbs": "lb", "pound": "lb", "pounds": "lb", "grains": "grain"}
    | {"second": "s", "seconds": "s", "minute": "min", "minutes": "min", "hour": "h", "hours": "h"}
    | {"radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "°": "deg", "moa": "arcmin"}
    | {"MOA": "arcmin", "rev": "turn", "revs": "turn", "turns": "turn", "kph": "kmh"}
)
"""Other spellings, and the unit of each."""
_AMBIGUOUS = {
    "mil": 'is an angle or a thousandth of an inch: write "nato_mil" (6400 to a turn), "mrad", or "thou"',
    "grad": 'is gon in some countries and degrees in others: write "gon" (400 to a turn) or "deg"',
    "gr": 'is grains to some and grams to others: write "grain" or "g"',
    "ton": 'is 907, 1000 or 1016 kg: write "t" for 1000 kg, or kg',
}
"""Names that mean two things to those who type them, in small letters and without an ending of e, i, o or s."""

_SCATTERS = re.compile(r"±|\+\s*/?\s*-|[0-9]\s*(?:\.\.|…)\s*[0-9]")
_NUMBER = re.compile(
    r"[-+]?(?:(?P<above>[0-9]+)\s*/\s*(?P<below>[0-9]+)(?![0-9.,])|(?:[0-9]+(?:\.[0-9]*|,[0-9]+)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
)
THOUSANDS = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")
_FACTOR = re.compile(
    r"\s*(?:(?P<plain>1(?=\s*/)|\((?!\s*\)))|(?:(?P<close>\))|(?P<name>(?:[^\W\d]|°)++))"
    r"(?:\s*(?:\^|\*\*)\s*(?P<power>[-+]?[0-9]|\([-+]?[0-9]\))|(?P<attached>[-+]?[0-9]))?(?![0-9.,^]))"
    r"\s*(?P<operator>\*(?!\*)|[/·⋅×])?"
)
"""A factor of a unit, and the operator behind it: 1 before a quotient, a parenthesis, or a name with its power."""
_AS_TYPED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−μº˚", "-0123456789-µ°°")


class UnitError(ValueError):
    """A text that is no quantity; the message continues "got …, "."""


def number_and_unit(text: str) -> tuple[float, str]:
    """The number at the start of a text, and the unit behind it.

    Raises:
        UnitError: there is no number, it is ambiguous, or it scatters.
    """
    text = text.strip().translate(_AS_TYPED)
    if _SCATTERS.search(text):
        raise UnitError('which scatters; write a distribution: { distribution = "normal", mean = …, std = … }')
    match = _NUMBER.match(text)
    if match is None:
        raise UnitError("which does not begin with a number")
    if THOUSANDS.fullmatch(match[0]):
        raise UnitError("whose comma may stand for thousands or decimals; write a point for decimals, and no thousands")
    if match["below"] is not None:
        if int(match["below"]) == 0:
            raise UnitError("which divides by zero")
        return float(Fraction(match[0].replace(" ", ""))), text[match.end() :].strip()
    return float(match[0].replace(",", ".")), text[match.end() :].strip()


@cache
def factor(unit: str, si_unit: str) -> float:
    """Factor from a unit to an SI unit; "" is the unit of a plain number.

    Raises:
        UnitError: the unit is unknown, ambiguous or of another quantity.
    """
    if unit in ("%", "percent"):  # alone, and of a plain number: "2 mm %" is a slip
        if si_unit:
            raise UnitError("")
        return 0.01
    (size, powers), (si_size, si_powers) = _evaluated(unit), _evaluated(si_unit)
    if powers != si_powers:
        is_frequency = si_unit == "rad/s" and powers == _evaluated("Hz")[1]
        raise UnitError("which is a frequency; write turn/s, rpm or rad/s" if is_frequency else "")
    return float(size / si_size)


_Unit = tuple[Fraction, tuple[int, ...]]
"""A size in SI, and the powers of the base units."""
_ONE: _Unit = Fraction(1), (0,) * len(_BASES)


def _evaluated(text: str) -> _Unit:
    """A unit of names, powers, products, quotients and parentheses."""
    malformed = UnitError(f'whose unit "{text}" is not one of names, powers, * and /')
    outer: list[tuple[_Unit, int]] = []
    value, sign, place, operator = _ONE, 1, 0, None
    while place < len(text):
        match = _FACTOR.match(text, place)
        if match is None or (match["close"] and not outer):
            raise malformed
        place, operator = match.end(), match["operator"]
        if match["plain"] == "(":
            outer.append((value, sign))
            value, sign = _ONE, 1
            continue
        factor = _unit(match["name"]) if match["name"] else _ONE
        if match["close"]:
            factor, (value, sign) = value, outer.pop()
        power = sign * int((match["power"] or match["attached"] or "1").strip("()"))
        value = value[0] * factor[0] ** power, tuple(p + power * q for p, q in zip(value[1], factor[1], strict=True))
        sign = -1 if operator == "/" else 1
    if outer or operator:
        raise malformed
    return value


@cache
def _unit(name: str) -> _Unit:
    """The unit of one of its spellings."""
    known = _SPELLINGS.get(name, name)
    if known in _BASES:
        return Fraction(1), tuple(int(base == known) for base in _BASES)
    if known in _UNITS:
        number, _, rest = _UNITS[known].partition(" ")
        size, powers = _evaluated(rest)
        return Fraction(number) * size, powers
    if reason := _AMBIGUOUS.get(name.lower().rstrip("eios")):
        raise UnitError(f'whose unit "{name}" {reason}')
    spellings = [*_BASES, *_UNITS, *_SPELLINGS]
    close = [one for one in spellings if one.lower() == name.lower()]
    close += get_close_matches(name, [one for one in spellings if len(one) > 2], n=1, cutoff=0.8)
    raise UnitError(f'whose unit "{name}" is unknown' + (f'; did you mean "{close[0]}"?' if close else ""))


MM = 1e3
"""Millimetres in a metre."""


@dataclass(frozen=True)
class Unit:
    """How a result stores a quantity, and how people see it.

    Attributes:
        stored: unit in the form of the CF conventions.
        shown: unit as people write it.
        factor: factor from the stored to the shown value.
    """

    stored: str
    shown: str
    factor: float = 1.0

    @property
    def suffix(self) -> str:
        """The unit behind a number."""
        return self.shown if self.shown in ("", "°") else f" {self.shown}"

    def text(self, value: float, form: str = "g") -> str:
        """A stored value with its unit."""
        return f"{self.factor * value:{form}}{self.suffix}"


UNITS = {
    "": Unit("1", ""),
    "m": Unit("m", "mm", 1e3),
    "kg": Unit("kg", "g", 1e3),
    "s": Unit("s", "µs", 1e6),
    "Pa": Unit("Pa", "GPa", 1e-9),
    "N m": Unit("N m", "N m"),
    "J": Unit("J", "J"),
    "kg m^2": Unit("kg m2", "kg m²"),
    "kg/m^3": Unit("kg m-3", "kg/m³"),
    "kg/m^2": Unit("kg m-2", "kg/m²"),
    "J/m^2": Unit("J m-2", "J/mm²", 1e-6),
    "m/s": Unit("m s-1", "m/s"),
    "rad": Unit("degree", "°"),
    "rad/s": Unit("rad s-1", "rad/s"),
}
"""Units by the SI unit in which a quantity is computed."""
STORED = {unit.stored: unit for unit in UNITS.values()}
"""Units by the unit in a result."""


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


class Radians(float):
    """An angle that was read [rad]; it is not converted again, unlike plain numbers, which are degrees.

    Sums, differences, and products and quotients with numbers are `Radians`, too: half an `impact.obliquity` is half
    the angle in any field. Added numbers are radians.
    """

    __array_priority__ = 1000.0  # numpy's numbers then use the operators of this class

    def __round__(self, digits: int | None = None) -> Any:  # type: ignore[override]  # a float would lose the unit
        return Radians(round(float(self), digits))


def _of_angles(name: str) -> Callable[..., Any]:
    """An operator that gives an angle, unless it divides two of them or has an array."""
    operate = getattr(operator, name.removeprefix("r"))

    def applied(angle: Radians, *others: Any) -> Any:
        value = operate(*others, float(angle)) if name.startswith("r") else operate(float(angle), *others)
        is_ratio = name == "truediv" and isinstance(others[0], Radians)
        return Radians(value) if isinstance(value, Real) and not is_ratio else value

    return applied


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "neg", "abs"):
    setattr(Radians, f"__{_name}__", _of_angles(_name))


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
        try:
            return self.as_read(self._number(value))
        except UnitError as error:
            unit = "deg" if self.unit == "rad" else self.unit
            raise ValueError(
                f"got {quoted(value)}, {str(error) or f'which is not {self.name}'}; "
                f'give a number{f" in {unit}" if unit else ""} or a string such as "{self.example}"'
            ) from None

    def _number(self, value: object) -> float:
        if isinstance(value, str):
            if len(value) > MOST_QUOTED:
                raise UnitError(f"which has more than {MOST_QUOTED} characters")
            number, unit = number_and_unit(value)
            if self.unit and not unit:
                raise UnitError("which has no unit")
            number *= factor(unit, self.unit)
        elif isinstance(value, Real) and not isinstance(value, bool):
            in_degrees = self.unit == "rad" and not isinstance(value, Radians)
            number = math.radians(float_of(value)) if in_degrees else float_of(value)
        else:
            raise UnitError
        if not math.isfinite(number):
            raise UnitError("which is not finite")
        if abs(number) > LARGEST:
            raise UnitError(f"which is more than {LARGEST:g}")
        return number

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


def float_of(value: Real | float | str) -> float:
    """A number as a float; infinite if it is too large for one."""
    try:
        return float(value)
    except OverflowError:  # of an integer with more than 308 digits
        return math.inf


def hint(name: str, allowed: Iterable[str]) -> str:
    """What an unknown name probably means, or what is allowed in its place."""
    known = list(allowed)
    close = get_close_matches(name[:MOST_QUOTED], known, n=1)
    return f'did you mean "{close[0]}"?' if close else f"allowed are {', '.join(known)}"


def shorten(text: str, most: int = MOST_QUOTED) -> str:
    """A text, cut to the length that messages quote."""
    return text if len(text) <= most else f"{text[: MOST_QUOTED - 1]}…"


def count_text(count: int, noun: str) -> str:
    """A number of things, such as "1 hit" and "2 hits"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def list_text(parts: Sequence[str], conjunction: str = "and") -> str:
    """Text such as "a, b and c"."""
    return f" {conjunction} ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def quoted(value: object) -> str:
    """A value as JSON, which equals TOML except for dates, cut to the length that messages quote."""
    try:
        return shorten(json.dumps(value, ensure_ascii=False, default=str))
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


def duration_text(seconds: float) -> str:
    """A duration in two digits and the largest unit of which it has two."""
    longer = {"years": 365.25 * 86400.0, "days": 86400.0, "h": 3600.0, "min": 60.0}
    unit, length = next(((unit, length) for unit, length in longer.items() if seconds >= 2.0 * length), ("s", 1.0))
    return f"{float(f'{seconds / length:.2g}'):,g} {unit}"


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


def _within(is_allowed: Callable[[float], bool], allowed: str) -> AfterValidator:
    """A range of angles, which the message has in degrees."""

    def check(angle: float) -> float:
        if not is_allowed(angle):
            raise PydanticCustomError("angle", f"Input should be {allowed} 90 deg")
        return angle

    return AfterValidator(check)


Obliquity = Annotated[
    Angle,
    _within(lambda angle: 0.0 <= angle < RIGHT_ANGLE, "at least 0 and less than"),
    Field(json_schema_extra={"minimum": 0, "exclusiveMaximum": 90}),
]
Tilt = Annotated[
    Angle,
    _within(lambda angle: abs(angle) < RIGHT_ANGLE, "greater than -90 and less than"),
    Field(json_schema_extra={"exclusiveMinimum": -90, "exclusiveMaximum": 90}),
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
