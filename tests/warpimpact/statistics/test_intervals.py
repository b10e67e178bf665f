"""Intervals, differences and ratios: known values, closed forms, and how often they contain the answer."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.stats.mstats import hdquantiles
from scipy.stats.qmc import Sobol

from warpimpact.statistics.comparisons import (
    SHIFT_MARGIN,
    Ratio,
    difference_of_independent,
    shift_of_event,
    shift_of_mean,
    shift_of_quantile,
    shift_of_share,
)
from warpimpact.statistics.intervals import FEWEST_SHOTS, Estimate, estimate_of, looks, pseudo_values, worst_tenth

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


def estimate(value: float, low: float, high: float) -> Estimate:
    return Estimate(value, low, high, 10, 1.0)


def test_half_widths_of_independent_estimates_add_in_quadrature() -> None:
    # Each end takes the parts of both intervals that push it outwards: 3, 4 below and 1, 2 above.
    low, high = difference_of_independent(estimate(10.0, 7.0, 11.0), estimate(6.0, 4.0, 10.0))
    assert low == pytest.approx(4.0 - 5.0)
    assert high == pytest.approx(4.0 + math.sqrt(5.0))


def test_a_ratio_to_numbers_that_differ_has_an_interval_of_its_own() -> None:
    reference = np.random.default_rng(1).uniform(1.0, 2.0, 200)
    numbers = 3.0 * reference  # the ratio is 3 without any error
    message = Ratio.of(estimate_of("mean", numbers), numbers, reference, {})
    assert message.value == pytest.approx(3.0)
    assert message.high - message.low == pytest.approx(0.0, abs=1e-12)
    one = Ratio.of(estimate(6.0, 5.0, 7.0), numbers, np.array([2.0]), {})
    assert one == (2.0, 3.0, 2.5, 3.5)
    assert math.isnan(Ratio.of(estimate(6.0, 5.0, 7.0), numbers, None, {}).value)
    assert Ratio.of(estimate(6.0, 5.0, 7.0), numbers, np.array([0.0]), {}).reference == 0.0


@pytest.mark.parametrize(("reference", "bounded"), [([3.0, 4.0, 5.0, 6.0], True), ([0.0, 0.0, 0.0, 9.0], False)])
def test_a_ratio_of_means_that_are_not_negative_has_no_negative_end(reference: list[float], bounded: bool) -> None:
    numbers = np.array([0.0, 0.1, 3.0, 0.2])
    message = Ratio.of(estimate_of("mean", numbers), numbers, np.array(reference), {})
    assert message.low == 0.0
    assert math.isnan(message.high) is not bounded
    if bounded:  # Fieller: there the mean of the one less r times the other is as far from 0 as its interval reaches
        difference = estimate_of("mean", numbers - message.high * np.array(reference))
        assert -difference.value == pytest.approx(difference.half_width)


Array = np.ndarray
SHIFT_TRIALS, SHOTS = 400, 64
# 95 % of 400 trials are 380 ± 4.4; three standard deviations below.
SHIFT_LEAST = 367


def held(shift: Callable[[Array, Array], float], true: float, *, bias: float, noise: float) -> tuple[int, float]:
    """In how many trials the shift of shots uniform in 0 … 1, whose errors have a bias and a noise, is at least the
    true one; and its median."""
    rng = np.random.default_rng(5)
    actual = []
    for _ in range(SHIFT_TRIALS):
        coarse = rng.random(SHOTS)
        actual.append(shift(coarse, coarse + bias + noise * rng.standard_normal(SHOTS)))
    return int(np.sum(np.array(actual) >= true)), float(np.median(actual))


@pytest.mark.parametrize("bias", [0.0, 0.01, -0.03])
@pytest.mark.parametrize(
    ("shift", "widest"),
    [
        (shift_of_mean, 0.004),
        (lambda a, b: shift_of_quantile(a, b, 0.5), 0.005),
        (lambda a, b: shift_of_share(a - 0.4, b - 0.4), 0.015),  # the density is 1, so the shift is the bias
    ],
    ids=["mean", "quantile", "share"],
)
def test_the_true_shift_lies_within(shift: Callable[[Array, Array], float], widest: float, bias: float) -> None:
    held_in, median = held(shift, abs(bias), bias=bias, noise=0.01)
    assert held_in >= SHIFT_LEAST
    assert median <= SHIFT_MARGIN * (abs(bias) + widest)


def test_a_share_is_known_far_better_than_from_the_shots_that_changed_sides() -> None:
    rng = np.random.default_rng(1)
    coarse = rng.random(SHOTS) - 0.4
    fine = coarse + 0.001 * rng.standard_normal(SHOTS)
    assert 0.0 < shift_of_share(coarse, fine) < 0.2 * shift_of_event(1.0 * (coarse > 0.0), 1.0 * (fine > 0.0))


def test_many_shots_that_lie_close_to_the_limit_shift_a_share_by_their_number() -> None:
    """A quarter of the shots within 0.1 of the limit, others as far as 8: a window has the width of all of them."""
    coarse = np.concatenate([np.full(64, -0.1), np.linspace(-8.0, 8.0, 192)])
    fine = coarse + 0.2
    assert shift_of_share(coarse, fine) >= np.mean(fine > 0.0) - np.mean(coarse > 0.0) > 0.25


def test_shots_that_count_at_one_level_alone_shift_a_mean() -> None:
    coarse, fine = np.full(64, 2.0), np.full(64, 2.0)
    coarse[:8], fine[:8] = np.nan, 6.0  # their mean is 2, with them 2.5
    assert shift_of_mean(coarse, fine) > 0.5
    both = np.where(np.arange(64) < 8, np.nan, 2.0)
    assert shift_of_mean(both, both) == 0.0
    assert np.isnan(shift_of_mean(np.full(4, np.nan), fine[:4]))
    assert np.isnan(shift_of_share(np.full(4, np.nan), fine[:4]))


def test_the_side_that_infinite_numbers_are_on_stays() -> None:
    coarse = np.array([np.inf, 1.0, -np.inf, -1.0] * 16)
    assert shift_of_share(coarse, coarse) == 0.0
    turned = np.where(coarse == np.inf, -np.inf, coarse)
    assert shift_of_share(coarse, turned) >= 0.25
