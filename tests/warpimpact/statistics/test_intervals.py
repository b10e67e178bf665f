"""Intervals of numbers: known values, and how often they contain the answer."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.stats.mstats import hdquantiles
from scipy.stats.qmc import Sobol

from warpimpact.statistics.intervals import FEWEST_SHOTS, estimate_of, looks, pseudo_values, worst_tenth

TRIALS = 500
LEAST = 460  # 95 % of 500 trials: 475 ± 4.9, three standard deviations below
TAILS_TRIALS = 100
TAILS_LEAST = 88  # 95 % of 100 trials: 95 ± 2.2, three standard deviations below


def test_what_never_happens_in_any_replicate_is_not_certain() -> None:
    estimate = estimate_of("share", np.zeros(800), replicates=8)
    assert estimate.value == 0.0
    assert estimate.high == pytest.approx(1.96**2 / (800 + 1.96**2), rel=1e-3)  # Wilson's for 0 of 800


def test_differences_of_rare_shares_are_not_certain() -> None:
    """Agresti and Min's interval where nothing differs: half a shot more in each of four cells."""
    estimate = estimate_of("difference", np.zeros(98))
    assert estimate.value == 0.0
    assert estimate.high == pytest.approx(1.959964 / 100.0)
    held, numbers = 0, np.random.default_rng(2)
    for _ in range(TRIALS):
        drawn = numbers.choice([-1.0, 0.0, 1.0], p=[0.01, 0.96, 0.03], size=200)
        held += (message := estimate_of("difference", drawn)).low <= 0.02 <= message.high
    assert held >= LEAST


def test_the_share_of_replicates_stays_between_0_and_1() -> None:
    values = np.zeros(64)
    values[:3] = 1.0  # three of sixteen replicates
    estimate = estimate_of("share", values, replicates=16)
    assert estimate.low == 0.0
    assert estimate.high > estimate.value
    assert estimate_of("share", 1.0 - values, replicates=16).high == 1.0


@pytest.mark.parametrize(("successes", "count"), [(0, 3), (0, 40), (3, 40), (40, 40), (70_000, 100_000)])
def test_the_interval_of_a_share_is_wilsons(successes: int, count: int) -> None:
    actual = estimate_of("share", np.repeat([1.0, 0.0], [successes, count - successes]), confidence=0.9)
    wilson = stats.binomtest(successes, count).proportion_ci(0.9, method="wilson")
    assert (actual.low, actual.high) == pytest.approx((wilson.low, wilson.high), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("kind", ["mean", "share", "difference", "quantile"])
def test_one_or_two_shots_have_no_interval(kind: str) -> None:
    for values in (np.ones(1), np.array([1.0, 0.0])):
        estimate = estimate_of(kind, values)
        assert estimate.value == values.mean()
        assert np.isnan([estimate.low, estimate.high]).all()


def test_a_rule_looks_at_balanced_points_or_at_steps_of_a_quarter() -> None:
    assert list(looks("sobol", 20)) == [1, 2, 4, 8, 16, 20]
    assert list(looks("random", 20)) == [1, 2, 3, 4, 5, 7, 9, 12, 15, 19, 20]
    assert list(looks("random", 1)) == [1]


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
    for _ in range(TAILS_TRIALS):
        estimate = estimate_of("mean", worst_tenth(draw(numbers, 1000)))
        held += estimate.low <= truth <= estimate.high
    assert held >= TAILS_LEAST


def test_intervals_of_the_worst_tenth_of_replicates_hold_and_are_narrower() -> None:
    held, widths = 0, []
    for seed in range(TAILS_TRIALS):
        points = [Sobol(2, rng=np.random.default_rng([seed, replicate])).random(64) for replicate in range(16)]
        sums = np.stack(points).sum(axis=2).T.reshape(-1)  # shot k belongs to replicate k mod 16
        estimate = estimate_of("mean", worst_tenth(sums), replicates=16)
        # Of the triangular distribution on 0 to 2: the mean above 2 − √0.2 is 2 − ⅔ √0.2.
        held += estimate.low <= 2.0 - 2.0 / 3.0 * math.sqrt(0.2) <= estimate.high
        widths.append(estimate.half_width)
    assert held >= TAILS_LEAST
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
