"""Worst tenths and quantiles: the numbers, and intervals that contain the answer as often as they claim."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats.qmc import Sobol

from warpimpact.statistics.intervals import estimate_of
from warpimpact.statistics.random_effects import interval_of_means
from warpimpact.statistics.tails import FEWEST_SHOTS, pseudo_values, quantile_weights, worst_tenth, worst_tenth_weights

TENTH = np.exp(-0.5 * ndtri(0.9) ** 2) / np.sqrt(2.0 * np.pi) / 0.1  # mean of the largest tenth of a standard normal

TRIALS = 100
LEAST = 88  # 95 % of 100 trials: 95 ± 2.2, three standard deviations below


def test_the_worst_tenth_is_the_mean_of_the_worst_tenth() -> None:
    for count in (10, 400, 1000):
        values = np.random.default_rng(count).random(count)
        assert worst_tenth(values).mean() == pytest.approx(np.sort(values)[-count // 10 :].mean(), rel=1e-12)
    quarter = np.arange(25.0)  # a tenth of 25 is two and a half
    assert worst_tenth(quarter).mean() == pytest.approx((24 + 23 + 22 / 2) / 2.5)
    assert np.isnan(worst_tenth(np.array([1.0, np.nan]))).tolist() == [False, True]


TAILS: dict[str, tuple[Callable[[np.random.Generator, int], np.ndarray], float]] = {
    "uniform": (lambda numbers, count: numbers.random(count), 0.95),
    "exponential": (lambda numbers, count: numbers.exponential(size=count), 1.0 + math.log(10.0)),
}


@pytest.mark.parametrize("name", TAILS)
def test_intervals_of_the_worst_tenth_hold_as_often_as_they_say(name: str) -> None:
    draw, truth = TAILS[name]
    held, numbers = 0, np.random.default_rng(11)
    for _ in range(TRIALS):
        estimate = estimate_of("mean", worst_tenth(draw(numbers, 1000)))
        held += estimate.low <= truth <= estimate.high
    assert held >= LEAST


def test_intervals_of_the_worst_tenth_of_replicates_hold_and_are_narrower() -> None:
    held, widths = 0, []
    for seed in range(TRIALS):
        points = [Sobol(2, rng=np.random.default_rng([seed, replicate])).random(64) for replicate in range(16)]
        sums = np.stack(points).sum(axis=2).T.reshape(-1)  # shot k belongs to replicate k mod 16
        estimate = estimate_of("mean", worst_tenth(sums), replicates=16)
        # Of the triangular distribution on 0 to 2: the mean above 2 − √0.2 is 2 − ⅔ √0.2.
        held += estimate.low <= 2.0 - 2.0 / 3.0 * math.sqrt(0.2) <= estimate.high
        widths.append(estimate.half_width)
    assert held >= LEAST
    assert np.median(widths) < 0.8 * estimate_of("mean", worst_tenth(sums)).half_width


@pytest.mark.parametrize(
    ("weights", "truth"),
    [
        (worst_tenth_weights, TENTH),
        (quantile_weights(0.5), 0.0),
        (quantile_weights(0.05), ndtri(0.05)),
        (quantile_weights(0.9), ndtri(0.9)),
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
    for weights in (worst_tenth_weights, quantile_weights(0.3)):
        assert weights(count).sum() == pytest.approx(1.0)
        whole = weights(count) @ np.sort(values)
        without = [weights(count - 1) @ np.sort(np.delete(values, k)) for k in range(count)]
        found = pseudo_values(values, np.zeros(count), weights)
        np.testing.assert_allclose(found, count * whole - (count - 1) * np.array(without), rtol=1e-12)
    assert worst_tenth_weights(20)[-2:] == pytest.approx([0.5, 0.5])


def test_images_count_once_and_small_groups_not_at_all() -> None:
    values, of = np.random.default_rng(1).normal(size=40), np.repeat([0, 1], [25, 15])
    values[3] = np.nan
    found = pseudo_values(values, of, worst_tenth_weights)
    assert np.isnan(found[[3, *range(25, 40)]]).all()
    assert np.isfinite(found[:3]).all()
    twice = pseudo_values(np.repeat(values, 2), np.repeat(of, 2), worst_tenth_weights, images=2)
    np.testing.assert_array_equal(twice, np.repeat(found, 2))
    values[5] = np.inf
    assert np.isfinite(pseudo_values(values, of, quantile_weights(0.5))[5])
