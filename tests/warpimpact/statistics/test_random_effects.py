"""Shares of groups with a positive mean, against models of random effects whose answer is known."""

import numpy as np
import pytest
from scipy.special import ndtr

from warpimpact.statistics.random_effects import FEWEST_GROUPS, interval_of_means, positive_share

TRIALS = 200
LEAST = 181  # 95 % of 200 trials: 190 ± 3.1, three standard deviations below


@pytest.mark.parametrize(
    ("groups", "shots", "between", "mean"),
    [(12, 200, 1.0, 1.5), (64, 2000, 1.0, 1.0), (64, 500, 0.3, 0.4), (1000, 4000, 0.1, 0.2), (64, 2000, 0.5, -0.3)],
)
def test_the_share_of_a_known_model(groups: int, shots: int, between: float, mean: float) -> None:
    """Shots scatter by 1 within a group: the scatter within is up to ten times that between."""
    numbers, known = np.random.default_rng(groups), float(ndtr(mean / between))
    found = []
    for _ in range(TRIALS):
        effects, of = mean + between * numbers.normal(size=groups), numbers.integers(0, groups, shots)
        answer = positive_share(effects[of] + numbers.normal(size=shots), of)
        assert answer is not None
        found.append(answer)
    assert np.mean([answer.share for answer in found]) == pytest.approx(known, abs=0.03)
    assert sum(answer.at_least <= known for answer in found) >= LEAST


def test_the_interval_of_the_true_means_of_a_known_model() -> None:
    """64 groups of 16 numbers, which scatter four times as much as the true means."""
    numbers, covered = np.random.default_rng(7), []
    of = np.tile(np.arange(64), 16)
    for _ in range(TRIALS):
        values = 5.0 + numbers.normal(size=64)[of] + 4.0 * numbers.normal(size=1024)
        low, high = interval_of_means(values, of)
        covered.append(ndtr(high - 5.0) - ndtr(low - 5.0))
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)
    wide = interval_of_means(values, of, beside=1.0)
    assert wide[1] - wide[0] == pytest.approx(np.sqrt(2.0) * (high - low), rel=0.1)
    assert np.isnan(interval_of_means(values[:64], of[:64])).all()


def test_shares_that_seldom_differ() -> None:
    """A few shots of a hundred differ, so that most groups of four shots show no difference at all."""
    numbers, count = np.random.default_rng(2), 0
    rates = 0.02 + np.where(np.arange(400) % 10 < 2, -0.03, 0.01)  # the mean is positive in 80 % of the groups
    for _ in range(TRIALS):
        of = np.repeat(np.arange(400), 4)
        differ = np.sign(rates[of]) * (numbers.uniform(size=len(of)) < np.abs(rates[of]))
        answer = positive_share(differ, of)
        assert answer is not None
        count += answer.at_least <= 0.8
    assert count >= LEAST


def test_without_scatter_within_groups_they_are_counted() -> None:
    of = np.repeat(np.arange(20), 5)
    answer = positive_share(np.where(of < 3, -1.0, 2.0), of)
    assert answer is not None
    assert answer.share == 0.85
    assert answer.at_least < 0.85
    equal = positive_share(np.full(100, 0.5), of)
    assert equal == (1.0, 1.0)


def test_images_count_once() -> None:
    numbers = np.random.default_rng(5)
    of = np.repeat(np.arange(30), 4)
    values = of / 10.0 + numbers.normal(size=120)
    values[17] = np.nan
    answer = positive_share(values, of)
    assert positive_share(np.repeat(values, 3), np.repeat(of, 3), images=3) == pytest.approx(answer)
    assert positive_share(np.repeat(values, 3), np.repeat(of, 3)) != pytest.approx(answer)


def test_too_few_groups() -> None:
    of = np.repeat(np.arange(FEWEST_GROUPS), 2)
    assert positive_share(np.arange(2.0 * FEWEST_GROUPS), of) is not None
    assert positive_share(np.arange(2.0 * FEWEST_GROUPS)[1:], of[1:]) is None
    assert positive_share(np.full(4, np.nan), np.arange(4)) is None
