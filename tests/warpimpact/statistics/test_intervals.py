"""Intervals of numbers: known values, and how often they contain the answer."""

import numpy as np
import pytest
from scipy import stats

from warpimpact.statistics.intervals import RunningSums, estimate_of, looks

TRIALS = 500
LEAST = 460  # 95 % of 500 trials: 475 ± 4.9, three standard deviations below


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


@pytest.mark.parametrize("replicates", [1, 16])
@pytest.mark.parametrize("kind", ["mean", "share"])
def test_running_sums_give_what_all_numbers_give(kind: str, replicates: int) -> None:
    drawn = np.random.default_rng(4)
    values = drawn.normal(730.0, 10.0, 1000) if kind == "mean" else (drawn.random(1000) < 0.3).astype(float)
    values[drawn.random(1000) < 0.1] = np.nan
    sums = RunningSums(replicates)
    for part in np.array_split(values, 7):
        sums.add(part)
    now, whole = sums.estimate(kind), estimate_of(kind, values, replicates=replicates)
    for name in ("value", "low", "high", "spread", "count"):
        assert getattr(now, name) == pytest.approx(getattr(whole, name), rel=1e-12)
