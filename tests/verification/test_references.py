"""The references against published and independently found figures, closed forms and each other's limits."""

from math import atan2, exp, log, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

from . import references

PAPER_SHOT = {"velocity": 825.0, "thickness": 4e-3, "resistance": 2.6e9}
THICK_SHOT = {"velocity": 825.0, "thickness": 30e-3, "resistance": 0.3e9}
DEGRADING = {"degradation": 0.8, "degradation_interval": 1e-6}
LASTING = {"degradation": 1.0, "degradation_interval": 1e-6}


def test_paper_core_has_the_published_mass_and_calibre() -> None:
    # ∫ π r² ds at 7850 kg/m³ is the stated 4.0 g, to half of its last digit.
    volume, _ = quad(lambda s: pi * references.paper_radius(s) ** 2, 0, references.PAPER_LENGTH)
    assert 7850 * volume == pytest.approx(references.PAPER_MASS, abs=0.05e-3)
    assert pytest.approx(22.68e-3, abs=0.01e-3) == references.PAPER_SHOULDER
    assert pytest.approx(3.022e-3, abs=0.001e-3) == references.PAPER_LARGEST_RADIUS
    assert references.paper_radius(references.PAPER_SHOULDER) == pytest.approx(references.PAPER_LARGEST_RADIUS)


@pytest.mark.parametrize(("shear_coefficient", "published", "digit"), [(0.0, 729.0, 0.1), (0.05, 673.0, 1.0)])
def test_solid_plate_meets_the_stated_figures(shear_coefficient: float, published: float, digit: float) -> None:
    residual = references.solid_plate_residual(**PAPER_SHOT, shear_coefficient=shear_coefficient)
    assert residual == pytest.approx(published, abs=digit / 2)


@pytest.mark.parametrize("shot", [PAPER_SHOT, THICK_SHOT], ids=["paper", "thicker than the nose is long"])
def test_without_degradation_the_quadratures_are_the_closed_form(shot: dict[str, float]) -> None:
    shear_coefficient = 0.05
    expected = references.solid_plate_residual(**shot, shear_coefficient=shear_coefficient)
    case = {**shot, **LASTING, "shear_coefficient": shear_coefficient}
    # The steps are accurate to 1e-6 of the speed each, some hundred of them.
    coarse = references.nonlocal_degradation_residual(**case, degradation_length=2e-3)
    assert coarse == pytest.approx(expected, rel=1e-5)


# Values of a separate march of the same law on a Cartesian grid of ℓ/16, whose own error is about 2e-3 m/s.
@pytest.mark.parametrize(
    ("degradation_length", "shear_coefficient", "on_a_grid"),
    [(0.5e-3, 0.0, 768.309), (0.25e-3, 0.05, 737.819)],
)
def test_nonlocal_degradation_meets_a_cartesian_grid(
    degradation_length: float, shear_coefficient: float, on_a_grid: float
) -> None:
    case = {**PAPER_SHOT, **DEGRADING, "shear_coefficient": shear_coefficient, "degradation_length": degradation_length}
    residual = references.nonlocal_degradation_residual(**case)
    assert residual == pytest.approx(on_a_grid, abs=0.004)
    assert references.nonlocal_degradation_residual(**case, resolution=4) == pytest.approx(residual, abs=0.02)


MASS, VELOCITY, STATIC, QUADRATIC, SHEAR = 5.25e-3, 800.0, 2.6e9, 7850.0, 0.05
DIAMETER = 6.17e-3


def test_poncelet_cone_has_a_closed_form_from_face_to_face() -> None:
    # On a cone both integrals grow as (X/L)², and ∫ (X/L)² dX = L/3: the entry counts as L/3 of full contact
    # and the exit as 2L/3. So v² + F0/F2 falls by exp(−2 F2 x/m), x = X − 2L/3 inside, x = h behind.
    length = 10e-3
    tangent = DIAMETER / 2 / length
    area = pi * DIAMETER**2 / 4 * (1 + SHEAR / tangent)
    sine = sin(atan2(tangent, 1))
    static, quadratic = STATIC * area, QUADRATIC * area * sine**2
    nose = references.cone_nose(diameter=DIAMETER, length=length)
    core = references.Poncelet(nose, MASS, VELOCITY, STATIC, QUADRATIC, SHEAR)

    def closed_form(x: float) -> float:
        offset = static / quadratic
        return sqrt((VELOCITY**2 + offset) * exp(-2 * quadratic * x / MASS) - offset)

    depths = np.array([length, 12e-3, 20e-3])
    assert core.velocity_at(depths) == pytest.approx([closed_form(x - 2 * length / 3) for x in depths], rel=1e-8)
    assert core.residual_velocity(14e-3) == pytest.approx(closed_form(14e-3), rel=1e-8)
    rest = 2 * length / 3 + MASS / (2 * quadratic) * log(1 + quadratic * VELOCITY**2 / static)
    assert core.depth_of_rest == pytest.approx(rest, rel=1e-8)


def test_poncelet_ogive_has_the_published_nose_factor() -> None:
    # Tangent ogive without friction: ∫ n_x² dA / πR² = (8ψ − 1)/(24ψ²) (Forrestal et al. 1995), ψ the CRH.
    crh = 3.0
    core = references.Poncelet(references.ogive_nose(diameter=DIAMETER, crh=crh), MASS, VELOCITY, STATIC, QUADRATIC)
    area = pi * DIAMETER**2 / 4
    _, static, quadratic, _ = core.nose_in
    assert static == pytest.approx(STATIC * area, rel=1e-8)
    assert quadratic == pytest.approx(QUADRATIC * area * (8 * crh - 1) / (24 * crh**2), rel=1e-8)
