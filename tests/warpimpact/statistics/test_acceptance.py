"""Plans of n shots with at most k perforations."""

import numpy as np
import pytest
from scipy import stats

from warpimpact.statistics.quantal import acceptance, fewest_shots, shown_stop_probability


@pytest.mark.parametrize(("allowed", "shots"), [(0, 22), (1, 38), (2, 52), (3, 65)])
def test_the_fewest_shots_at_90_percent_are_the_published_ones(allowed: int, shots: int) -> None:
    assert fewest_shots(allowed, 0.9, 0.9) == shots
    assert acceptance(shots, allowed, 0.1) <= 0.1 < acceptance(shots - 1, allowed, 0.1)
    assert shown_stop_probability(shots, allowed, 0.9) >= 0.9 > shown_stop_probability(shots - 1, allowed, 0.9)


@pytest.mark.parametrize("perforations", [0, 1, 5, 22])
def test_the_bound_is_that_of_clopper_and_pearson(perforations: int) -> None:
    if perforations < 22:
        actual = stats.binomtest(22 - perforations, 22, alternative="greater").proportion_ci(0.9, method="exact").low
    else:
        actual = 0.0
    assert shown_stop_probability(22, perforations, 0.9) == pytest.approx(actual)


def test_shots_at_the_same_place_show_less() -> None:
    """A tenth of the places always perforates: 22 shots there accept 90 % of the time, at any places 0.9²²."""
    by_place = np.repeat([1.0, 0.0], [1, 9])
    assert acceptance(22, 0, by_place).mean(axis=-1) == pytest.approx(0.9)
    assert acceptance(22, 0, by_place.mean()) == pytest.approx(0.9**22)


def test_a_plan_that_no_number_of_shots_fulfils_is_refused() -> None:
    with pytest.raises(ValueError, match="needs more than 100000 shots"):
        fewest_shots(0, 1.0, 0.9)
