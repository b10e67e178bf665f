"""The error of the fast laws, learnt from plates of which finite elements computed every hit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from warpimpact.statistics.intervals import Array
from warpimpact.statistics.state_regression import (
    PROFILES,
    VECTORS,
    Evidence,
    design_of,
    evidence_of,
    log_density,
    weight_parts,
)

FREEDOM = 12.0
"""Degrees of freedom of the residual covariances between plates."""
STEPS = 40
"""Of the expectation and maximisation."""
WEIGHT_SPREAD, WEIGHT_PLATES = 0.3, 2.0
"""Standard deviation of weights between plates before any plate is known, and how many plates that counts for."""
UNCORRELATED = 0.3
"""Share of the covariances between weights that is taken for chance: few plates know them."""
FIRST_RESIDUAL, FIRST_WEIGHT = 0.05, 4.0
"""Variances of residuals and weights that the iteration starts from."""
WEIGHT_MARGIN, RESIDUAL_MARGIN = 1.5, 1.3
"""Factors on the covariances of weights and residuals: a plate that is not stored differs more than the stored ones."""
DIGITS = 4
"""Significant digits of a table."""


class PlateStates(NamedTuple):
    """Features of the hits of a plate, [hits, 7] each; `elements` as in `draw_states`."""

    law: Array
    second: Array
    elements: Array


@dataclass(frozen=True)
class LawError:
    """What plates say on the weights of a regression, and on its residuals in the scales of a `Design`.

    Attributes:
        mean: of the weights between plates, [weights].
        covariance: of the weights between plates, [weights, weights].
        along: mean covariance of the residuals of energy and of vectors along the laws' own, [4, 4].
        across: mean covariance of the residuals of vectors across the laws' own, [3, 3].
        freedom: of these two between plates (inverse Wishart), a number.
        profiles: share of the plates that each profile of the scales suits best, [profiles].
    """

    mean: Array
    covariance: Array
    along: Array
    across: Array
    freedom: Array
    profiles: Array

    @classmethod
    def from_numbers(cls, numbers: Mapping[str, object]) -> LawError:
        """From what `numbers` gives."""
        return cls(*(np.array(numbers[field.name], dtype=np.float64) for field in fields(cls)))

    @property
    def numbers(self) -> dict[str, object]:
        """Rounded numbers for a file."""
        return {name: _rounded(values) for name, values in asdict(self).items()}


def _rounded(values: Array) -> object:
    return np.vectorize(lambda value: float(f"{value:.{DIGITS}g}"))(values).tolist()


@dataclass(frozen=True)
class LawErrors:
    """The error of two laws together, and of the first alone."""

    both: LawError
    alone: LawError

    @classmethod
    def from_numbers(cls, numbers: Mapping[str, Mapping[str, object]]) -> LawErrors:
        """From what `numbers` gives."""
        return cls(*(LawError.from_numbers(numbers[field.name]) for field in fields(cls)))

    @property
    def numbers(self) -> dict[str, dict[str, object]]:
        """Rounded numbers for a file."""
        return {"both": self.both.numbers, "alone": self.alone.numbers}


def learn_errors(plates: Sequence[PlateStates], like: Sequence[int]) -> LawErrors:
    """The error of the laws over some plates.

    Args:
        like: places of plates that have a resistance of the same source, from which the weights of the energy loss are
            learnt. All else is learnt from all.
    """
    learnt = []
    for laws in (2, 1):
        known, first = [_evidence(plate, plate.second if laws == 2 else None) for plate in plates], first_mean(laws)
        of_all, of_like = learn_error(known, first), learn_error([known[place] for place in like], first)
        of_loss = weight_parts(len(first)) == 0
        mean = np.where(of_loss, of_like.mean, of_all.mean)
        covariance = np.where(of_loss & of_loss[:, None], of_like.covariance, of_all.covariance)
        learnt.append(replace(of_all, mean=mean, covariance=covariance))
    return LawErrors(*learnt)


def _evidence(plate: PlateStates, second: Array | None) -> Evidence:
    """The hits of a plate that pass by elements and that a law sees."""
    design = design_of(plate.law, second)
    known = evidence_of(design, plate.elements, np.arange(len(plate.law)))
    return Evidence._make(part[~known.stopped & ~design.untouched] for part in known)


def first_mean(laws: int) -> Array:
    """Weights that take the mean of some laws for true, in the order of `design_of`."""
    own = np.zeros((VECTORS, laws * VECTORS + 2))
    for vector in range(VECTORS):
        own[vector, vector : laws * VECTORS : VECTORS] = 1.0 / laws
    return np.concatenate([[0.0, 0.0], np.full(laws, 1.0 / laws), own.ravel()])


def learn_error(plates: Sequence[Evidence], first: Array) -> LawError:
    """Mean and covariance of weights and residuals between plates, by expectation and maximisation.

    Each plate's weights are normal given those of all (A. P. Dempster, N. M. Laird, D. B. Rubin, Journal of the Royal
    Statistical Society B 39 (1977) 1).

    Args:
        first: mean of the weights to start from, [weights].
    """
    k, count, part = len(first), len(plates), weight_parts(len(first))
    mean: Array = first
    covariance: Array = FIRST_WEIGHT * np.eye(k)
    shared = FIRST_RESIDUAL * np.eye(1 + VECTORS), FIRST_RESIDUAL * np.eye(VECTORS)
    own, profiles = [shared] * count, [len(PROFILES) // 2] * count
    for _ in range(STEPS):
        prior = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        weights, left = np.empty((count, k)), np.zeros((k, k))
        for place, plate in enumerate(plates):
            scaled = plate.scaled(profiles[place])
            weights[place], open_, own[place] = _one_plate(scaled, prior, mean, own[place], shared)
            profiles[place] = best_profile(plate, weights[place], own[place])
            left += open_
        mean = weights.mean(axis=0)
        off = weights - mean
        covariance = off.T @ off + left + WEIGHT_PLATES * WEIGHT_SPREAD**2 * np.eye(k)
        covariance /= count + WEIGHT_PLATES
        covariance += UNCORRELATED * (np.diag(np.diag(covariance)) - covariance)
        covariance *= part == part[:, None]  # the loss and vectors have priors of their own
        shared = np.mean([one for one, _ in own], axis=0), np.mean([other for _, other in own], axis=0)
    suits = (np.bincount(profiles, minlength=len(PROFILES)) + 1.0) / (count + len(PROFILES))
    along, across = (RESIDUAL_MARGIN * one for one in shared)
    return LawError(mean, WEIGHT_MARGIN * covariance, along, across, freedom=np.array(FREEDOM), profiles=suits)


def best_profile(plate: Evidence, weights: Array, own: Covariances) -> int:
    """The profile of the scales of a plate under which its residuals are most likely."""
    likelihoods = [
        sum(
            float(log_density(target - by @ weights, covariance, scales))
            for (target, by, scales), covariance in zip(plate.scaled(profile), own, strict=True)
        )
        for profile in range(len(PROFILES))
    ]
    return int(np.argmax(likelihoods))


Covariances = tuple[Array, Array]
Scaled = tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]


def _one_plate(
    scaled: Scaled, prior: Array, mean: Array, own: Covariances, shared: Covariances
) -> tuple[Array, Array, Covariances]:
    """Expected weights of a plate, what is left open of them, and its covariances of residuals along and across."""
    normal, right = prior, prior @ mean
    for (target, by, _), covariance in zip(scaled, own, strict=True):
        inverse = np.linalg.inv(covariance)
        normal = normal + np.einsum("nai,ab,nbj->ij", by, inverse, by)
        right = right + np.einsum("nai,ab,nb->i", by, inverse, target)
    open_ = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    weights, covariances = open_ @ right, []
    for (target, by, _), covariance in zip(scaled, shared, strict=True):
        residuals = target - by @ weights
        squares = residuals.T @ residuals + np.einsum("nai,ij,nbj->ab", by, open_, by)
        known = FREEDOM - len(covariance) - 1.0
        covariances.append((known * covariance + squares) / (FREEDOM + len(target)))
    return weights, open_, (covariances[0], covariances[1])
