"""Differences and ratios against closed forms; shifts by the numerics: at least the true one, as often as they say."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from warpimpact.statistics.comparisons import (
    SHIFT_MARGIN,
    Ratio,
    difference_of_independent,
    shift_of_event,
    shift_of_mean,
    shift_of_quantile,
    shift_of_share,
)
from warpimpact.statistics.intervals import Estimate, estimate_of


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
TRIALS, SHOTS = 400, 64
# 95 % of 400 trials are 380 ± 4.4; three standard deviations below.
LEAST = 367


def held(shift: Callable[[Array, Array], float], true: float, *, bias: float, noise: float) -> tuple[int, float]:
    """In how many trials the shift of shots uniform in 0 … 1, whose errors have a bias and a noise, is at least the
    true one; and its median."""
    rng = np.random.default_rng(5)
    actual = []
    for _ in range(TRIALS):
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
    assert held_in >= LEAST
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
