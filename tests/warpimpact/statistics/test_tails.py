"""Worst tenths and quantiles: the numbers, and intervals that contain the answer as often as they claim."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats.mstats import hdquantiles
from scipy.stats.qmc import Sobol

from warpimpact.statistics.intervals import FEWEST_SHOTS, estimate_of, pseudo_values, worst_tenth

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


def test_pseudo_values_are_those_of_the_jackknife() -> None:
    values, count = np.random.default_rng(1).normal(size=20), 20
    whole = hdquantiles(values, [0.3])[0]
    without = [hdquantiles(np.delete(values, k), [0.3])[0] for k in range(count)]
    actual = pseudo_values(values, 0.3)
    np.testing.assert_allclose(actual, count * whole - (count - 1) * np.array(without), rtol=1e-9)


def test_shots_that_do_not_count_have_no_pseudo_value() -> None:
    values = np.random.default_rng(1).normal(size=25)
    values[3], values[5] = np.nan, np.inf
    actual = pseudo_values(values, 0.5)
    assert np.flatnonzero(np.isnan(actual)).tolist() == [3]
    assert np.isnan(pseudo_values(values[:FEWEST_SHOTS], 0.5)).all()
