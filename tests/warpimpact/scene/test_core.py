"""Cores: shapes, and masses and moments against closed forms."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from warpimpact.scene import ConeCore, OgiveCore, PolynomialCore, ProfileCore

PAPER = {"coefficients": [3.0e-4, 0.24, -5.29], "length": "27.86 mm"}


def test_the_papers_core_weighs_four_grams() -> None:
    core = PolynomialCore(**PAPER, density=7850)
    mass, centre_of_mass, axial, transverse = core.mass_properties
    assert mass == pytest.approx(4.0e-3, abs=5e-7)  # docs/model.md §2, to the digits given there
    assert centre_of_mass == pytest.approx(18.05e-3, abs=5e-6)
    assert axial == pytest.approx(1.50e-8, abs=5e-11)
    assert transverse == pytest.approx(1.65e-7, abs=5e-10)
    assert core.max_radius == pytest.approx(3.0e-4 + 0.24**2 / (4 * 5.29), rel=1e-14)  # r at its vertex


def test_a_cone_has_the_moments_of_a_cone() -> None:
    d, h, m = 6e-3, 20e-3, 2e-3
    got = ConeCore(diameter=d, length=h, mass=m).mass_properties
    # Solid cone: centroid ¾h behind the tip, I_a = 3/10 m a², I_t = 3/20 m a² + 3/80 m h².
    a = d / 2
    expected = (m, 0.75 * h, 0.3 * m * a**2, 0.15 * m * a**2 + 0.0375 * m * h**2)
    assert got == pytest.approx(expected, rel=1e-12)


def test_half_a_calibre_is_a_hemisphere() -> None:
    a = 3e-3
    core = OgiveCore(diameter=2 * a, crh=0.5, length=a, density=1000.0)
    # Solid hemisphere: V = 2/3 π a³, centroid 3/8 a from its flat face, I_a = 2/5 m a², I_t = 83/320 m a².
    m = 1000.0 * 2 / 3 * np.pi * a**3
    expected = (m, 5 / 8 * a, 0.4 * m * a**2, 83 / 320 * m * a**2)
    assert core.mass_properties == pytest.approx(expected, rel=1e-12)


def test_a_profile_from_a_file_is_that_of_its_numbers(tmp_path: Path) -> None:
    (tmp_path / "cone.csv").write_text("s, r\n0, 0\n0.01, 0.003\n\n0.02, 0.003\n")
    from_file = ProfileCore(file=tmp_path / "cone.csv", density=7850)
    assert from_file == ProfileCore(s=[0, "10 mm", 0.02], r=[0, 0.003, 0.003], density=7850)
    cone = ConeCore(diameter=6e-3, length=20e-3, cone_length=10e-3, density=7850)
    assert from_file.mass_properties == pytest.approx(cone.mass_properties, rel=1e-12)
    assert (from_file.length, from_file.max_radius, from_file.breaks) == (0.02, 0.003, (0.01,))


def test_overrides_replace_what_the_shape_gives() -> None:
    plain = PolynomialCore(**PAPER, mass="4 g").mass_properties
    own = PolynomialCore(**PAPER, mass="4 g", centre_of_mass="17 mm", inertia_axial=1e-8).mass_properties
    moved = plain.inertia_transverse + plain.mass * (plain.centre_of_mass - 17e-3) ** 2  # parallel-axis theorem
    assert own.inertia_transverse == pytest.approx(moved, rel=1e-12)
    assert own == plain._replace(centre_of_mass=17e-3, inertia_axial=1e-8, inertia_transverse=own.inertia_transverse)


def test_parts_of_a_core_have_its_mass_and_its_moments() -> None:
    core = OgiveCore(diameter=6e-3, crh=3.0, length=20e-3, mass=4e-3)
    ends = (0.0, 4e-3, core.middle, core.length)
    whole, parts = core.mass_properties, [core.between(*two).mass_properties for two in pairwise(ends)]
    assert core.between(0.0, core.length) is core
    assert sum(part.mass for part in parts) == pytest.approx(whole.mass, rel=1e-3)
    assert parts[2].mass == pytest.approx(0.5 * whole.mass, rel=1e-3)
    away = [start + part.centre_of_mass - whole.centre_of_mass for start, part in zip(ends[:3], parts, strict=True)]
    turned = [part.inertia_transverse + part.mass * way**2 for way, part in zip(away, parts, strict=True)]
    assert sum(part.mass * way for way, part in zip(away, parts, strict=True)) == pytest.approx(0.0, abs=1e-8)
    assert sum(part.inertia_axial for part in parts) == pytest.approx(whole.inertia_axial, rel=1e-3)
    assert sum(turned) == pytest.approx(whole.inertia_transverse, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"coefficients": [-1e-5, 0.24]}, "radius of -1e-05 m at s = 0 m"),
        ({"coefficients": [1e-3, -0.2, 5.0]}, "radius of -0.001 m at s = 0.02 m"),  # dips between its ends
        ({"length": "60 mm"}, "radius of -0.004344 m at s = 0.06 m"),
        ({"mass": None}, "got neither of mass and density"),
        ({"density": 7850}, "got both of mass and density"),
        ({"centre_of_mass": "30 mm"}, "got centre_of_mass = 0.03 m, but it must lie between nose and base"),
    ],
)
def test_an_impossible_core_is_refused(values: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        PolynomialCore(**{**PAPER, "mass": "4 g", **values})


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        ("s,radius\n0,1e-3\n", 'line 1: got "s,radius", but the header must be s,r'),
        ("s,r\n0,1e-3\n1e-2,inf\n", 'line 3: r: got "inf", which does not begin with a number'),
        ("s,r\n0,1e-3,5\n", 'line 2: got "0,1e-3,5", but a row has 2'),
        ("s,r\n1e-3,1e-3\n2e-3,1e-3\n", "got stations s from 0.001 to 0.002 m, but they must increase from 0"),
        ("s,r\n0,1e-3\n1e-3,0\n2e-3,1e-3\n", "got r = 0 m in row 2"),
    ],
)
def test_a_bad_profile_is_refused(tmp_path: Path, table: str, complaint: str) -> None:
    (tmp_path / "profile.csv").write_text(table)
    with pytest.raises(ValidationError, match=complaint):
        ProfileCore(file=tmp_path / "profile.csv", density=7850)


def test_presented_area_is_the_union_of_the_sections_seen_from_the_side() -> None:
    """Every section is seen as an ellipse; the paper's core has no hollow."""
    core = PolynomialCore(**PAPER, mass="4 g")
    s = np.linspace(0.0, core.length, 4001)
    across = np.linspace(-4e-3, 30e-3, 2001)
    for degrees in (10.0, 45.0, 80.0):
        angle = np.radians(degrees)
        chord = core.radius(s) ** 2 - ((across[:, None] - s * np.sin(angle)) / np.cos(angle)) ** 2
        union = 2.0 * np.trapezoid(np.sqrt(np.maximum(chord.max(axis=1), 0.0)), across)
        assert core.presented_area(np.array(angle)) == pytest.approx(union, rel=1e-3)
    ends = core.presented_area(np.array([0.0, np.pi, np.pi / 2]))
    broadside = 2.0 * np.trapezoid(core.radius(s), s)
    assert ends == pytest.approx([np.pi * core.max_radius**2, np.pi * core.max_radius**2, broadside], rel=2e-4)
