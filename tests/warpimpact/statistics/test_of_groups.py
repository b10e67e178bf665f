"""Worst tenths and quantiles of groups: coverage of a known model of random effects, and what the pseudo-values are."""

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from warpimpact.statistics.of_groups import FEWEST_SHOTS, of_quantile, of_worst_tenth, pseudo_values
from warpimpact.statistics.random_effects import interval_of_means

TENTH = np.exp(-0.5 * ndtri(0.9) ** 2) / np.sqrt(2.0 * np.pi) / 0.1  # mean of the largest tenth of a standard normal


@pytest.mark.parametrize(
    ("weights", "truth"),
    [
        (of_worst_tenth, TENTH),
        (of_quantile(0.5), 0.0),
        (of_quantile(0.05), ndtri(0.05)),
        (of_quantile(0.9), ndtri(0.9)),
    ],
)
@pytest.mark.parametrize(("shots", "between"), [(FEWEST_SHOTS, 1.0), (64, 0.3)])
def test_the_interval_of_a_known_model(weights, truth: float, shots: int, between: float) -> None:
    numbers, of, covered = np.random.default_rng(3), np.repeat(np.arange(64), shots), []
    for _ in range(100):
        values = between * numbers.normal(size=64)[of] + numbers.normal(size=len(of))
        low, high = (end - truth for end in interval_of_means(pseudo_values(values, of, weights), of))
        covered.append(ndtr(high / between) - ndtr(low / between))
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


def test_pseudo_values_are_those_of_the_jackknife() -> None:
    values, count = np.random.default_rng(1).normal(size=20), 20
    for weights in (of_worst_tenth, of_quantile(0.3)):
        assert weights(count).sum() == pytest.approx(1.0)
        whole = weights(count) @ np.sort(values)
        without = [weights(count - 1) @ np.sort(np.delete(values, k)) for k in range(count)]
        found = pseudo_values(values, np.zeros(count), weights)
        np.testing.assert_allclose(found, count * whole - (count - 1) * np.array(without), rtol=1e-12)
    assert of_worst_tenth(20)[-2:] == pytest.approx([0.5, 0.5])


def test_images_count_once_and_small_groups_not_at_all() -> None:
    values, of = np.random.default_rng(1).normal(size=40), np.repeat([0, 1], [25, 15])
    values[3] = np.nan
    found = pseudo_values(values, of, of_worst_tenth)
    assert np.isnan(found[[3, *range(25, 40)]]).all()
    assert np.isfinite(found[:3]).all()
    twice = pseudo_values(np.repeat(values, 2), np.repeat(of, 2), of_worst_tenth, images=2)
    np.testing.assert_array_equal(twice, np.repeat(found, 2))
    values[5] = np.inf
    assert np.isfinite(pseudo_values(values, of, of_quantile(0.5))[5])
