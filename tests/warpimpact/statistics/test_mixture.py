"""Mixtures as proposals: their density, their fit, and how draws of a block cover what they do not share."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from warpimpact.statistics.mixture import FREEDOM, FROM_PRIOR, Mixture, fitted, log_prior, normal_numbers


@pytest.fixture
def mixture() -> Mixture:
    factors = np.array([[[0.6, 0.0], [0.3, 0.4]], [[0.2, 0.0], [0.0, 0.5]]])
    return Mixture(np.array([0.3, 0.7]), np.array([[0.5, -1.0], [-1.0, 2.0]]), factors)


def test_the_density_is_that_of_the_components_and_the_prior(mixture: Mixture) -> None:
    points = 2.0 * np.random.default_rng(0).standard_normal((50, 2))
    own = [
        share * multivariate_t(centre, factor @ factor.T, FREEDOM).pdf(points)
        for share, centre, factor in zip(mixture.shares, mixture.centres, mixture.factors, strict=True)
    ]
    prior = multivariate_normal(np.zeros(2)).pdf(points)
    assert np.log(prior) == pytest.approx(log_prior(points))
    density = (1.0 - FROM_PRIOR) * np.sum(own, axis=0) + FROM_PRIOR * prior
    assert mixture.log_density(points) == pytest.approx(np.log(density))


@pytest.mark.parametrize("shared", [[], [(1, 4)], [(0, 8)]])
def test_draws_follow_the_density(mixture: Mixture, shared: list[tuple[int, int]]) -> None:
    drawn = mixture.draw(np.random.default_rng(1), 200_000, shared)
    mean = (1.0 - FROM_PRIOR) * mixture.shares @ mixture.centres
    assert drawn.mean(axis=0) == pytest.approx(mean, abs=0.02)
    # E[f/q] over draws of q is the integral of f, a normal distribution within all others.
    inside = multivariate_normal(np.zeros(2), 0.25 * np.eye(2)).logpdf(drawn)
    assert np.exp(inside - mixture.log_density(drawn)).mean() == pytest.approx(1.0, abs=0.03)


def test_a_bent_posterior_has_several_components() -> None:
    """Draws of y = x² − 1 with noise: a mixture explains others of them far better than one component does."""
    rng = np.random.default_rng(2)
    x = rng.standard_normal((2, 2000))
    bent = np.stack([x, x**2 - 1.0 + 0.2 * rng.standard_normal(x.shape)], axis=-1)
    weights = np.full(2000, 1.0 / 2000)
    one, several = (fitted(bent[0], weights, worth, rng) for worth in (40.0, 2000.0))
    assert (len(one.shares), len(several.shares)) == (1, 8)
    assert several.log_density(bent[1]).mean() > one.log_density(bent[1]).mean() + 0.5


def test_numbers_that_are_not_shared_cover_their_space() -> None:
    rng = np.random.default_rng(3)
    numbers = normal_numbers(rng.standard_normal((8000, 3)), [(1, 8)], rng).reshape(-1, 8, 3)
    assert (numbers[:, :, 0] == numbers[:, :1, 0]).all()
    # The variance of the mean of eight independent numbers is 1/8.
    assert numbers[:, :, 1:].mean(axis=1).var(axis=0).max() < 0.4 / 8.0
    assert numbers[:, :, 1:].std(axis=(0, 1)) == pytest.approx(1.0, abs=0.05)
