"""Quantities: SI numbers and strings with units come out as SI floats, everything else is refused."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from warpimpact.scene import units


@pytest.mark.parametrize(
    ("kind", "given", "si"),
    [
        (units.Length, "4 mm", 4e-3),
        (units.Length, 0.004, 4e-3),
        (units.Length, np.float64(0.004), 4e-3),
        (units.Length, "-.5in", -12.7e-3),
        (units.Mass, "4 g", 4e-3),
        (units.Time, "1 us", 1e-6),
        (units.Time, "1 µs", 1e-6),
        (units.Stress, "2600 MPa", 2.6e9),
        (units.Density, "7.85e0 g/cm^3", 7850.0),
        (units.Speed, "825 m/s", 825.0),
        (units.Angle, "180 deg", math.pi),
        (units.Angle, 180, math.pi),
        (units.Angle, "0.1 rad", 0.1),
        (units.AngularVelocity, "60 rpm", 2 * math.pi),
        (units.AngularVelocity, "2.7 kHz", 5400 * math.pi),  # a frequency counts turns
        (units.AngularVelocity, "1 deg/s", math.pi / 180),
        (units.Inertia, "1.5 g cm^2", 1.5e-7),
        (units.Number, "5 %", 0.05),
        (units.Number, "0.05", 0.05),
    ],
)
def test_a_quantity_becomes_si(kind: object, given: object, si: float) -> None:
    assert TypeAdapter(kind).validate_python(given) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ("4 kg", 'got "4 kg", which is not a length'),
        ("4", 'got "4", which has no unit'),
        ("mm", 'got "mm", which is not a length'),
        ("4 mm 5", 'got "4 mm 5", whose unit "mm 5" is unknown'),
        ("4 foos", 'got "4 foos", whose unit "foos" is unknown'),
        ("nan mm", 'got "nan mm", which is not a length'),
        ("1e999 mm", 'got "1e999 mm", which is not finite'),
        (math.nan, "got NaN, which is not finite"),
        (math.inf, "got Infinity, which is not finite"),
        (10**400, 'got "a number of more than 80 digits", which is not finite'),
        (True, "got true, which is not a length"),
        (None, "got null, which is not a length"),
        ([4], "got [4], which is not a length"),
    ],
)
def test_what_is_no_length_is_refused(given: object, complaint: str) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(units.Length).validate_python(given)
    advice = 'give a number in m or a string such as "4 mm"'
    assert str(caught.value.errors()[0]["ctx"]["error"]) == f"{complaint}; {advice}"


def test_an_angle_needs_its_unit_where_it_is_text() -> None:
    with pytest.raises(ValidationError, match='"20", which has no unit; give a number in deg or a string such as'):
        TypeAdapter(units.Angle).validate_python("20")


def test_an_angle_that_was_read_is_not_read_again() -> None:
    angle = TypeAdapter(units.Angle)
    once = angle.validate_python(20)
    assert angle.validate_python(once) == once == pytest.approx(math.radians(20))
    assert angle.validate_json(angle.dump_json(once)) == once
    assert angle.validate_python(angle.dump_python(once)) == once


@pytest.mark.parametrize(
    "changed",
    [
        lambda angle: 1.5 * angle,
        lambda angle: np.float64(3.0) * angle / 2,
        lambda angle: angle + 0.5 * angle,
        lambda angle: angle + np.radians(10.0),
        lambda angle: np.radians(10.0) + angle,
        lambda angle: -(angle - 2.5 * angle),
        lambda angle: sum([angle, angle, -angle / 2]),
        lambda angle: abs(round(-1.5 * angle, 15)),
    ],
)
def test_an_angle_that_was_read_stays_an_angle_in_arithmetic(changed: Callable[[units.Radians], object]) -> None:
    angle = TypeAdapter(units.Angle)
    assert angle.validate_python(changed(angle.validate_python(20))) == pytest.approx(math.radians(30), rel=1e-14)
    assert type(units.Radians(2.0) / units.Radians(1.0)) is float
    assert isinstance(np.ones(2) * units.Radians(2.0), np.ndarray)
    assert isinstance(units.Radians(2.0) * np.ones(2), np.ndarray)


@pytest.mark.parametrize(("unit", "si_unit"), units.COMMON)
def test_common_units_are_those_of_pint(unit: str, si_unit: str) -> None:
    assert units.COMMON[unit, si_unit] == units._by_pint(unit, si_unit)
