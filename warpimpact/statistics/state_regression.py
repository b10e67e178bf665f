"""Regression of a core's state by finite elements on its states by fast laws (docs/continuum.md).

Angles and rates are vectors across the line of fire, and a weight multiplies a whole vector. So turned or mirrored hits
have turned or mirrored predictions. Residuals are those along the laws' own vector, and those across it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.statistics.intervals import Array

VECTORS = 3
"""Vectors of a state: direction of flight, axis, rate of the axis."""
LEAST_LOSS, LEAST_ANGLE = 0.005, 0.02
"""Least scales of a map's residuals: share of the energy; angle and rate [rad]."""
UNTOUCHED = 1e-9
"""Share of the energy below which a loss is rounding."""
PROFILES = ((1.0, 0.0, 0.25), (1.0, 0.0, 0.7), (0.0, 1.0, 0.1), (0.0, 1.0, 0.4), (0.7, 0.7, 0.25), (0.0, 0.0, 1.0))
"""What the scale of a residual of vectors may grow with: the angle and the loss by the laws, over their sizes at the
mean hit, and what it is where both are none. Plates differ in it."""
LOSS_FLOOR = 0.5
"""Scale of a residual of the energy loss where the laws see none, over what grows with it at the mean hit."""


class Design(NamedTuple):
    """Regressors of hits, with k weights in all, and scales of residuals.

    Attributes:
        along: of the energy loss and the vectors along the laws' own, [hits, 4, k].
        across: of the vectors across, [hits, 3, k].
        side: unit vectors along the laws' own, [hits, 2].
        scales: of the residuals of the energy loss and of vectors, by the profile of the latter, [hits, profiles, 2].
        untouched: whether neither law touches, [hits].
    """

    along: Array
    across: Array
    side: Array
    scales: Array
    untouched: NDArray[np.bool_]

    def features(self, along: Array, across: Array) -> Array:
        """Features [..., hits, 7] from energy loss and vectors along the laws' own, [..., hits, 4], and across."""
        vectors = along[..., 1:, None] * self.side[:, None] + across[..., None] * across_of(self.side)[:, None]
        flat = vectors.reshape(*along.shape[:-1], 2 * VECTORS)
        return np.concatenate([1.0 - along[..., :1], flat], axis=-1)


def across_of(side: Array) -> Array:
    """Unit vectors across those along, [hits, 2]."""
    return np.stack([-side[:, 1], side[:, 0]], axis=1)


def design_of(law: Array, second: Array | None, of_map: slice = slice(None)) -> Design:
    """Regressors of hits from the features of one law or two, [hits, 7] each.

    Energy: the map's mean loss, its share by the angle of the axis, and the loss of each law. Vectors: all vectors of
    each law, and the mean axis once by its angle and once by the loss, which bends their relation.

    Args:
        of_map: the hits whose means are those of the map.
    """
    laws = np.stack([law] if second is None else [law, second], axis=1)
    hits, count = laws.shape[:2]
    losses, vectors = 1.0 - laws[..., 0], laws[..., 1:].reshape(hits, count, VECTORS, 2)
    own_loss, axis = losses.mean(axis=1), vectors.mean(axis=1)[:, 1]
    angle = np.linalg.norm(axis, axis=1)
    mean_loss = max(float(losses[of_map].mean()), LEAST_LOSS)
    mean_angle = float(np.hypot(np.sqrt(np.mean(angle[of_map] ** 2)), LEAST_ANGLE))
    loss_size, angle_size = own_loss / mean_loss, angle / mean_angle
    side = np.where(angle[:, None] > 0.0, axis / np.maximum(angle, np.finfo(float).tiny)[:, None], [1.0, 0.0])
    bent = axis[:, None] * np.stack([angle_size, loss_size], axis=1)[..., None]
    regressors = np.concatenate([vectors.reshape(hits, -1, 2), bent], axis=1)
    constant = np.full(hits, mean_loss)
    of_loss = np.column_stack([constant, mean_loss * angle_size, losses])
    loss_scale = mean_loss * scale_shape(loss_size, LOSS_FLOOR)
    scales = [
        np.column_stack(
            [loss_scale, mean_angle * scale_shape(np.hypot(by_angle * angle_size, by_loss * loss_size), floor)]
        )
        for by_angle, by_loss, floor in PROFILES
    ]
    return Design(
        _blocks([of_loss, *[_dot(regressors, side)] * VECTORS]),
        _blocks([np.empty((hits, 0)), *[_dot(regressors, across_of(side))] * VECTORS], of_loss.shape[1])[:, 1:],
        side,
        np.stack(scales, axis=1),
        np.asarray(np.all(np.abs(losses) < UNTOUCHED, axis=1)),
    )


def weight_parts(weights: int) -> NDArray[np.int64]:
    """0 at weights of the energy loss and 1 at those of vectors, [weights]."""
    laws = (weights - 2 - 2 * VECTORS) // (1 + VECTORS**2)
    return np.repeat([0, 1], [2 + laws, weights - 2 - laws])


def _dot(vectors: Array, units: Array) -> Array:
    """Components of vectors [hits, many, 2] along units [hits, 2]."""
    return np.asarray(np.einsum("hvc,hc->hv", vectors, units))


def _blocks(rows: list[Array], before: int = 0) -> Array:
    """Regressors [hits, rows, weights] of which each row has its own weights, after some of other rows."""
    weights = before + sum(row.shape[1] for row in rows)
    blocks, place = np.zeros((len(rows[0]), len(rows), weights)), before
    for number, row in enumerate(rows):
        blocks[:, number, place : place + row.shape[1]] = row
        place += row.shape[1]
    return blocks


def scale_shape(size: Array, floor: float) -> Array:
    """Scale of residuals of hits, 1 where what the laws see has its mean size 1."""
    return np.asarray(np.sqrt((floor**2 + size**2) / (floor**2 + 1.0)))


class Evidence(NamedTuple):
    """Hits by elements: targets and their regressors.

    Attributes:
        along: energy loss and vectors along the laws' own, [n, 4]; NaN where a core is stopped.
        across: vectors across, [n, 3]; NaN there.
        along_by, across_by: their regressors, [n, 4, k] and [n, 3, k].
        scales: as in `Design`, [n, profiles, 2].
        least: least energy loss of a core that is stopped, at least 1, [n]; 0 of others.
    """

    along: Array
    across: Array
    along_by: Array
    across_by: Array
    scales: Array
    least: Array

    @property
    def stopped(self) -> NDArray[np.bool_]:
        """Whether a core lacks energy to pass, [n]."""
        return np.asarray(self.least > 0.0)

    def scaled(self, profile: int) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
        """Targets, regressors and scales along and across, the former two in the scales of a profile."""
        along = self.scales[:, profile][:, [0, *[1] * VECTORS]]
        across = along[:, 1:]
        return (
            (self.along / along, self.along_by / along[..., None], along),
            (self.across / across, self.across_by / across[..., None], across),
        )


def evidence_of(design: Design, elements: Array, at: NDArray[np.int64]) -> Evidence:
    """Hits by elements, [n, 7], at some places of a design."""
    some = Design._make(part[at] for part in design)
    vectors = elements[:, 1:].reshape(len(elements), VECTORS, 2)
    along = np.column_stack([1.0 - elements[:, 0], np.einsum("hvc,hc->hv", vectors, some.side)])
    across = np.einsum("hvc,hc->hv", vectors, across_of(some.side))
    stopped = elements[:, 0] <= 0.0
    along[stopped], across[stopped] = np.nan, np.nan
    least = np.where(stopped, 1.0 - elements[:, 0], 0.0)
    return Evidence(along, across, some.along, some.across, some.scales, least)


def log_density(residuals: Array, covariance: Array, scales: Array) -> Array:
    """Logarithm of the density of scaled residuals [..., n, rows], [...]; [n, rows] scales."""
    squares = np.sum(residuals @ np.linalg.inv(covariance) * residuals, axis=(-2, -1))
    own = len(scales) * np.linalg.slogdet(covariance)[1] + 2.0 * np.sum(np.log(scales))
    return np.asarray(-0.5 * (squares + own))
