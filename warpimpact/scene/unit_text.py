"""Texts such as "4 mm" or "7850 kg/m^3": one number and one unit, to a number in SI.

The units are those of the trade. Libraries of units know thousands more, read names that mean two things here (mil,
grad, gr, ton) as one of them, and multiply all numbers of a text. An angle is a dimension, so neither a ratio nor a
frequency passes for one.
"""

import re
from difflib import get_close_matches
from fractions import Fraction
from functools import cache

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
    "percent": "0.01",
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
    | {"radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "°": "deg", "º": "deg", "moa": "arcmin"}
    | {"MOA": "arcmin", "rev": "turn", "revs": "turn", "turns": "turn", "kph": "kmh", "%": "percent"}
)
"""Other spellings, and the unit of each."""
_AMBIGUOUS = (
    dict.fromkeys(
        ("mil", "mils"),
        'is an angle or a thousandth of an inch: write "nato_mil" (6400 to a turn), "mrad", or "thou"',
    )
    | dict.fromkeys(
        ("grad", "grade"), 'is gon in some countries and degrees in others: write "gon" (400 to a turn) or "deg"'
    )
    | dict.fromkeys(("gr", "grs"), 'is grains to some and grams to others: write "grain" or "g"')
    | dict.fromkeys(("ton", "tons"), 'is 907, 1000 or 1016 kg: write "t" for 1000 kg, or kg')
)
"""Names that mean two things to those who type them, in small letters."""

_SCATTERS = re.compile(r"±|\+\s*/?\s*-|[0-9]\s*(?:\.\.|…)\s*[0-9]")
_NUMBER = re.compile(
    r"[-+]?(?:(?P<above>[0-9]+)\s*/\s*(?P<below>[0-9]+)(?![0-9.,])|(?:[0-9]+(?:\.[0-9]*|,[0-9]+)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
)
_THOUSANDS = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")
_FACTOR = re.compile(
    r"\s*(?:(?P<plain>1(?=\s*/)|\((?!\s*\)))|(?:(?P<close>\))|(?P<name>(?:[^\W\d]|[°%])++))"
    r"(?:\s*(?:\^|\*\*)\s*(?P<power>[-+]?[0-9]|\([-+]?[0-9]\))|(?P<attached>[-+]?[0-9]))?(?![0-9.,^]))"
    r"\s*(?P<operator>\*(?!\*)|[/·⋅×])?"
)
"""A factor of a unit, and the operator behind it: 1 before a quotient, a parenthesis, or a name with its power."""
_AS_TYPED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−μ", "-0123456789-µ")


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
    if _THOUSANDS.fullmatch(match[0]):
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
    if reason := _AMBIGUOUS.get(name.lower()):
        raise UnitError(f'whose unit "{name}" {reason}')
    spellings = [*_BASES, *_UNITS, *_SPELLINGS]
    other_case = [spelling for spelling in spellings if spelling.lower() == name.lower()]
    close = other_case or get_close_matches(
        name, [spelling for spelling in spellings if len(spelling) > 2], n=1, cutoff=0.8
    )
    raise UnitError(f'whose unit "{name}" is unknown' + (f'; did you mean "{close[0]}"?' if close else ""))
