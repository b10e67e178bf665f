"""Mixtures of Student's t distributions as proposals of importance sampling, and their fit to weighted draws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Shared = Sequence[tuple[int, int]]
"""How many of the first numbers are the same within blocks of how many draws, such as ((3, 16), (6, 4))."""

FREEDOM = 10.0
"""Degrees of freedom: tails are heavier than a posterior's, so that no weight is without bound."""
FROM_PRIOR = 0.1
"""Share that is drawn from the prior."""
MOST, DRAWS_EACH = 8, 40
"""Components at most, and effective draws that each of them needs."""
KNOWN_DRAWS, KNOWN_SHARE = 20.0, 0.5
"""Draws that the covariance of a component counts as known before, and which share of the whole covariance they have:
few draws alone make it too narrow."""
KNOWN_PLACES = 2.0
"""Draws that lie at the common mean before, likewise."""
FITTED, PASSES = 4000, 25
"""Draws that a mixture is fitted to at most, and passes over them."""


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
        """Draws in blocks that share their first numbers, shape [count, dimensions].

        Within a block the component, the scale and the first normal numbers are the same. As the factors are
        triangular, so are the first numbers of the draws; each draw alone still has the whole distribution.
        """
        largest = max((block for _, block in shared), default=1)
        blocks = -(-count // largest)
        of = np.repeat(np.arange(blocks), largest)[:count]
        normal = normal_numbers(rng.standard_normal((count, self.centres.shape[1])), shared, rng)
        scale = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, blocks))[of]
        component = rng.choice(len(self.shares), blocks, p=self.shares)[of]
        from_prior = (rng.random(blocks) < FROM_PRIOR)[of]
        turned = np.einsum("nij,nj->ni", self.factors[component], normal)
        return np.where(from_prior[:, None], normal, self.centres[component] + scale[:, None] * turned)

    def log_density(self, points: Array) -> Array:
        """Logarithm of the density at points, shape [points]."""
        from scipy.special import logsumexp
        from scipy.stats import multivariate_t

        own = [
            multivariate_t.logpdf(points, centre, factor @ factor.T, df=FREEDOM)
            for centre, factor in zip(self.centres, self.factors, strict=True)
        ]
        terms = np.stack([*own, log_prior(points)])
        shares = np.append((1.0 - FROM_PRIOR) * self.shares, FROM_PRIOR)
        return np.asarray(logsumexp(terms, axis=0, b=shares[:, None]))

    def _distances(self, points: Array) -> tuple[Array, Array]:
        """Squares of the distances from the centres in units of the scale matrices, shape [components, points], and the
        logarithms of the factors' determinants, shape [components]."""
        inverse = np.linalg.inv(self.factors)
        squares = [
            (((points - centre) @ own.T) ** 2).sum(axis=1) for centre, own in zip(self.centres, inverse, strict=True)
        ]
        return np.stack(squares), np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)


def log_prior(points: Array) -> Array:
    """Logarithm of the standard normal density, shape [points]."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * math.log(2.0 * math.pi))


def normal_numbers(normal: Array, shared: Shared, rng: np.random.Generator) -> Array:
    """Standard normal numbers of draws in blocks: the first ones are those of the first draw of the block, and those
    that no block shares cover their space evenly within each smallest block."""
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


def fitted(points: Array, weights: Array, worth: float, rng: np.random.Generator) -> Mixture:
    """The mixture of weighted draws, by expectation and maximisation; of few components where few draws count.

    Args:
        points: shape [draws, dimensions].
        weights: normalised, shape [draws].
        worth: their effective number.
    """
    from scipy.special import softmax

    middle = weights @ points
    whole = _covariance(points - middle, weights) + 1e-6 * np.eye(len(middle))
    count = int(np.clip(worth / DRAWS_EACH, 1, MOST))
    some = points[rng.choice(len(points), min(FITTED, len(points)), p=weights)]
    if count == 1:
        return Mixture(np.ones(1), middle[None], _factors(whole[None]))
    near = middle + 0.7 * (some[rng.choice(len(some), count)] - middle)
    found = Mixture(np.full(count, 1.0 / count), near, _factors(np.repeat(0.6 * whole[None], count, axis=0)))
    for _ in range(PASSES):
        squares, volumes = found._distances(some)
        log = np.log(found.shares)[:, None] - 0.5 * squares - volumes[:, None]
        own = softmax(log, axis=0) * (worth / len(some))
        draws = own.sum(axis=1)
        centres = (own @ some + KNOWN_PLACES * middle) / (draws + KNOWN_PLACES)[:, None]
        spreads = [
            (_covariance(some - centre, one) + KNOWN_DRAWS * KNOWN_SHARE * whole) / (total + KNOWN_DRAWS)
            for centre, one, total in zip(centres, own, draws, strict=True)
        ]
        shares = (draws + KNOWN_PLACES) / (draws + KNOWN_PLACES).sum()
        found = Mixture(shares, centres, _factors(np.stack(spreads)))
    return found


def _factors(covariances: Array) -> Array:
    """Lower Cholesky factors, of the same shape."""
    return np.linalg.cholesky(covariances).astype(np.float64)


def _covariance(apart: Array, weights: Array) -> Array:
    return np.asarray((weights[:, None] * apart).T @ apart)
