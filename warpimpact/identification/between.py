"""Interpolation between hit points: numbers follow a plane through those of the nearest points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpimpact.identification.aim import HitPoints
from warpimpact.identification.measured import MEASURABLE, Observation
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Symmetry
from warpimpact.scene.model import Array

PLANE_NEIGHBOURS = 6
"""Number of neighbours, images included, through which the plane of a point is fitted by least squares."""


def signs(observations: Sequence[Observation], group: Sequence[Symmetry]) -> Array:
    """Signs of numbers from a computed point to its images, shape [images, observations]."""
    mirrors = [MEASURABLE[observation.name].mirror for observation in observations]
    factors = [[1.0 if mirror is None else getattr(symmetry, mirror) for mirror in mirrors] for symmetry in group]
    return np.array(factors, dtype=np.float64).reshape(len(group), len(mirrors))


def with_images(outcomes: Outcomes, group: Sequence[Symmetry]) -> Outcomes:
    """Outcomes of all images of the shots under a group of symmetries; the images of a shot follow each other."""
    columns = {name: np.repeat(values, len(group), axis=0) for name, values in vars(outcomes).items()}
    for name in columns.keys() & {str(variable) for variable in MEASURABLE.values() if variable.mirror}:
        signs = np.tile([getattr(symmetry, str(MEASURABLE[name].mirror)) for symmetry in group], len(outcomes))
        columns[name] = columns[name] * signs[:, None]
    return Outcomes(**columns)


def changes(observations: Sequence[Observation], aim: HitPoints, computed: Array) -> Array:
    """Change of numbers over a standard deviation of the places that a computed point stands for.

    Args:
        computed: numbers of all points, NaN where there is none, shape [sets, points, observations].

    Returns:
        Shape [sets, computed points, 2, observations], along y and z; 0 where too few neighbours have the numbers, and
        where the points do not cover a part of the unit cell evenly.
    """
    images = len(aim.group)
    sets, points, numbers = computed.shape
    if aim.part is None:
        return np.zeros((sets, points // images, 2, numbers))
    part, cell = aim.part
    places, period = aim.hits / part, cell / part
    slopes = [_slopes(observations, *set_numbers, period, images) for set_numbers in zip(places, computed, strict=True)]
    side = np.sqrt(images / points)  # side of the square that a point stands for; its variance is side²/12
    return np.asarray(np.stack(slopes) * (side / np.sqrt(12.0)))


def _slopes(observations: Sequence[Observation], places: Array, computed: Array, period: Array, images: int) -> Array:
    """Slopes of the planes about the computed points of a set, shape [computed points, 2, observations]."""
    from scipy.spatial import cKDTree  # a while to import

    inside = np.minimum(np.mod(places, period), np.nextafter(period, 0.0))
    _, near = cKDTree(inside, boxsize=period).query(inside[::images], k=PLANE_NEIGHBOURS + 1)
    near = near[:, 1:]
    apart = places[near] - places[::images, None]
    apart -= period * np.round(apart / period)
    change = computed[near] - computed[::images, None]
    for place, observation in enumerate(observations):
        change[..., place] = observation.shortest(change[..., place])
    there = ~np.isnan(change).any(axis=-1)
    change, count = np.where(there[..., None], change, 0.0), there.sum(axis=1)
    weight = there / ((apart**2).sum(axis=-1) + 1e-12)
    square = np.einsum("nk,nka,nkb->nab", weight, apart, apart)
    square += np.where(count < 3, 1.0, 1e-9)[:, None, None] * np.eye(2)
    slopes = np.linalg.solve(square, np.einsum("nk,nka,nkd->nad", weight, apart, change))
    return np.where((count < 3)[:, None, None], 0.0, slopes)
