"""A design file is read, or refused in one sentence; points of its space become campaigns."""

import math

import numpy as np
import pytest

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.design import corner_radius, hole_sizes, target_weights, violations
from warpimpact.scene import CirclePattern, Plate, SlotPattern, SquarePattern

from .conftest import HOLES, WEIGHT_AND_ENERGY, design

ALTERNATIVES = """
[variables]
thickness = { low = "3 mm", high = "5 mm", step = "0.5 mm" }
"plate.pattern" = [
  { name = "round", shape = "circle", diameter = { low = "4 mm", high = "6 mm" }, spacing = ["9 mm", "9 mm"] },
  { name = "slots", shape = "slot", width = "4 mm", length = "8 mm", spacing = [{ low = 8e-3, high = 9e-3 }, 16e-3] },
]
"""


def test_what_stands_below_an_alternative_counts_with_it_alone() -> None:
    one = design(ALTERNATIVES, WEIGHT_AND_ENERGY)
    names = [variable.name for variable in one.space.variables]
    assert names == ["thickness", "plate.pattern", "plate.pattern[round].diameter", "plate.pattern[slots].spacing.0"]
    assert math.isinf(one.space.size)
    slots = one.space.at([2, 1, 0.5, 0.5])
    assert slots.tolist()[:2] == [4.0, 1.0]
    assert np.isnan(slots[2])
    target, _ = violations(one, one.tables(slots))
    assert target is not None
    plate = target.layers[0]
    assert (plate.thickness, plate.pattern.shape, plate.pattern.spacing[0]) == (0.004, "slot", 8.5e-3)
    assert one.space.text(slots) == "thickness = 4 mm, plate.pattern = slots, plate.pattern[slots].spacing.0 = 0.0085"


def test_points_of_a_finite_space_each_once() -> None:
    resistances = "resistance = { low = 1e9, high = 2e9, step = 5e8 }"
    one = design("[variables]", 'thickness = ["3 mm", "4 mm"]', resistances, HOLES, WEIGHT_AND_ENERGY)
    assert one.space.size == 6
    assert sorted(point.tolist() for point in one.space.points()) == [[a, b] for a in (0, 1) for b in (1e9, 1.5e9, 2e9)]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (('[variables]\nthickness = "4 mm"', WEIGHT_AND_ENERGY), 'thickness: got "4 mm", but it must be a range'),
        (('[variables]\nthickness = { low = "5 mm", high = "4 mm" }', WEIGHT_AND_ENERGY), "low must not be greater"),
        (('[variables]\nthickness = { low = "5 mm", high = "1 cm" }', WEIGHT_AND_ENERGY), "the unit must be one"),
        (('[variables]\nthickness = ["3 mm", "3 mm"]', WEIGHT_AND_ENERGY), "but each must differ"),
        (('[variables]\nthicknes = ["3 mm"]', WEIGHT_AND_ENERGY), 'unknown input "thicknes"'),
        (('[variables]\n"plate.pattern" = [{ shape = "none" }]', WEIGHT_AND_ENERGY), "each with a name"),
        (('[[objectives]]\nmeasure = "weight"',), 'objectives[0].measure: got "weight"'),
        ((WEIGHT_AND_ENERGY, '[[bounds]]\nmeasure = "P(stopped)"'), "needs at_most or at_least"),
        ((WEIGHT_AND_ENERGY, "[stop]\nhalf_width = 1"), "a design file takes no [stop]"),
    ],
)
def test_a_design_that_cannot_be_searched_is_refused(parts: tuple[str, ...], message: str) -> None:
    with pytest.raises(CampaignError) as error:
        design(*parts)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("pattern", "narrow", "wide", "corner"),
    [
        (CirclePattern(diameter=5e-3, spacing=9e-3), 5e-3, 5e-3, 2.5e-3),
        (SlotPattern(width=4e-3, length=12e-3, spacing=(8e-3, 16e-3)), 4e-3, 12e-3, 2e-3),
        (SquarePattern(side=4e-3, corner_radius=1e-3, spacing=9e-3), 4e-3, 4e-3 * 2**0.5 - 2e-3 * (2**0.5 - 1), 1e-3),
    ],
)
def test_sizes_of_holes(pattern: CirclePattern, narrow: float, wide: float, corner: float) -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=pattern)
    assert hole_sizes(plate) == pytest.approx((narrow, wide), rel=1e-4)
    assert corner_radius(plate) == pytest.approx(corner)


@pytest.mark.parametrize(
    ("constraint", "broken"),
    [
        ('smallest_ligament = "3.1 mm"', "ligament of 3 mm, but it must be at least 3.1 mm"),
        ('smallest_ligament = "2.9 mm"', ""),
        ('smallest_hole = "5.1 mm"', "hole of 5 mm"),
        ('largest_hole = "4.9 mm"', "hole of 5 mm"),
        ('smallest_corner_radius = "2.6 mm"', "corner radius of 2.5 mm"),
        ("largest_open_area = 0.3", "open area of 0.3068"),
        ("smallest_open_area = 0.31", "open area of 0.3068"),
        ('largest_areal_density = "21 kg/m^2"', "areal density of 21.77 kg/m²"),
        ('smallest_areal_density = "22 kg/m^2"', "areal density of 21.77 kg/m²"),
    ],
)
def test_constraints_are_checked_before_anything_is_computed(constraint: str, broken: str) -> None:
    one = design(HOLES, WEIGHT_AND_ENERGY, "[constraints]", constraint)
    _, broken_ones = violations(one, one.tables(one.space.at([])))
    assert [broken in text for _, _, text in broken_ones] == ([True] if broken else [])


def test_the_weight_of_the_add_on_alone_is_bounded_and_minimised() -> None:
    base = '[[layer]]\nthickness = "10 mm"\nresistance = "1 GPa"\n'
    goals = WEIGHT_AND_ENERGY.replace('"areal_density"', '"add_on_areal_density"')
    one = design(HOLES, goals, base, '[constraints]\nlargest_add_on_areal_density = "21 kg/m^2"')
    target, broken = violations(one, one.tables(one.space.at([])))
    assert "areal density of the add-on of 21.77 kg/m², but it must be at most 21" in broken[0][2]
    assert target is not None
    weights = target_weights(target)
    assert weights["add_on_areal_density"] == pytest.approx(weights["areal_density"] - 78.5)
    assert one.file.objectives[0].spec.quantity.label == "areal density of the add-on"


@pytest.mark.parametrize(
    ("measure", "sentence"),
    [
        ('"base_depht"', "did you mean mean(base_depth)?"),
        ('"mean(tilt)"', "neither is better"),
        (
            '"worst_point(base_depth)"',
            "a search takes no worst point",
        ),
        ('"mean(bending_stress)"\ngoal = "minimise"', "needs output.bending = true"),
        ('"mean(broken_time)"\ngoal = "minimise"', "needs output.bending = true and core.strength"),
        ('"P(stopped)"\nangle = "30 deg"', 'got the unknown key "angle"'),
    ],
)
def test_a_measure_that_no_search_takes_is_refused(measure: str, sentence: str) -> None:
    with pytest.raises(CampaignError) as error:
        design(f"[[objectives]]\nmeasure = {measure}\n")
    assert sentence in str(error.value)
