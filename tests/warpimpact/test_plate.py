"""Plate and interaction: defaults, derived figures, bounds."""

import math

import pytest
from pydantic import ValidationError

from warpimpact.scene import CirclePattern, Interaction, NoPattern, Plate

STEEL = {"thickness": "4 mm", "resistance": "2600 MPa"}


def test_a_plain_plate_is_solid_steel_that_neither_rubs_nor_degrades() -> None:
    plate = Plate(**STEEL)
    assert (plate.shear_coefficient, plate.degradation, plate.pattern) == (0.0, 1.0, NoPattern())
    assert (plate.density, plate.degradation_length, plate.size) == (7850.0, 0.5e-3, None)
    assert plate.areal_density == pytest.approx(31.4, rel=1e-14)


def test_holes_take_their_share_of_the_weight() -> None:
    plate = Plate(**STEEL, pattern=CirclePattern(diameter="5 mm", spacing=["10 mm", "10 mm"]))
    assert plate.open_area == pytest.approx(math.pi / 16, rel=1e-14)
    assert plate.areal_density == pytest.approx(31.4 * (1 - math.pi / 16), rel=1e-14)


def test_a_scene_is_immutable() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        Plate(**STEEL).thickness = 1.0


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("thickness", 0, "greater than 0"),
        ("resistance", "-1 MPa", "greater than or equal to 0"),
        ("shear_coefficient", -0.01, "greater than or equal to 0"),
        ("degradation", 1.01, "less than or equal to 1"),
        ("degradation", -0.01, "greater than or equal to 0"),
        ("degradation_interval", 0, "greater than 0"),
        ("degradation_length", 0, "greater than 0"),
        ("size", ["10 cm", 0], "greater than 0"),
    ],
)
def test_a_value_out_of_bounds_is_refused(field: str, value: object, complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        Plate(**{**STEEL, field: value})


def test_interaction_scales_with_resistance_and_density() -> None:
    plate = Plate(thickness=1, resistance=4e8, density=2500)
    assert Interaction().coefficients(plate.resistance, plate.density) == (4e8, 0.0, 0.0)
    law = Interaction(static=3, linear=0.5, quadratic=1.5)
    assert law.coefficients(plate.resistance, plate.density) == pytest.approx((1.2e9, 0.5e6, 3750.0), rel=1e-14)
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        Interaction(linear=-1)
