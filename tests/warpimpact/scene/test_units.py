"""Quantities and files that people type: read as they are meant, or refused with what to type."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from warpimpact.scene import Hits, units
from warpimpact.scene.input_files import parsed
from warpimpact.scene.units import duration_text, factor


@pytest.mark.parametrize(
    ("kind", "given", "si"),
    [
        (units.Length, "4 mm", 4e-3),
        (units.Length, 0.004, 4e-3),
        (units.Length, np.float64(0.004), 4e-3),
        (units.Length, "-.5in", -12.7e-3),
        (units.Time, "1 µs", 1e-6),
        (units.Stress, "2600 MPa", 2.6e9),
        (units.Density, "7.85e0 g/cm^3", 7850.0),
        (units.Angle, 180, math.pi),
        (units.Angle, "0.1 rad", 0.1),
        (units.AngularVelocity, "60 rpm", 2 * math.pi),
        (units.AngularVelocity, "2.7e3 turn/s", 5400 * math.pi),
        (units.Inertia, "1.5 g cm^2", 1.5e-7),
        (units.Number, "5 %", 0.05),
        (units.Number, "0.05", 0.05),
        (units.Length, "4,0 mm", 4e-3),
        (units.Length, "0,125 in", 3.175e-3),
        (units.Length, "3/16 in", 4.7625e-3),
        (units.Length, "−5 mm", -5e-3),
        (units.Angle, "20 º", math.pi / 9),
        (units.Angle, "20°", math.pi / 9),
        (units.Angle, "20 ˚", math.pi / 9),
        (units.Angle, "20 gon", math.pi / 10),
        (units.Angle, "20 nato_mil", math.pi / 160),
        (units.Mass, "81 grain", 5.24871171e-3),
        (units.Stress, "2600 N/mm2", 2.6e9),
        (units.Density, "7850 kg/m3", 7850.0),
        (units.Density, "7850 kg·m⁻³", 7850.0),
        (units.Density, "7.85 g/(cm * cm ^ 2)", 7850.0),
        (units.Speed, "0.825 mm/μs", 825.0),
        (units.Speed, "2700 ft/s", 822.96),
    ],
)
def test_a_quantity_becomes_si(kind: object, given: object, si: float) -> None:
    assert TypeAdapter(kind).validate_python(given) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ("4 kg", 'got "4 kg", which is not a length'),
        ("4", 'got "4", which has no unit'),
        ("mm", 'got "mm", which does not begin with a number'),
        ("4 mm 5", 'got "4 mm 5", whose unit "mm 5" is not one of names, powers, * and /'),
        ("4 foos", 'got "4 foos", whose unit "foos" is unknown'),
        ("4 MM", 'got "4 MM", whose unit "MM" is unknown; did you mean "mm"?'),
        ("nan mm", 'got "nan mm", which does not begin with a number'),
        ("1e999 mm", 'got "1e999 mm", which is not finite'),
        (math.nan, "got NaN, which is not finite"),
        (10**400, f"got 1{'0' * 78}…, which is not finite"),
        (True, "got true, which is not a length"),
    ],
)
def test_what_is_no_length_is_refused(given: object, complaint: str) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(units.Length).validate_python(given)
    advice = 'give a number in m or a string such as "4 mm"'
    assert str(caught.value.errors()[0]["ctx"]["error"]) == f"{complaint}; {advice}"


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
        lambda angle: angle + np.radians(10.0),
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


@pytest.mark.parametrize("unit", units.UNITS.items(), ids=lambda unit: unit[0])
def test_units_of_a_result_can_be_typed(unit: tuple[str, units.Unit]) -> None:
    si_unit, stored = unit[0], unit[1].stored if unit[0] else ""
    assert factor(stored, si_unit) == (math.pi / 180 if si_unit == "rad" else 1.0)


@pytest.mark.parametrize(
    "text", ["20 deg ± 1 deg", "20±1 deg", "2600 MPa ± 1 %", "20 +/- 1 deg", "20 +- 1 deg", "4..5 mm"]
)
def test_a_text_that_scatters_names_distributions(text: str) -> None:
    with pytest.raises(ValidationError, match="write a distribution"):
        TypeAdapter(units.Angle).validate_python(text)


@pytest.mark.parametrize(
    ("kind", "text", "spellings"),
    [
        (units.Angle, "20 mil", ["nato_mil", "mrad", "thou"]),
        (units.Angle, "20 grad", ["gon", "deg"]),
        (units.Angle, "20 gradi", ["gon", "deg"]),
        (units.Mass, "5.3 gr", ["grain", "g"]),
        (units.Density, "1 ton/m^3", ["t", "kg"]),
        (units.AngularVelocity, "15000 1/s", ["turn/s", "rad/s"]),
        (units.AngularVelocity, "15 kHz", ["turn/s", "rad/s"]),
        (units.Length, "1,250 mm", ["thousands"]),
    ],
)
def test_what_means_two_things_is_refused_with_both_spellings(kind: object, text: str, spellings: list[str]) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(kind).validate_python(text)
    message = str(caught.value.errors()[0]["ctx"]["error"])
    assert all(spelling in message for spelling in spellings)


TYPED = {
    "4mm": 4e-3,
    "+4 mm": 4e-3,
    ".4 cm": 4e-3,
    "4000um": 4e-3,
    "4000 microns": 4e-3,
    "1/4inch": 6.35e-3,
    "250 thou": 6.35e-3,
    "0,5 ft": 0.1524,
    "4 millimeters": 4e-3,
    "4 (mm)": 4e-3,
    "4 Mm": None,
    "4 mm thick": None,
    "~4 mm": None,
    "4-5 mm": None,
    "4 to 5 mm": None,
    "4+1 mm": None,
    "4 mm # 3 mm": None,
    "4 mm; 5": None,
    "1_000 mm": None,
    "0x10 mm": None,
    "5/0 in": None,
    "5 mm**2**2": None,
    "4 mm\n3 mm": None,
    "approx. 4 mm": None,
    "4 mm?": None,
    "4 mm, 5 mm": None,
    "4 mm / 2": None,
    "2 x 4 mm": None,
    "4'": None,
    '4"': None,
    "1 1/4 in": None,
    "1.250,5 mm": None,
    "four mm": None,
    "4 mm (nominal)": None,
    "1e3": None,
    "4 mm %": None,
    "4 % mm": None,
}


OTHERS = {
    (units.Angle, "20 deg^2"): None,
    (units.Angle, "5 %"): None,
    (units.Angle, "20 min"): None,
    (units.Number, "3 deg"): None,
    (units.Number, "5 % %"): None,
    (units.Stress, "2600 mPa"): None,
    (units.AngularVelocity, "15000"): None,
    (units.Mass, "5.25 grams"): 5.25e-3,
    (units.Stress, "0.5 gpa"): None,
    (units.Stress, "2,6 GPa"): 2.6e9,
    (units.Stress, "500 Mpa"): None,
    (units.Stress, "400 ksi"): 2757902917.2673444,
    (units.Speed, "800 m/sec"): 800.0,
    (units.Speed, "800 ms"): None,
    (units.Speed, "800 m s"): None,
    (units.Density, "7,85 g/cc"): 7850.0,
    (units.Angle, "20 degrees"): math.pi / 9,
    (units.Number, "1/2"): 0.5,
}


@pytest.mark.parametrize(
    ("typed", "si"), [*(((units.Length, text), si) for text, si in TYPED.items()), *OTHERS.items()]
)
def test_what_people_type_is_read_as_meant_or_refused(typed: tuple[object, str], si: float | None) -> None:
    kind, text = typed
    if si is None:
        with pytest.raises(ValidationError, match=r"which|whose"):
            TypeAdapter(kind).validate_python(text)
    else:
        assert TypeAdapter(kind).validate_python(text) == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "hit_y,hit_z\n0.001,-0.25e-3\n",
        "hit_y;hit_z\n0,001;-0,25e-3\n;\n",
        "sep=;\r\nhit_y;hit_z\r\n0,001;-0,25e-3\r\n",
        "sep=|\nhit_y|hit_z\n0.001|-0.25e-3\n",
        "# of a gauge\nhit_y\thit_z\n0,001\t-0,00025\n",
        "\ufeffhit_y [mm];hit_z [mm]\n1;-0,25\n",
        "SEP=;;\nHIT_Y (mm);hit_z (mm);\n1;−0,25;\n",
    ],
)
def test_tables_of_any_spreadsheet_are_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    listed = Hits(sampling="list", file=tmp_path / "a.csv").listed
    assert listed is not None
    assert {name: values.tolist() for name, values in listed.items()} == {"hit_y": [0.001], "hit_z": [-0.00025]}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("hit_y\thit_z\n1,250\t0\n", 'line 2: hit_y: got "1,250", whose comma may stand for thousands'),
        ("hit_y;hit_z\n1.250,5;0\n", 'line 2: hit_y: got "1.250,5", but it must be a finite number'),
        ("hit_y;hit_z\n#N/A;0\n0;0\n", 'line 2: got "#N/A", an error of the spreadsheet'),
        ('hit_y,hit_z\n"1\n2",0\n', "line 3: hit_y: got "),
        ("hit_y,hit_z\n1_0,0\n", 'line 2: hit_y: got "1_0"'),
        ("hit_y,hit_z\n0.1 mm,0\n", "units belong to the header"),
        ("hit_y,hit_z\n0,001,0,002\n", "but a row has 2 finite numbers; decimal commas need semicolons"),
    ],
)
def test_a_cell_that_is_no_number_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=sentence):
        Hits(sampling="list", file=tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("line", "advice"),
    [
        ("thickness = 4 mm", 'thickness = "4 mm"'),
        ("thickness = 4,0 mm", 'thickness = "4,0 mm"'),
        ("thickness = “4 mm”;", 'thickness = "4 mm"'),
        ('thickness = "4 mm', "close the quotes"),
        ('thickness = "4 mm";', "remove what follows the value; a comment begins with #"),
        ("thickness\u00a0= 4", "such as a space copied from a web page"),
        ("thickness = ", "write a value behind the ="),
        ("spacing = [8 mm, 16 mm]", 'spacing = ["8 mm", "16 mm"]'),
        ('spacing = ["8 mm" "16 mm"]', "write commas between the items, and ] behind the last"),
        ("count = 4,096", "with digits before and behind a point, and no other mark"),
        ('file = "C:\\users\\a.csv"', "write single quotes around a text with \\"),
        ("rotation = 20°", 'rotation = "20°"'),
        ("title = plates", 'title = "plates"'),
        ('pattern = { shape = "circle", diameter = 5 mm, spacing = 2 }', 'diameter = "5 mm"'),
        ("irreducible = True", "irreducible = true"),
        ("irreducible = no", "irreducible = false"),
        ("pattern = {\n shape = 1 }", "a table { … } in one line"),
    ],
)
def test_what_is_no_toml_is_followed_by_what_to_type(line: str, advice: str) -> None:
    with pytest.raises(ValueError, match=r"a\.toml: is not valid TOML: ") as caught:
        parsed(f"[plate]\n{line}\n", "a.toml")
    assert str(caught.value).endswith(advice)


def test_a_duration_has_a_unit_that_a_person_reads() -> None:
    durations = (0.31, 99.0, 600.0, 7200.0, 9.0e4, 1.0e7, 2.3172861480e10)
    assert [duration_text(one) for one in durations] == [
        *("0.31 s", "99 s", "10 min", "2 h", "25 h", "120 days", "730 years"),
    ]
