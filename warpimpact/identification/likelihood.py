"""How well computed shots explain a measured one: the likelihood with the hit point integrated out.

    L = Σ_h w_h S_h N(measured | computed_h, σ² + δ²) / Σ_h w_h S_h

over points h of the cell: w is 1 in the class of the hit, S is 1 where the shot would have been measured (selection), σ
is the uncertainty of the measurement and δ the discrepancy of the model. Given the parameters, shots are independent,
so
their ln L add up. The discrepancies of different numbers are independent, too; the model has no bias that all shots
share.

A point stands for its share of the cell, over which numbers follow a plane (between.py). The covariance of N is
therefore σ² + δ² along the diagonal, plus C Cᵀ, where C are the changes of the numbers over a standard deviation along
y and z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.identification.aim import HitPoints
from warpimpact.identification.between import changes, signs
from warpimpact.identification.measured import Observation
from warpimpact.records.group import failures
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import variables as v
from warpimpact.results.measures import STATUSES, Measure
from warpimpact.results.per_hit import place_of_standoff
from warpimpact.scene.model import Array

KEPT_HITS = 4
"""Number of hit points per set and shot that are kept for the posterior and for the prediction."""


@dataclass(frozen=True)
class Data:
    """The measurements of a shot, and their condition.

    Attributes:
        selection: condition under which the shot was measured.
        standoffs: stand-offs of the record [m].
    """

    observations: tuple[Observation, ...]
    status: str | None
    selection: tuple[Measure, ...] = ()
    standoffs: tuple[float, ...] = ()

    @property
    def values(self) -> Array:
        """The measured numbers, shape [observations]."""
        return np.array([observation.value for observation in self.observations])

    def miss(self, computed: Array) -> Array:
        """Computed minus measured along the last axis, of the same shape."""
        missed = np.empty_like(computed)
        for place, observation in enumerate(self.observations):
            missed[..., place] = observation.miss(computed[..., place])
        return missed

    def spread(self, discrepancy: Mapping[str, Array]) -> Array:
        """√(σ² + δ²), shape [sets, observations]."""
        if not self.observations:
            return np.ones((1, 0))
        return np.stack(
            [np.hypot(observation.std, discrepancy[observation.kind]) for observation in self.observations], axis=-1
        )


@dataclass(frozen=True)
class ShotScore:
    """How one shot fits some sets of parameters; SI and radians.

    Attributes:
        log_likelihood: shape [sets].
        noise: standard error of it by the finite number of hit points, shape [sets].
        misfit: smallest Σ (miss/σ)² over the hit points, shape [sets]; infinite where no shot has the numbers.
        best: computed numbers at the hit of smallest misfit, shape [sets, observations]; best_hit: its place [m], shape
            [sets, 2].
        fitted, fitted_hit: computed numbers and hits drawn from their posterior, shapes [sets, kept, observations] and
            [sets, kept, 2].
        predicted: numbers that another shot like it would show, with uncertainty and discrepancy, NaN where it would
            show none; shape [sets, kept, observations].
    """

    log_likelihood: Array
    noise: Array
    misfit: Array
    best: Array
    best_hit: Array
    fitted: Array
    fitted_hit: Array
    predicted: Array

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Concatenate scores along the sets."""
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})

    def __getitem__(self, which: slice | NDArray[np.int64]) -> Self:
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})


@dataclass(frozen=True)
class Compared:
    """Computed shots beside a measured one, before any scale of discrepancy; SI and radians.

    Attributes:
        computed: numbers of all points, shape [sets, points, observations]; `missed` is computed minus measured.
        changes: changes of the numbers about each computed point, shape [sets, computed points, 2, observations].
        possible: whether the shot ended as the measured one did, with all its numbers, shape [sets, points].
        counts: weight of each point, 0 where the shot would not have been measured, shape [sets, points].
    """

    data: Data
    aim: HitPoints
    computed: Array
    missed: Array
    changes: Array
    possible: NDArray[np.bool_]
    counts: Array

    @classmethod
    def of(cls, data: Data, aim: HitPoints, outcomes: Outcomes, known: Array | None = None) -> Self:
        """Compare sets of parameters with one measured shot.

        Args:
            outcomes: outcomes of all points of the aim, set after set, images included, shape [sets · points].
            known: `changes`, if another shot with the same numbers has them already.
        """
        sets, points = aim.weight.shape
        computed = np.empty((sets, points, len(data.observations)))
        for place, observation in enumerate(data.observations):
            computed[:, :, place] = observation.of(outcomes).reshape(sets, points)
            if observation.is_limit:
                computed[:, :, place] = _median(computed[:, :, place], aim.weight)
        counts = aim.weight * _counted(data, outcomes).reshape(sets, points)
        missed = data.miss(computed)
        possible = (counts > 0.0) & ~np.isnan(missed).any(axis=-1)
        if data.status is not None:
            possible &= outcomes.status.reshape(sets, points) == STATUSES[data.status]
        about = changes(data.observations, aim, computed) if known is None else known
        return cls(data, aim, computed, missed, about, possible, counts)

    def score(
        self, discrepancy: Mapping[str, Array], rng: np.random.Generator, of: NDArray[np.int64] | None = None
    ) -> ShotScore:
        """Score the sets with scales of discrepancy.

        Args:
            discrepancy: standard deviations by kind, each of shape [sets].
            rng: draws the hits that are kept.
            of: index of the computed set of each set, shape [sets]. Sets with the same index differ in the scales
                alone.
        """
        row = np.arange(len(self.computed)) if of is None else of
        spread = np.broadcast_to(self.data.spread(discrepancy), (len(row), self.computed.shape[-1]))
        log = np.where(self.possible[row], self._log_density(spread, row), -np.inf)
        log_likelihood, noise, relative = _integrated(log, self.counts[row], self.aim)
        stds = np.array([observation.std for observation in self.data.observations])
        misfits = np.where(self.possible, self.missed**2 @ stds**-2.0, np.inf)
        nearest = misfits.argmin(axis=1)[row]
        hits = self.aim.hits
        fitted, ahead = _drawn(relative, rng), _drawn(self.counts[row], rng)
        errors = spread[:, None] * rng.standard_normal((len(row), KEPT_HITS, spread.shape[-1]))
        return ShotScore(
            log_likelihood=log_likelihood,
            noise=noise,
            misfit=misfits[row, nearest],
            best=self.computed[row, nearest],
            best_hit=hits[row, nearest],
            fitted=self.computed[row[:, None], fitted],
            fitted_hit=hits[row[:, None], fitted],
            predicted=self.computed[row[:, None], ahead] + errors,
        )

    def _log_density(self, spread: Array, row: NDArray[np.int64]) -> Array:
        """ln N(measured | about each point), shape [sets, points], for spreads of shape [sets, observations]."""
        points, numbers = self.missed.shape[1:]
        images = len(self.aim.group)
        scaled = self.changes[row] / spread[:, None, None]
        miss = self.missed[row].reshape(len(row), points // images, images, numbers) / spread[:, None, None]
        # With unit variances, |I + C Cᵀ| = |I + Cᵀ C| and (I + C Cᵀ)⁻¹ = I − C (I + Cᵀ C)⁻¹ Cᵀ.
        yy, zz = 1.0 + (scaled**2).sum(axis=-1).transpose(2, 0, 1)
        yz = (scaled[..., 0, :] * scaled[..., 1, :]).sum(axis=-1)
        determinant = yy * zz - yz**2
        along = (miss * signs(self.data.observations, self.aim.group)) @ scaled.swapaxes(-1, -2)
        along_y, along_z = along[..., 0], along[..., 1]
        explained = zz[..., None] * along_y**2 - 2.0 * yz[..., None] * along_y * along_z + yy[..., None] * along_z**2
        squares = (miss**2).sum(axis=-1) - explained / determinant[..., None]
        scale = np.log(np.sqrt(2.0 * np.pi) * spread).sum(axis=-1)[:, None, None]
        log: Array = -0.5 * (squares + np.log(determinant)[..., None]) - scale
        return log.reshape(len(row), points)


def _counted(data: Data, outcomes: Outcomes) -> Array:
    """1 where a shot would have been measured, shape [shots]: its computation did not fail, and the selection holds."""
    kept = ~failures(outcomes.status)
    for condition in data.selection:
        kept &= holds(condition, outcomes, data.standoffs)
    return kept.astype(np.float64)


def holds(condition: Measure, outcomes: Outcomes, standoffs: Sequence[float]) -> NDArray[np.bool_]:
    """Whether a condition such as P(perforated) or P(bending_stress < 1.5 GPa) is true of each shot."""
    if condition.kind == "share":
        return np.asarray(outcomes.status == STATUSES[condition.name])
    values: Array = getattr(outcomes, condition.name)
    if condition.standoff is not None:
        values = values[:, place_of_standoff(standoffs, condition.standoff)]
    (variable,) = (number for number in v.HIT_NUMBERS if number == condition.name)
    shown = np.degrees(values) if variable.units == "degree" else values
    return np.asarray(shown > condition.limit if condition.above else shown < condition.limit)


def _median(values: Array, weight: Array) -> Array:
    """Median over the points of the class, shape [sets, 1]; NaN without such a point."""
    medians = [
        np.median(value[inside]) if inside.any() else np.nan for value, inside in zip(values, weight > 0.0, strict=True)
    ]
    return np.array(medians)[:, None]


def _integrated(log: Array, counts: Array, aim: HitPoints) -> tuple[Array, Array, Array]:
    """ln of the mean over the points, and its standard error from the spread of the replicates, both of shape [sets];
    and the contribution of each point to the mean, as a share of the largest, shape [sets, points]."""
    highest = np.where(np.isfinite(log), log, -1e300).max(axis=1)
    relative = np.exp(log - highest[:, None]) * counts
    total = counts.sum(axis=1)
    sums = relative.reshape(len(log), -1, aim.replicates, len(aim.group)).sum(axis=(1, 3)).T
    with np.errstate(divide="ignore", invalid="ignore"):
        log_likelihood = np.where(total > 0.0, highest + np.log(relative.sum(axis=1) / total), -np.inf)
        spread = sums.std(axis=0, ddof=1) / sums.mean(axis=0) if aim.replicates > 1 else np.zeros(len(log))
    log_likelihood = np.where(highest > -1e300, log_likelihood, -np.inf)
    return log_likelihood, np.nan_to_num(spread / np.sqrt(aim.replicates), nan=np.inf), relative


def _drawn(weights: Array, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices along the second axis in proportion to weights, shape [sets, KEPT_HITS]; 0 where all weights are 0."""
    ends = np.cumsum(weights, axis=1)
    places = rng.random((len(weights), KEPT_HITS)) * ends[:, -1:]
    drawn: NDArray[np.int64] = np.stack(
        [np.searchsorted(end, at, side="right") for end, at in zip(ends, places, strict=True)]
    )
    return np.asarray(np.minimum(drawn, weights.shape[1] - 1))
