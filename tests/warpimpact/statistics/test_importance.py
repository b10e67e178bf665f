"""Importance sampling against posteriors with a closed form."""

import numpy as np
import pytest
from scipy.stats import genpareto, multivariate_normal

from warpimpact.statistics.importance import ImportanceSampler, Weights, pareto_fit, resampled


@pytest.fixture(scope="module")
def linear() -> tuple[np.ndarray, np.ndarray, float]:
    """Matrix and data of a linear model with normal errors, whose posterior is normal."""
    rng = np.random.default_rng(1)
    return rng.standard_normal((6, 6)), np.array([1.0, -1.0, 2.0, 0.5, 0.0, 1.0]), 0.7


def drawn(linear: tuple[np.ndarray, np.ndarray, float], rounds: list[int]) -> tuple[ImportanceSampler, Weights]:
    matrix, data, std = linear
    sampler = ImportanceSampler(6, [(2, 16), (4, 4)], seed=0)
    for count in rounds:
        points = sampler.propose(count)
        sampler.tell(multivariate_normal(data, std**2 * np.eye(6)).logpdf(points @ matrix.T))
    return sampler, sampler.weighed()


def test_a_normal_posterior_is_met(linear: tuple[np.ndarray, np.ndarray, float]) -> None:
    matrix, data, std = linear
    sampler, weights = drawn(linear, [1024] * 9)
    precision = np.eye(6) + matrix.T @ matrix / std**2
    mean, spread = np.linalg.solve(precision, matrix.T @ data / std**2), np.sqrt(np.diag(np.linalg.inv(precision)))
    found = weights.values @ sampler.points
    assert weights.effective(4) > 500
    assert weights.pareto_k < 0.5
    # The standard error of a mean is spread/√(effective size): five of them.
    assert np.abs(found - mean) == pytest.approx(0.0, abs=5.0 * spread.max() / np.sqrt(weights.effective(4)))
    assert np.sqrt(weights.values @ (sampler.points - found) ** 2) == pytest.approx(spread, rel=0.15)
    evidence = multivariate_normal(np.zeros(6), matrix @ matrix.T + std**2 * np.eye(6)).logpdf(data)
    assert weights.log_evidence == pytest.approx(evidence, abs=0.25)


def test_few_draws_of_a_narrow_posterior_are_not_trusted(linear: tuple[np.ndarray, np.ndarray, float]) -> None:
    _, weights = drawn((*linear[:2], 0.05), [256])
    assert weights.effective() < 10
    assert weights.pareto_k > 0.7


def test_blocks_share_their_first_numbers(linear: tuple[np.ndarray, np.ndarray, float]) -> None:
    sampler, _ = drawn(linear, [64, 64])
    for points in np.split(sampler.points, 2):
        for first, block in ((2, 16), (4, 4)):
            apart = points.reshape(-1, block, 6)[:, :, :first]
            assert (apart == apart[:, :1]).all()
        assert len(np.unique(points, axis=0)) == 64


def test_the_pareto_index_is_found() -> None:
    for k in (0.2, 0.5, 0.9):
        found, scale = pareto_fit(genpareto.rvs(k, scale=3.0, size=4000, random_state=5))
        assert found == pytest.approx(k, abs=0.08)
        assert scale == pytest.approx(3.0, rel=0.12)


def test_equal_weights_are_worth_all_draws() -> None:
    weights = Weights.of(np.zeros(100) + 1e-9 * np.arange(100))
    assert weights.effective() == pytest.approx(100.0)
    assert weights.effective(4) == pytest.approx(25.0)


def test_draws_without_likelihood_have_no_evidence() -> None:
    assert Weights.of(np.full(10, -np.inf)).log_evidence == -np.inf


def test_resampling_keeps_the_weights() -> None:
    weights = np.array([0.1, 0.0, 0.6, 0.3])
    chosen = resampled(weights, 1000, np.random.default_rng(0))
    assert np.bincount(chosen, minlength=4) == pytest.approx(1000 * weights, abs=1)
