"""Sobol points by their number."""

import numpy as np
import pytest
from scipy.stats import qmc

from warpimpact.scene.sobol import BITS, MOST_DIMENSIONS, TOGETHER, Sobol


@pytest.mark.parametrize("dimensions", [1, 2, TOGETHER])
def test_the_points_of_scipy(dimensions: int) -> None:
    found = Sobol(dimensions, np.random.SeedSequence(7, spawn_key=(3,))).points(0, 256)
    rng = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(3,)))
    np.testing.assert_array_equal(found, qmc.Sobol(dimensions, rng=rng).random(256))


def test_further_dimensions_change_none_of_the_others() -> None:
    seed = np.random.SeedSequence(7, spawn_key=(3,))
    most = Sobol(MOST_DIMENSIONS, seed).points(0, 1024)
    for dimensions in (TOGETHER, TOGETHER + 1, 40):
        np.testing.assert_array_equal(Sobol(dimensions, seed).points(0, 1024), most[:, :dimensions])
    # Each dimension has one point in each of 1024 intervals, and no two of them are alike.
    assert (np.sort(np.floor(most * 1024).astype(int), axis=0) == np.arange(1024)[:, None]).all()
    assert np.abs(np.corrcoef(most.T) - np.eye(MOST_DIMENSIONS)).max() < 0.2


def test_the_last_point_exists_and_the_next_does_not() -> None:
    sobol = Sobol(2, np.random.SeedSequence(1))
    assert sobol.points((1 << BITS) - 1, 1).shape == (1, 2)
    with pytest.raises(ValueError, match="has 1073741824 points"):
        sobol.points(1 << BITS, 1)


def test_too_many_dimensions() -> None:
    with pytest.raises(ValueError, match=f"{MOST_DIMENSIONS} are allowed"):
        Sobol(MOST_DIMENSIONS + 1, np.random.SeedSequence(1))
