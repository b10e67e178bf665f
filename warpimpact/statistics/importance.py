"""Adaptive importance sampling of a posterior whose prior is standard normal, and how far its weights can be trusted.

The first round draws from the prior, later ones from a mixture of Student's t distributions that is fitted to the
weighted draws so far (mixture.py). All draws of all rounds count, weighted by prior · likelihood / mixture of all
proposals (Cornuet, Marin, Mira and Robert, "Adaptive multiple importance sampling", 2012). The largest weights are
smoothed, and their Pareto index k says whether they can be trusted (Vehtari, Simpson, Gelman, Yao and Gabry, "Pareto
smoothed importance sampling", 2024).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array
from warpimpact.statistics.mixture import Mixture, Shared, fitted, log_prior, normal_numbers

FEWEST_PER_DIMENSION = 5
"""Effective blocks of draws per dimension that a proposal is fitted to; weights with fewer are tempered."""
LARGEST_K = 0.7
"""Pareto index up to which weights can be trusted."""
_FEWEST_TAIL = 5


@dataclass
class ImportanceSampler:
    """Draws of a posterior in rounds: `propose` points, compute their likelihood, `tell` it.

    Args:
        dimensions: number of parameters; their prior is standard normal.
        shared: leading parameters that a block of draws shares because they are costly to change.
        seed: draws depend on it and on the likelihoods alone.
    """

    dimensions: int
    shared: Shared
    seed: int
    points: Array = field(init=False)
    log_likelihood: Array = field(init=False)
    _proposals: list[tuple[int, Mixture | None]] = field(init=False, default_factory=list)
    _densities: list[Array] = field(init=False, default_factory=list)
    """Logarithm of every proposal's density at the points that existed when it was last computed."""

    def __post_init__(self) -> None:
        self.points = np.empty((0, self.dimensions))
        self.log_likelihood = np.empty(0)

    def propose(self, count: int) -> Array:
        """The points of the next round, shape [count, dimensions]."""
        sequence = np.random.SeedSequence(self.seed, spawn_key=(len(self._proposals),))
        rng = np.random.default_rng(sequence)
        mixture = self._mixture(rng) if len(self.points) else None
        new = self._from_prior(rng, count) if mixture is None else mixture.draw(rng, count, self.shared)
        self._proposals.append((count, mixture))
        self.points = np.concatenate([self.points, new])
        return new

    def tell(self, log_likelihood: Array) -> None:
        """Add the logarithms of the likelihood at the last proposed points."""
        self.log_likelihood = np.concatenate([self.log_likelihood, log_likelihood])

    def _from_prior(self, rng: np.random.Generator, count: int) -> Array:
        from scipy.special import ndtri
        from scipy.stats.qmc import Sobol

        uniform = Sobol(self.dimensions, rng=rng).random(1 << (count - 1).bit_length())[:count]
        return normal_numbers(ndtri(np.clip(uniform, 2.0**-31, 1.0 - 2.0**-31)), self.shared, rng)

    def _mixture(self, rng: np.random.Generator) -> Mixture | None:
        """The proposal of the next round; None if no draw has a positive likelihood."""
        raw = self._raw()
        if not np.isfinite(raw).any():
            return None
        block = min((block for _, block in self.shared), default=1)
        weights = _tempered(raw, FEWEST_PER_DIMENSION * self.dimensions, block)
        return fitted(self.points, weights, _effective(weights, block), rng)

    def _raw(self) -> Array:
        """Logarithms of the weights before they are normalised, shape [draws]."""
        from scipy.special import logsumexp

        total = sum(count for count, _ in self._proposals)
        for place, (_, mixture) in enumerate(self._proposals):
            known = self._densities[place] if place < len(self._densities) else np.empty(0)
            new = self.points[len(known) :]
            at_new = log_prior(new) if mixture is None else mixture.log_density(new)
            self._densities[place : place + 1] = [np.concatenate([known, at_new])]
        terms = [
            math.log(count / total) + density
            for (count, _), density in zip(self._proposals, self._densities, strict=True)
        ]
        raw: Array = log_prior(self.points) + self.log_likelihood - logsumexp(np.stack(terms), axis=0)
        return raw

    def weighed(self) -> Weights:
        """Normalised weights of all draws so far."""
        return Weights.of(self._raw())


@dataclass(frozen=True)
class Weights:
    """Normalised weights of draws, shape [draws], their Pareto index, and the logarithm of the evidence, which is their
    mean before they are normalised."""

    values: Array
    pareto_k: float
    log_evidence: float

    @classmethod
    def of(cls, raw: Array) -> Weights:
        """From logarithms of weights; the largest weights are smoothed."""
        from scipy.special import logsumexp

        evidence = float(logsumexp(raw) - math.log(len(raw)))
        if not math.isfinite(evidence):
            return cls(np.full(len(raw), 1.0 / len(raw)), math.inf, -math.inf)
        values, k = _smoothed(np.exp(raw - raw.max()))
        return cls(values / values.sum(), k, evidence)

    def effective(self, block: int = 1) -> float:
        """Effective sample size. The draws of a block count as one, because they share most of their numbers."""
        return _effective(self.values, block)


def _effective(weights: Array, block: int) -> float:
    """Number of equally weighted blocks of draws with the same variance of a mean (Kish)."""
    of_blocks = np.add.reduceat(weights, np.arange(0, len(weights), block))
    return float(of_blocks.sum() ** 2 / (of_blocks**2).sum())


def resampled(weights: Array, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of draws in proportion to their weights, by systematic resampling, in random order; shape [count]."""
    places = (np.arange(count) + rng.random()) / count
    which = np.searchsorted(np.cumsum(weights) / weights.sum(), places, side="right")
    chosen: NDArray[np.int64] = rng.permutation(np.minimum(which, len(weights) - 1))
    return chosen


def _tempered(raw: Array, effective: float, block: int) -> Array:
    """Normalised weights, raised to the largest power up to 1 with at least this effective size by blocks."""

    def at(power: float) -> Array:
        log = np.where(np.isfinite(raw), power * raw, -np.inf)
        weights: Array = np.exp(log - log.max())
        return np.asarray(weights / weights.sum())

    wanted = min(effective, 0.5 * np.isfinite(raw).sum() / block)
    low, high = 0.0, 1.0
    if _effective(at(1.0), block) >= wanted:
        return at(1.0)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _effective(at(middle), block) >= wanted else (low, middle)
    return at(low)


def _smoothed(weights: Array) -> tuple[Array, float]:
    """Weights, the largest replaced by quantiles of a Pareto distribution, and the index k of that distribution."""
    from scipy.stats import genpareto

    count = len(weights)
    tail = math.ceil(min(0.2 * count, 3.0 * math.sqrt(count)))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]] if tail < count else 0.0
    beyond = weights[order[-tail:]] - cut
    if tail < _FEWEST_TAIL or (beyond > 0.0).sum() < _FEWEST_TAIL:
        return weights, math.inf
    k, sigma = pareto_fit(beyond)
    quantiles = genpareto.ppf((np.arange(tail) + 0.5) / tail, k, scale=sigma)
    smooth = weights.copy()
    smooth[order[-tail:]] = np.minimum(cut + quantiles, weights.max())
    return smooth, k


def pareto_fit(beyond: Any) -> tuple[float, float]:
    """Index k and scale of a generalized Pareto distribution of positive numbers.

    This is the quasi-Bayesian estimate of Zhang and Stephens (Technometrics 51, 2009, 316), with a prior for k = 0.5
    that counts as ten numbers.
    """
    x = np.sort(np.asarray(beyond, dtype=np.float64))
    x = np.maximum(x, 1e-300)
    count = len(x)
    grid = 30 + int(math.sqrt(count))
    quarter = x[int(count / 4.0 + 0.5) - 1]
    places = 1.0 / x[-1] + (1.0 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3.0 * quarter)
    places = np.where(places == 0.0, 1e-12 / x[-1], places)
    k = np.log1p(-places[:, None] * x).mean(axis=1)
    profile = count * (np.log(-places / k) - k - 1.0)
    with np.errstate(over="ignore"):
        weights = 1.0 / np.exp(profile - profile[:, None]).sum(axis=1)
    theta = float((places * weights).sum() / weights.sum())
    shape = float(np.log1p(-theta * x).mean())
    return (count * shape + 5.0) / (count + 10.0), -shape / theta
