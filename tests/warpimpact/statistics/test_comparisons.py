"""Intervals of differences and ratios against closed forms."""

import math

import numpy as np
import pytest

from warpimpact.statistics.comparisons import Ratio, difference_of_independent
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
