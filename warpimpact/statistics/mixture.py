"""Mixtures of Student's t distributions as proposals of importance sampling, and their fit to weighted draws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpimpact.statistics.intervals import Array

Shared = Sequence[tuple[int, int]]
"""Pairs (leading numbers, draws): a block of that many draws has the same leading numbers, as in ((3, 16), (6, 4))."""

FREEDOM = 10.0
"""Degrees of freedom: the tails are heavier than those of a posterior, so that weights are bounded."""
FROM_PRIOR = 0.1
"""Share of the blocks that is drawn from the prior."""
MOST, DRAWS_EACH = 8, 40
"""Largest number of components, and effective draws per component."""
PRIOR_DRAWS, PRIOR_SHARE = 20.0, 0.5
"""Prior of a component's covariance, because that of a few draws alone is too narrow: its weight in draws, and its size
as a share of the covariance of all draws."""
PRIOR_DRAWS_OF_CENTRE = 2.0
"""Weight of the prior of a component's centre, the mean of all draws, in draws."""
FITTED, PASSES = 4000, 25
"""Largest number of draws in a fit, and number of passes over them."""


@dataclass(frozen=True)
class Mixture:
    """A mixture of Student's t distributions, mixed with FROM_PRIOR of the standard normal prior.

    Attributes:
        shares: of the components, shape [components].
        centres: shape [components, dimensions].
        factors: lower Cholesky factors of their scale matrices, shape [components, dimensions, dimensions].
    """

    shares: Array
    centres: Array
    factors: Array

    def draw(self, rng: np.random.Generator, count: int, shared: Shared) -> Array:
        """Draws in blocks that share their leading numbers, shape [count, dimensions].

        A block has one component, one scale and the same leading normal numbers. The factors are triangular, so the
        leading numbers of the draws are the same, too. Each single draw has the distribution of the mixture.
        """
        largest = max((block for _, block in shared), default=1)
        blocks = -(-count // largest)
        block_of = np.repeat(np.arange(blocks), largest)[:count]
        normal = normal_numbers(rng.standard_normal((count, self.centres.shape[1])), shared, rng)
        scale = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, blocks))[block_of]
        component = rng.choice(len(self.shares), blocks, p=self.shares)[block_of]
        from_prior = (rng.random(blocks) < FROM_PRIOR)[block_of]
        turned = np.einsum("nij,nj->ni", self.factors[component], normal)
        return np.where(from_prior[:, None], normal, self.centres[component] + scale[:, None] * turned)

    def log_density(self, points: Array) -> Array:
        """Logarithm of the density at points, shape [points]."""
        from scipy.special import logsumexp
        from scipy.stats import multivariate_t

        of_components = [
            multivariate_t.logpdf(points, centre, factor @ factor.T, df=FREEDOM)
            for centre, factor in zip(self.centres, self.factors, strict=True)
        ]
        terms = np.stack([*of_components, log_prior(points)])
        shares = np.append((1.0 - FROM_PRIOR) * self.shares, FROM_PRIOR)
        return np.asarray(logsumexp(terms, axis=0, b=shares[:, None]))

    def _distances(self, points: Array) -> tuple[Array, Array]:
        """Squared Mahalanobis distances from the centres, shape [components, points], and logarithms of the factors'
        determinants, shape [components]."""
        inverses = np.linalg.inv(self.factors)
        squares = [
            (((points - centre) @ inverse.T) ** 2).sum(axis=1)
            for centre, inverse in zip(self.centres, inverses, strict=True)
        ]
        return np.stack(squares), np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)


def log_prior(points: Array) -> Array:
    """Logarithm of the standard normal density, shape [points]."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * math.log(2.0 * math.pi))


def normal_numbers(normal: Array, shared: Shared, rng: np.random.Generator) -> Array:
    """Standard normal numbers of draws in blocks, shape [draws, dimensions].

    The draws of a block share the leading numbers of its first draw. Numbers that no block shares are shifted Sobol
    points in each of the smallest blocks.
    """
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol

    normal = normal.copy()
    for first, block in sorted(shared, reverse=True):  # blocks that share less are larger
        normal[:, :first] = normal[np.arange(len(normal)) // block * block, :first]
    first, block = max(shared, default=(normal.shape[1], 1))
    free = normal.shape[1] - first
    if free and block > 1:
        net = Sobol(free, scramble=False).random(1 << (block - 1).bit_length())[:block]
        shifts = rng.random((-(-len(normal) // block), 1, free))
        uniform = np.mod(net + shifts, 1.0).reshape(-1, free)[: len(normal)]
        normal[:, first:] = ndtri(np.clip(uniform, 2.0**-31, 1.0 - 2.0**-31))
    return normal


def fitted(points: Array, weights: Array, effective: float, rng: np.random.Generator) -> Mixture:
    """Mixture fitted to draws, shape [draws, dimensions], with normalised weights, shape [draws], by expectation and
    maximisation. Fewer effective draws give fewer components. `rng` chooses the draws that are fitted, and the first
    centres."""
    from scipy.special import softmax

    middle = weights @ points
    whole = _covariance(points - middle, weights) + 1e-6 * np.eye(len(middle))
    count = int(np.clip(effective / DRAWS_EACH, 1, MOST))
    sample = points[rng.choice(len(points), min(FITTED, len(points)), p=weights)]
    if count == 1:
        return Mixture(np.ones(1), middle[None], _factors(whole[None]))
    near = middle + 0.7 * (sample[rng.choice(len(sample), count)] - middle)
    mixture = Mixture(np.full(count, 1.0 / count), near, _factors(np.repeat(0.6 * whole[None], count, axis=0)))
    for _ in range(PASSES):
        squares, log_volumes = mixture._distances(sample)
        log = np.log(mixture.shares)[:, None] - 0.5 * squares - log_volumes[:, None]
        memberships = softmax(log, axis=0) * (effective / len(sample))
        draws = memberships.sum(axis=1)
        padded = draws + PRIOR_DRAWS_OF_CENTRE
        centres = (memberships @ sample + PRIOR_DRAWS_OF_CENTRE * middle) / padded[:, None]
        covariances = [
            (_covariance(sample - centre, membership) + PRIOR_DRAWS * PRIOR_SHARE * whole) / (total + PRIOR_DRAWS)
            for centre, membership, total in zip(centres, memberships, draws, strict=True)
        ]
        mixture = Mixture(padded / padded.sum(), centres, _factors(np.stack(covariances)))
    return mixture


def _factors(covariances: Array) -> Array:
    """Lower Cholesky factors, of the same shape."""
    return np.linalg.cholesky(covariances).astype(np.float64)


def _covariance(deviations: Array, weights: Array) -> Array:
    return np.asarray((weights[:, None] * deviations).T @ deviations)
