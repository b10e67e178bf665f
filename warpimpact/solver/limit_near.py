"""Guesses of limits from the known limits of other hits that are near in hit point and conditions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import IDENTITY, Scene, Shots, Symmetry
from warpimpact.scene.shots import OF_A_SHOT
from warpimpact.scene.symmetry import SYMMETRIES, of_plate
from warpimpact.solver.limit_search import DOUBT, Guess, LimitSearch
from warpimpact.solver.simulate import spread_places

Array = NDArray[np.float64]

NEAREST = 4
"""Number of nearest hits from which a limit is guessed."""
WITHIN = 0.75
"""Share of the limits that shall lie within their stated doubt."""
LEAST, MOST = 0.02, 0.5
"""Bounds of the doubt of a limit (solver/limit_search.py)."""
TRIED = 256
"""Most known limits that are compared with their guesses from the others."""
PLACES = 0.0, 0.1, 0.3, 1.0, 3.0, 10.0
"""Candidate weights of the distance of hit points beside that of the other conditions."""


class Neighbours:
    """All shots of a search, with the limits that are known.

    Two shots are near by their hit points and by all conditions in which shots differ. A known limit also holds for the
    images of its shot under the symmetries of the plate (scene/symmetry.py), and the map of hit points repeats with the
    cell of the plate. A condition is weighed by how much the limit changes with it. The hit points get the weight with
    which the known limits predict each other best.

    Args:
        scene, shots: scene and its shots.
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
        self._errors = np.full((3, len(shots)), np.nan)

    def learn(self, which: NDArray[np.int64], search: LimitSearch) -> None:
        """Take in known limits."""
        self._value[which], self._sums[:, which] = search.value(), search.curve_sums()
        self._errors[:, which] = search.errors()

    def guess(self, which: NDArray[np.int64]) -> Guess:
        """Guess the limits of some shots."""
        known = np.flatnonzero(np.isfinite(self._value) & (self._value > 0.0))
        if len(known) <= NEAREST:
            return Guess.nothing(len(which))
        value, least = self._value[known], 1e-3 * self._tolerance
        slopes = _slopes(self._conditions[0][known], value)
        trend = [condition @ slopes for condition in self._conditions]
        rest = np.concatenate([value - column[known] for column in trend])
        weights = np.abs(slopes) / (np.std(value) + least)
        some, best = spread_places(len(known), min(len(known), TRIED)), np.inf
        for place in PLACES:
            near = _Near(self._places(known, weights, place), place, len(known))
            told, sure, _ = near.told(self._places(known[some], weights, place, images=1), rest, some)
            off = np.abs(told - rest[some])
            if off.mean() < best:
                best, chosen, nearest = float(off.mean()), place, near
                scale = np.quantile(off / (sure + least), WITHIN)
        told, sure, who = nearest.told(self._places(which, weights, chosen, images=1), rest)
        linear, square = _curve(self._sums[:, known[who]].sum(axis=2))
        errors = [np.append(error[np.isfinite(error)], first) for error, first in zip(self._errors, DOUBT, strict=True)]
        doubt = np.array([np.clip(np.quantile(error, WITHIN), LEAST, MOST) for error in errors])
        expected = np.maximum(trend[0][which] + told, 0.1 * value.min())
        return Guess(expected, np.minimum(scale * (sure + least), 0.5 * expected), linear, square, doubt)

    def _places(self, which: NDArray[np.int64], weights: Array, place: float, images: int | None = None) -> Array:
        """Coordinates of some shots, then of their images, shape [shots × images, 2 + conditions]. The first two
        columns are periodic with `place`."""
        pairs = list(zip(self._points, self._conditions, strict=True))[:images]
        at = [np.column_stack([point[which] * place, other[which] * weights]) for point, other in pairs]
        return np.concatenate(at)


class _Near:
    """Finds the nearest shots among some shots and their images.

    Args:
        places: coordinates of the shots, then of the images.
        period: period of the first two columns.
        count: number of shots.
    """

    def __init__(self, places: Array, period: float, count: int) -> None:
        from scipy.spatial import KDTree  # a fifth of a second to import

        self._count, self._images = count, len(places) // count
        self._tree = KDTree(places, boxsize=[period, period, *np.zeros(places.shape[1] - 2)])

    def told(
        self, places: Array, values: Array, left_out: NDArray[np.int64] | None = None
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Predict values at places from the nearest shots: the values, their doubt, and the numbers of the nearest.

        Args:
            values: values at the shots and their images.
            left_out: number of the shot at each place, which is left out of its own prediction.
        """
        count = NEAREST if left_out is None else NEAREST + self._images
        distance, near = self._tree.query(places, min(count, self._count * self._images))
        if left_out is not None:
            distance = np.where(near % self._count == left_out[:, None], np.inf, distance)
            order = np.argsort(distance, axis=1)[:, :NEAREST]
            distance, near = (np.take_along_axis(array, order, axis=1) for array in (distance, near))
        weight = 1.0 / (distance + 1e-9 + 0.1 * distance[:, -1:]) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        predicted = (weight * values[near]).sum(axis=1)
        spread = np.sqrt((weight * (values[near] - predicted[:, None]) ** 2).sum(axis=1))
        return predicted, spread + 0.3 * np.median(spread), near % self._count


def _coordinates(shots: Shots, sought: tuple[str, int]) -> tuple[Array, Array, Array]:
    """Hit points, shape [shots, 2]; the conditions that change sign under symmetries, in the order of `_signs`, shape
    [shots, 5]; and the other conditions."""
    across = np.sin(shots.obliquity)
    signed = (across * np.cos(shots.azimuth), across * np.sin(shots.azimuth), shots.yaw, shots.pitch, shots.spin)
    used = (*OF_A_SHOT, "hit_y", "hit_z", "obliquity", "azimuth", "yaw", "pitch", "spin")
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
