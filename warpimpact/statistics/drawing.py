"""Draws of the states of cores behind a plate, from two fast laws at all hits and finite elements at some.

The elements' features (scene/exit_state.py) are regressed on those of the laws. The weights have a prior from plates
whose hits all were computed by elements (`LawError`), so that the draws are the law's own error without elements, and
the elements' own evidence with many. Residuals are drawn jointly. All unknowns are drawn together by Gibbs' sampler (A.
Gelman and others, Bayesian Data Analysis, 3rd ed., chapters 11 and 15), one chain for each draw.

A hit that elements stop has at most an energy below zero, which is drawn from what the regression leaves (censoring: J.
Tobin, Econometrica 26 (1958) 24).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from warpimpact.statistics.intervals import Array
from warpimpact.statistics.law_error import LawError, LawErrors
from warpimpact.statistics.state_regression import (
    VECTORS,
    Design,
    Evidence,
    design_of,
    evidence_of,
    log_density,
    weight_parts,
)

ITERATIONS = 30
"""Of Gibbs' sampler for each draw; it starts from the prior."""
WEIGHT_FREEDOM = np.array([2.5, 2.0])
"""Degrees of freedom of the priors of the weights of the energy loss and of vectors, Student distributions: some plates
are unlike all others. A wrong strength changes all losses alike, by more than plates of known materials show."""

EVIDENCE = 0.5
"""For how many hits one by elements counts: what a regression leaves is no noise, but depends on the hit (a power of
the likelihood: C. C. Holmes and S. G. Walker, Biometrika 104 (2017) 497)."""


class Unknowns(NamedTuple):
    """Draws of what a regression leaves unknown.

    Attributes:
        weights: [count, k].
        along, across: covariances of the residuals, [count, 4, 4] and [count, 3, 3].
        profile: number of the profile of the scales, [count].
    """

    weights: Array
    along: Array
    across: Array
    profile: NDArray[np.int64]


def draw_unknowns(known: Evidence, count: int, bits: np.random.PCG64, error: LawError) -> Unknowns:
    """Draws of weights, residual covariances and scales, given hits by elements and what other plates say."""
    numbers = np.random.Generator(bits)
    spread = np.sqrt(WEIGHT_FREEDOM / numbers.chisquare(WEIGHT_FREEDOM, (count, 2)))[:, weight_parts(len(error.mean))]
    root = np.linalg.cholesky(error.covariance)
    normal = numbers.standard_normal((count, len(error.mean)))
    now = Unknowns(
        error.mean + spread * (normal @ root.T),
        _inverse_wishart(error.along, error.freedom, np.zeros((count, 4, 4)), 0, numbers),
        _inverse_wishart(error.across, error.freedom, np.zeros((count, 3, 3)), 0, numbers),
        numbers.choice(len(error.profiles), size=count, p=error.profiles / error.profiles.sum()),
    )
    if not len(known.along):
        return now
    gibbs = _Gibbs(known, count, error, numbers)
    for _ in range(ITERATIONS):
        now, spread = gibbs.step(now, spread)
    return now


class _Gibbs:
    """Gibbs' sampler of some chains, given hits by elements."""

    def __init__(self, known: Evidence, count: int, error: LawError, numbers: np.random.Generator) -> None:
        self.known, self.error, self.numbers = known, error, numbers
        self.precision, self.part = np.linalg.inv(error.covariance), weight_parts(len(error.mean))
        scaled = [known.scaled(profile) for profile in range(len(error.profiles))]
        self.by = [np.stack([one[side][1] for one in scaled]) for side in range(2)]
        self.scales = [np.stack([one[side][2] for one in scaled]) for side in range(2)]
        self.squares = [np.stack([_squares(by) for by in one]) for one in self.by]
        self.targets = [np.repeat(values[None], count, axis=0) for values in (known.along, known.across)]

    def step(self, now: Unknowns, spread: Array) -> tuple[Unknowns, Array]:
        """The next state of the chains: cores that are stopped, then weights, covariances and profiles."""
        self._impute(now)
        weights, spread = self._weights(now, spread)
        along, across = self._covariances(weights, now.profile)
        return Unknowns(weights, along, across, self._profiles(weights, (along, across))), spread

    def _weights(self, now: Unknowns, spread: Array) -> tuple[Array, Array]:
        """Weights, and the factors on the standard deviations of their prior."""
        error, (count, k) = self.error, spread.shape
        normal = self.precision / (spread[:, :, None] * spread[:, None])
        right = np.einsum("kij,j->ki", normal, error.mean)
        covariances = now.along, now.across
        for place in np.unique(now.profile):
            which = now.profile == place
            for covariance, squares, by, scales, target in zip(
                covariances, self.squares, self.by, self.scales, self.targets, strict=True
            ):
                inverse = EVIDENCE * np.linalg.inv(covariance[which])
                rows = len(inverse)
                normal[which] += (inverse.reshape(rows, -1) @ squares[place]).reshape(rows, k, k)
                weighted = (target[which] / scales[place]) @ inverse
                right[which] += weighted.reshape(rows, -1) @ by[place].reshape(-1, k)
        lower = np.linalg.cholesky(normal)
        half = np.linalg.solve(lower, right[..., None]) + self.numbers.standard_normal((count, k, 1))
        weights = np.asarray(np.linalg.solve(np.swapaxes(lower, 1, 2), half)[..., 0], dtype=np.float64)
        off = weights - error.mean
        distances = (off @ self.precision * off) @ np.eye(2)[self.part]
        freedom = WEIGHT_FREEDOM + np.bincount(self.part)
        variances = (WEIGHT_FREEDOM + distances) / self.numbers.chisquare(freedom, (count, 2))
        return weights, np.sqrt(variances)[:, self.part]

    def _residuals(self, weights: Array) -> list[Array]:
        """What weights leave of the targets, along and across, [count, n, 4] and [count, n, 3]."""
        by = self.known.along_by, self.known.across_by
        return [target - predicted(one, weights) for target, one in zip(self.targets, by, strict=True)]

    def _covariances(self, weights: Array, profile: NDArray[np.int64]) -> list[Array]:
        shared = self.error.along, self.error.across
        draws = []
        for residuals, scales, prior in zip(self._residuals(weights), self.scales, shared, strict=True):
            one = residuals / scales[profile]
            sums = EVIDENCE * np.swapaxes(one, 1, 2) @ one
            more = EVIDENCE * one.shape[1]
            draws.append(_inverse_wishart(prior, self.error.freedom, sums, more, self.numbers))
        return draws

    def _profiles(self, weights: Array, covariances: tuple[Array, Array]) -> NDArray[np.int64]:
        """Profiles by their probability, drawn by the largest sum with a Gumbel number."""
        likely = np.tile(np.log(self.error.profiles), (len(weights), 1))
        for residuals, covariance, scales in zip(self._residuals(weights), covariances, self.scales, strict=True):
            for place, of_profile in enumerate(scales):
                likely[:, place] += EVIDENCE * log_density(residuals / of_profile, covariance, of_profile)
        return np.asarray(np.argmax(likely + self.numbers.gumbel(size=likely.shape), axis=1))

    def _impute(self, now: Unknowns) -> None:
        """Fill in the targets of stopped cores: a loss beyond the least one, and vectors that go with it."""
        which = np.flatnonzero(self.known.stopped)
        if not len(which):
            return
        scales = [one[now.profile][:, which] for one in self.scales]
        by = self.known.along_by[which], self.known.across_by[which]
        expected = [predicted(one, now.weights) for one in by]
        deviation = np.sqrt(now.along[:, :1, 0])
        least = (self.known.least[which] - expected[0][..., 0]) / (scales[0][..., 0] * deviation)
        excess = deviation * _beyond(least, self.numbers)
        slope = now.along[:, 0, 1:] / now.along[:, :1, 0]
        left = now.along[:, 1:, 1:] - slope[:, :, None] * now.along[:, :1, 1:]
        normal = self.numbers.standard_normal((2, *excess.shape, VECTORS))
        own, aside = (
            one @ np.swapaxes(np.linalg.cholesky(covariance), 1, 2)
            for one, covariance in zip(normal, (left, now.across), strict=True)
        )
        along = np.concatenate([excess[..., None], excess[..., None] * slope[:, None] + own], axis=2)
        self.targets[0][:, which] = expected[0] + scales[0] * along
        self.targets[1][:, which] = expected[1] + scales[1] * aside


def predicted(by: Array, weights: Array) -> Array:
    """Targets [count, hits, rows] by regressors [hits, rows, k] and weights [count, k]."""
    # Not by BLAS, whose threads would wait in a loop for the next product and take cores from others.
    return np.asarray(np.einsum("ck,hrk->chr", weights, by))


def _squares(by: Array) -> Array:
    """Sums over hits of products of regressors, for each pair of rows, [rows², k²]."""
    rows, k = by.shape[1:]
    return np.asarray(np.einsum("nai,nbj->abij", by, by, optimize=True).reshape(rows**2, k**2))


def _beyond(least: Array, numbers: np.random.Generator) -> Array:
    """Normal numbers beyond bounds."""
    above = special.ndtr(-least) * numbers.uniform(size=least.shape)
    return np.asarray(np.maximum(-special.ndtri(np.maximum(above, 1e-300)), least))


def _inverse_wishart(mean: Array, freedom: Array, sums: Array, more: float, numbers: np.random.Generator) -> Array:
    """Draws of covariances, [count, rows, rows], from their prior and residuals, by Bartlett's decomposition.

    Args:
        mean: of the prior, [rows, rows], with its degrees of freedom.
        sums: of products of residuals, [count, rows, rows].
        more: number of these residuals.
    """
    count, rows = sums.shape[:2]
    lower = np.zeros((count, rows, rows))
    for row in range(rows):
        lower[:, row, row] = np.sqrt(numbers.chisquare(float(freedom) + more - row, count))
        lower[:, row, :row] = numbers.standard_normal((count, row))
    # With Ψ = R Rᵀ and a Wishart draw A Aᵀ of unit scale, R A⁻ᵀ A⁻¹ Rᵀ is inverse Wishart.
    root = np.linalg.cholesky(mean * (float(freedom) - rows - 1.0) + sums)
    half = np.linalg.solve(lower, np.swapaxes(root, 1, 2))
    return np.asarray(np.swapaxes(half, 1, 2) @ half)


def draw_states(
    law: Array,
    second: Array | None,
    elements: Array,
    at: NDArray[np.int64],
    *,
    count: int,
    seed: int,
    error: LawErrors,
    hits: slice = slice(None),
    numbers: NDArray[np.int64] | None = None,
) -> Array:
    """Draws of the states of the hits of a map, features of shape [count, hits, 7].

    Args:
        law: features by the fast law, [hits, 7]; a core that stops has an energy below zero.
        second: by the second law, if there is one.
        elements: by elements, [n, 7]; of a core that stops the most that its energy may be, 0 or less, and all else
            NaN. The others are kept in each draw.
        at: their places among the hits, [n].
        count: number of draws.
        seed: of the random numbers; the same seed gives the same draws.
        error: what other plates say on the laws.
        hits: range of the hits to draw, whose draws are those of the whole map.
        numbers: of all hits, from which their random numbers follow; by default their places. With numbers, the hits
            before the range give the map's means.
    """
    first, last, _ = hits.indices(len(law))
    every = np.arange(len(law)) if numbers is None else numbers
    design = design_of(law, second, slice(None) if numbers is None else slice(first or None))
    touched = ~design.untouched[at]
    known = evidence_of(design, elements[touched], at[touched])
    table = error.alone if second is None else error.both
    weights, *covariances, profile = draw_unknowns(known, count, _generator(seed, 0), table)
    some = Design._make(part[first:last] for part in design)
    along, across = (predicted(by, weights) for by in (some.along, some.across))
    normal = _normals(seed, every[first:last], count)
    parts = normal[..., : 1 + VECTORS], normal[..., 1 + VECTORS :]
    own, aside = (
        part @ np.swapaxes(np.linalg.cholesky(covariance), 1, 2)
        for covariance, part in zip(covariances, parts, strict=True)
    )
    scales = np.swapaxes(some.scales[:, profile], 0, 1)
    along += own * scales[..., [0, *[1] * VECTORS]]
    across += aside * scales[..., 1:]
    drawn = some.features(along, across)
    drawn[:, some.untouched] = law[first:last][some.untouched]
    return _with_elements(drawn, elements, at - first)


def _generator(seed: int, stream: int) -> np.random.PCG64:
    return np.random.PCG64([seed, stream])


def _normals(seed: int, numbers: NDArray[np.int64], count: int) -> Array:
    """Normal numbers of some hits, [count, hits, 7]; those of a hit do not depend on which others are drawn."""
    each = count * (1 + 2 * VECTORS)
    uniform = [
        np.random.Generator(_generator(seed, 1).advance(int(run[0]) * each)).random((len(run), count, 1 + 2 * VECTORS))
        for run in np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    ]
    return np.swapaxes(special.ndtri(np.maximum(np.concatenate(uniform), 2.0**-54)), 0, 1)


def _with_elements(drawn: Array, elements: Array, places: NDArray[np.int64]) -> Array:
    """Draws that have what elements say at these places: states, or that a core stops."""
    here = (places >= 0) & (places < drawn.shape[1])
    passed, stopped = here & (elements[:, 0] > 0.0), here & ~(elements[:, 0] > 0.0)
    drawn[:, places[passed]] = elements[passed]
    most, energy = elements[stopped, 0], drawn[:, places[stopped], 0]
    drawn[:, places[stopped], 0] = most - np.abs(energy - most)
    return drawn
