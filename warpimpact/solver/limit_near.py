"""Guesses of limits from the known limits of other hits that are near in hit point and conditions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from warpimpact.scene import IDENTITY, Scene, Shots, Symmetry
from warpimpact.scene.symmetry import SYMMETRIES, of_plate
from warpimpact.solver.limit_search import LimitSearch

Array = NDArray[np.float64]

NEAREST = 4
"""Number of nearest hits from which a limit is guessed."""
PLACE = 3.0
"""Weight of the distance of hit points, in cells of the plate, beside that of the other conditions. Searches take as
many runs with 2 to 5."""


class Neighbours:
    """All shots of a search, with the limits that are known.

    Two shots are near by their hit points and by all conditions in which shots differ. A known limit also holds for the
    images of its shot under the symmetries of the plate (scene/symmetry.py), and the map of hit points repeats with the
    cell of the plate. A condition is weighed by how much the limit changes with it.

    Args:
        sought: quantity and layer whose limit is searched; the quantity is no condition.
        tolerance: tolerance of the search.
    """

    def __init__(self, scene: Scene, shots: Shots, sought: tuple[str, int], tolerance: float) -> None:
        cell, self._tolerance = scene.target.layers[0].sampled_cell, tolerance
        points, signed, others = _coordinates(shots, sought)
        group = _symmetries(scene, signed)
        images = [np.stack(symmetry.image(points[:, 0], points[:, 1], cell), axis=1) for symmetry in group]
        self._points = [(image / cell + 0.5) % 1.0 for image in images]
        columns = [np.column_stack([signed * _signs(symmetry), others]) for symmetry in group]
        scale = columns[0].std(axis=0)
        moved = scale > 1e-9 * np.abs(columns[0]).max(axis=0, initial=0.0)
        mean, scale = columns[0].mean(axis=0), np.where(moved, scale, 1.0)
        self._conditions = [((column - mean) / scale)[:, moved] for column in columns]
        self._value, self._sums = np.full(len(shots), np.nan), np.zeros((5, len(shots)))

    def learn(self, which: NDArray[np.int64], search: LimitSearch) -> None:
        """Take in known limits."""
        self._value[which], self._sums[:, which] = search.value()[which], search.curve_sums()[:, which]

    def guess(self, which: NDArray[np.int64]) -> Array:
        """What is known of the limits of some shots (`LimitSearch.guess`), shape [4, shots]."""
        known = np.flatnonzero(np.isfinite(self._value) & (self._value > 0.0))
        if len(known) <= NEAREST:
            return np.full((4, len(which)), np.nan)
        value, least = self._value[known], 1e-3 * self._tolerance
        slopes = _slopes(self._conditions[0][known], value)
        weights = np.abs(slopes) / (np.std(value) + least)
        trend = [condition @ slopes for condition in self._conditions]
        rest = np.concatenate([value - image[known] for image in trend])
        places = [
            np.column_stack([PLACE * point, condition * weights])
            for point, condition in zip(self._points, self._conditions, strict=True)
        ]
        tree = KDTree(np.concatenate([image[known] for image in places]), boxsize=[PLACE, PLACE, *(0.0 * weights)])
        distance, near = tree.query(places[0][which], NEAREST)
        share = 1.0 / (distance + 1e-9 + 0.1 * distance[:, -1:]) ** 2
        share /= share.sum(axis=1, keepdims=True)
        told = (share * rest[near]).sum(axis=1)
        spread = np.sqrt((share * (rest[near] - told[:, None]) ** 2).sum(axis=1))
        linear, square = _curve(self._sums[:, known[near % len(known)]].sum(axis=2))
        expected = np.maximum(trend[0][which] + told, 0.1 * value.min())
        doubt = np.minimum(spread + 0.3 * np.median(spread) + least, 0.5 * expected)
        return np.stack([expected, doubt, linear, square])


def _coordinates(shots: Shots, sought: tuple[str, int]) -> tuple[Array, Array, Array]:
    """Hit points, shape [shots, 2]; the conditions that change sign under symmetries, in the order of `_signs`, shape
    [shots, 5]; and the other conditions."""
    across = np.sin(shots.obliquity)
    signed = (across * np.cos(shots.azimuth), across * np.sin(shots.azimuth), shots.yaw, shots.pitch, shots.spin)
    used = ("hit_y", "hit_z", "obliquity", "azimuth", "yaw", "pitch", "spin")
    others = []
    for name, values in shots.columns.items():
        if name in used:
            continue
        table = np.asarray(values, dtype=np.float64).reshape(len(shots), -1)
        others += [column for k, column in enumerate(table.T) if (name, k) != sought and np.isfinite(column).all()]
    points = np.stack([shots.hit_y, shots.hit_z], axis=1)
    return points, np.stack(signed, axis=1), np.stack(others, axis=1) if others else np.empty((len(shots), 0))


def _signs(symmetry: Symmetry) -> Array:
    """Signs of flight along y and z, yaw, pitch and spin under a symmetry."""
    y, z = symmetry.along_y, symmetry.along_z
    return np.array([y, z, y, z, y * z], dtype=np.float64)


def _symmetries(scene: Scene, signed: Array) -> list[Symmetry]:
    """Symmetries of the plate under which each condition that all shots share keeps its sign. Only the identity if the
    target has other layers, whose symmetries may differ."""
    if any(layer.open_area > 0.0 or layer.size is not None for layer in scene.target.layers[1:]):
        return [IDENTITY]
    alike = np.ptp(signed, axis=0) <= 1e-9 * np.abs(signed).max(axis=0)
    kept = [symmetry for symmetry in SYMMETRIES if symmetry == IDENTITY or of_plate(symmetry, scene.target.layers[0])]
    return [symmetry for symmetry in kept if not (alike & (_signs(symmetry) < 0.0) & (np.abs(signed[0]) > 1e-9)).any()]


def _slopes(conditions: Array, value: Array) -> Array:
    """Change of the limit per unit of each condition, by least squares with a small penalty."""
    count = len(value)
    design = np.column_stack([np.ones(count), conditions])
    penalty = 1e-3 * count * np.diag([0.0, *np.ones(conditions.shape[1])])
    return np.asarray(np.linalg.solve(design.T @ design + penalty, design.T @ value)[1:])


def _curve(sums: Array) -> tuple[Array, Array]:
    """b and c that minimise the squares of (b r + c r²) / d − 1, neither less than 0; NaN without passages."""
    rr, rs, ss, r, s = sums
    with np.errstate(invalid="ignore", divide="ignore"):
        determinant = rr * ss - rs**2
        b, c = (r * ss - s * rs) / determinant, (s * rr - r * rs) / determinant
        only_b, only_c = r / rr, s / ss
    return np.where(b < 0.0, 0.0, np.where(c < 0.0, only_b, b)), np.where(b < 0.0, only_c, np.where(c < 0.0, 0.0, c))
