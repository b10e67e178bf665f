"""Measures of a design file, in the language of results."""

import pytest

from warpimpact.campaign.text import CampaignError

from .conftest import design


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
def test_what_cannot_be_sought_is_refused(measure: str, sentence: str) -> None:
    with pytest.raises(CampaignError) as refused:
        design(f"[[objectives]]\nmeasure = {measure}\n")
    assert sentence in str(refused.value)
