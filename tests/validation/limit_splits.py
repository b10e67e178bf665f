"""What is predicted from what, by the model and by its rivals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from .limit_model import Fit, Mask, Model, Places, fit
from .limit_rows import Array, Rows

LAW = "strength by h/d"
RIVALS = {"De Marre, fitted": None, "energy per area": 0.5}
"""Exponents of h/d: v √(m / d³) = K (h/d)ⁿ / cos θ with K and n by least squares from the known rows of each material;
½ m v² = E (π/4) d² h / cos θ with the mean E of each material."""
COLUMNS = ["split", "row", "projectile", "material", "fitted", "published", "method", "predicted", "low", "high"]
CARBIDE = "core: BS41 carbide from .30"
LEAST_ROWS = 3


@dataclass(frozen=True)
class Split:
    """Rows that are predicted, each group from what the question leaves.

    Attributes:
        name: of the question.
        groups: rows that are predicted together.
        fitted: of each group, the rows that are known.
        refitted: whether the sizes of the parts are found from the known rows alone; else from all rows of the fit.
    """

    name: str
    groups: list[Places]
    fitted: list[Mask]
    refitted: bool = False


def left_out(rows: Rows) -> Iterator[Split]:
    """One row, one thickness, one angle, one projectile, one material out; all other rows are known."""
    plate = _labels(rows.projectile, rows.material)
    angle = rows.obliquity.round(3).astype(str)
    calibres = np.round(np.log(rows.thickness) / 0.1).astype(str)
    kinds = {
        "one row out": np.arange(len(rows)).astype(str),
        "one thickness out": _labels(plate, calibres),
        "one angle out": _labels(rows.material, angle),
        "one projectile out": plate,
        "one material out": rows.material,
    }
    for name, labels in kinds.items():
        groups = [np.flatnonzero(labels == label) for label in dict.fromkeys(labels.tolist())]
        if name != "one material out":  # something of the material is left
            groups = [one for one in groups if len(one) < (rows.material == rows.material[one[0]]).sum()]
        yield Split(name, groups, [_all_but(one, len(rows)) for one in groups])


def questions(rows: Rows) -> Iterator[Split]:
    """0° predicts other angles, .30 rows predict larger projectiles, thinner plates predict thicker ones: everything is
    found from the known rows of the question alone."""
    normal, small, carbide = rows.obliquity == 0.0, rows.projectile == ".30 AP M2", rows.projectile == "14.5 mm BS41"
    plate = _labels(rows.projectile, rows.material)
    middle = pd.Series(rows.thickness).groupby(plate).transform("median").to_numpy()
    fives = np.random.default_rng(5).permutation(len(rows)) % 5
    splits: dict[str, tuple[Mask, Callable[[int], bool]]] = {
        "angle: from 0°": (normal, lambda k: bool((normal & (plate == plate[k])).any())),
        "scale: .50 and B32 from .30": (
            small,
            lambda k: not carbide[k] and bool((small & (rows.material == rows.material[k])).any()),
        ),
        CARBIDE: (
            small,
            lambda k: bool(carbide[k]) and bool((small & (rows.material == rows.material[k])).any()),
        ),
        "thicker from thinner": (
            rows.thickness <= middle * (1.0 + 1e-9),
            lambda k: (plate == plate[k]).sum() >= LEAST_ROWS,
        ),
    }
    for name, (known, has_some) in splits.items():
        group = np.array([k for k in np.flatnonzero(~known) if has_some(k)], dtype=np.int64)
        if len(group) and known.sum() >= LEAST_ROWS:
            yield Split(name, [group], [known], refitted=True)
    groups = [np.flatnonzero(fives == k) for k in range(5)]
    if len(rows) >= 20:
        yield Split("a fifth out", groups, [_all_but(one, len(rows)) for one in groups], refitted=True)


def predictions(rows: Rows, split: Split, whole_fit: Fit) -> pd.DataFrame:
    """What the model and its rivals predict of a split: columns of COLUMNS."""
    parts = list[pd.DataFrame]()
    whole = Model(rows).weighed(whole_fit.values)
    if not split.refitted:
        mean, variance = whole.left_out(whole_fit.values, split.groups)
        velocity = whole.velocity(whole_fit.values, mean, variance)
    for group, known in zip(split.groups, split.fitted, strict=True):
        if split.refitted:
            own = fit(rows[known])
            weights = np.ones(len(rows))
            weights[known] = Model(rows[known]).weighed(own.values).weights
            model = Model(rows, weights)
            mean, variance = np.full((2, len(rows)), np.nan)
            mean[group], variance[group] = model.predicted(own.values, known, group)
            velocity = model.velocity(own.values, mean, variance)
        answers = {LAW: tuple(one[group] for one in velocity)}
        for name, rival in RIVALS.items():
            answers[name] = (_by_material(rows, known, group, rival), *np.full((2, len(group)), np.nan))
        plate = _labels(rows.projectile, rows.material)
        fitted = [int((known & (plate == plate[k])).sum()) for k in group]
        for method, (middle, low, high) in answers.items():
            data = (split.name, group, rows.projectile[group], rows.material[group], fitted, rows.velocity[group])
            columns = (*data, method, middle, low, high)
            parts.append(pd.DataFrame(dict(zip(COLUMNS, columns, strict=True))))
    return pd.concat(parts).round({"predicted": 1, "low": 1, "high": 1})


def _by_material(rows: Rows, known: Mask, group: Places, exponent: float | None) -> Array:
    scaled = np.log(rows.velocity * np.sqrt(rows.mass / rows.diameter**3))
    size, secant = np.log(rows.calibres), -np.log(np.cos(rows.obliquity))
    level = scaled - secant * (1.0 if exponent is None else 0.5)
    usual = 0.7 if exponent is None else exponent
    over_stress = level - 0.5 * np.log(rows.flow_stress)
    answer = np.empty(len(group))
    for place, k in enumerate(group):
        own = known & (rows.material == rows.material[k])
        if same := (own & (rows.projectile == rows.projectile[k])).sum():
            own = own & (rows.projectile == rows.projectile[k]) if same >= LEAST_ROWS else own
        slope, centred = usual, size[own] - size[own].mean() if own.any() else np.zeros(1)
        if exponent is None and own.sum() >= LEAST_ROWS and np.ptp(size[own]) > 0.05:
            slope = float((centred * level[own]).sum() / (centred**2).sum())
        if own.any():
            answer[place] = (level[own] - slope * size[own]).mean() + slope * size[k]
        else:  # from the tensile test: the mean of all other materials, each counted once
            others = pd.Series((over_stress - slope * size)[known]).groupby(rows.material[known]).mean().mean()
            answer[place] = others + slope * size[k] + 0.5 * np.log(rows.flow_stress[k])
        answer[place] += secant[k] * (1.0 if exponent is None else 0.5) - scaled[k]
    return np.asarray(rows.velocity[group] * np.exp(answer))


def _all_but(group: Places, count: int) -> Mask:
    known = np.ones(count, dtype=bool)
    known[group] = False
    return known


def _labels(*columns: Iterable[object]) -> np.ndarray:
    return np.array(["|".join(map(str, one)) for one in zip(*columns, strict=True)])
