"""Measures of a design file: the language of results, and the names of earlier versions."""

import pytest

from warpimpact.campaign.text import CampaignError


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ('"areal_density"', "areal_density"),
        ('"residual_energy_density"\nstandoff = "50 mm"', "mean(residual_energy_density@50 mm)"),
        ('"residual_energy_density_worst_tenth"', "worst_tenth(residual_energy_density)"),
        ('"tilted_share"\nangle = "40 deg"\nstandoff = 0.13', "P(inclination@0.13 m > 40 deg)"),
        ('"tilted_share"\nangle = 40', "P(inclination > 40 deg)"),
        ('"stopped_share"', "P(stopped)"),
        ('"limit_thickness"\nlayer = 1', "mean(limit_thickness@layer 1)"),
        ('"limit_velocity_worst_tenth"', "worst_tenth(limit_velocity)"),
    ],
)
def test_names_of_earlier_versions_are_measures(make, given: str, text: str) -> None:
    old, new = (make(f"[[objectives]]\nmeasure = {measure}\n") for measure in (given, f'"{text}"'))
    assert old.objectives[0].measure == text
    assert (old.objectives, old.keys) == (new.objectives, new.keys)


def test_all_statistics_of_a_quantity_share_its_column(make) -> None:
    measures = ("mean(residual_velocity)", "worst_tenth(residual_velocity)", "P(residual_velocity > 500 m/s)")
    keys = make(*(f'[[objectives]]\nmeasure = "{measure}"\n' for measure in measures)).keys
    assert [key.text for key in keys] == ["residual_velocity", measures[2]]


@pytest.mark.parametrize(
    ("measure", "sentence"),
    [
        ('"base_depht"', "did you mean mean(base_depth)?"),
        ('"mean(tilt)"', "neither is better"),
        (
            '"worst_point(base_depth)"',
            "a search takes a mean, a worst tenth, a quantile, a probability or areal_density",
        ),
        ('"mean(bending_stress)"\ngoal = "minimise"', "needs output.bending = true"),
        ('"mean(broken_time)"\ngoal = "minimise"', "needs output.bending = true and core.strength"),
        ('"P(stopped)"\nangle = "30 deg"', 'got the unknown key "angle"'),
    ],
)
def test_what_cannot_be_sought_is_refused(make, measure: str, sentence: str) -> None:
    with pytest.raises(CampaignError) as refused:
        make(f"[[objectives]]\nmeasure = {measure}\n")
    assert sentence in str(refused.value)
