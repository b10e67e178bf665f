"""A hierarchical fit of published limit velocities: one law for all materials, one strength for each.

ln Y of a row is a sum of normal parts: what tensile test and hardness say of its material, the material's own excess,
an exponent of h/d and a growth with the angle (common, and the material's own), what all rows of a projectile, of a
projectile in a material, and of a source share, and what neighbouring thicknesses of one plate, projectile and angle
share. The rest is the measured standard deviation and the scatter of tests, with the tails of Student's t. Given the
sizes of these parts everything is normal, so that predictions are exact and a likelihood costs one Cholesky
decomposition.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.stats import t as student

from warpimpact.catalogue.strength import PART_SCALES, Plates, part_names, shared

from .limit_rows import Array, Rows, log_unit, unit

METALS = ("steel", "aluminium")
_STEP = 1e-4
"""Over which the derivative by ln η is taken."""

_OF_SCALES = 0.7
"""Standard deviation of the logarithm of every size, a priori."""
TEST = 0.03
"""Prior median of the scatter of tests, in ln Y, of each metal."""
UNMEASURED = 0.0115
"""Relative standard deviation of a row that has none: the median of those that have."""
TAILS = 4.0
"""Degrees of freedom of the scatter of tests."""
MOST_FRICTION = 0.3
NAMES = (*part_names(), *(f"test, {metal}" for metal in METALS))
"""The parts of ln Y whose size is fitted; the scatter of tests comes last."""
MEANS = np.log([*(PART_SCALES.get(name.rpartition(", ")[0], TEST) for name in NAMES), 0.05])
SPREADS = np.array([*(_OF_SCALES for _ in NAMES), 0.5])
Mask = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True)
class Fit:
    """Sizes of the parts and the friction, most probable given some rows.

    Attributes:
        values: logarithms of the standard deviations in the order of NAMES, then that of η.
        log_posterior: of the fitted rows at these values.
    """

    values: Array
    log_posterior: float

    @property
    def scales(self) -> dict[str, float]:
        """Standard deviations of the parts of ln Y, and of tests."""
        return dict(zip(NAMES, np.exp(self.values).tolist(), strict=False))

    @property
    def friction(self) -> float:
        """η."""
        return min(float(np.exp(self.values[-1])), MOST_FRICTION)


@dataclass
class Model:
    """Rows under the law.

    Attributes:
        rows: what was measured.
        weights: of rows, below 1 where a row lies far outside.
        fixed, parts: what rows share (`strength.shared`), shape [rows, rows] each.
    """

    rows: Rows
    weights: Array = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        rows = self.rows
        self.nodes = unit(rows)
        self.weights = np.ones(len(rows)) if not len(self.weights) else self.weights
        plates = plates_of(rows)
        self.expected = plates.expected
        self.fixed, self.parts = shared(plates, plates)
        self.of_metal = {"steel": plates.steel, "aluminium": ~plates.steel}
        relative = rows.deviation / rows.velocity
        self.measured = (2.0 * np.where(np.isfinite(relative), relative, UNMEASURED)) ** 2

    def residual(self, values: Array) -> Array:
        """ln Y that each row asks for, less what indentation expects, shape [rows]."""
        rows = self.rows
        scaled = 2.0 * np.log(rows.velocity) + np.log(rows.mass / rows.diameter**3)
        return np.asarray(scaled - log_unit(self.nodes, min(float(np.exp(values[-1])), MOST_FRICTION)) - self.expected)

    def noise(self, values: Array) -> Array:
        """Variance of ln Y that a single row has of its own, shape [rows]."""
        total = self.measured.copy()
        for place, metal in enumerate(METALS, start=len(self.parts)):
            total += np.exp(2.0 * values[place]) * self.of_metal[metal]
        return total

    def signal(self, values: Array) -> Array:
        """Covariance of ln Y without the noise, shape [rows, rows]."""
        total = self.fixed.copy()
        for part, value in zip(self.parts.values(), values, strict=False):
            total += np.exp(2.0 * value) * part
        return total

    def log_posterior(self, values: Array) -> float:
        """Logarithm of marginal likelihood and prior."""
        sizes = values[:-1]
        if (sizes < -9.0).any() or (sizes > 1.0).any():
            return -1e10
        factor = cho_factor(self.signal(values) + np.diag(self.noise(values) / self.weights), lower=True)
        residual = self.residual(values)
        likelihood = -np.log(np.diag(factor[0])).sum() - 0.5 * residual @ cho_solve(factor, residual)
        prior = -0.5 * (((values - MEANS) / SPREADS) ** 2).sum()
        return float(prior + likelihood - 0.5 * len(residual) * np.log(2.0 * np.pi))

    def gradient(self, values: Array) -> Array:
        """Derivatives of `log_posterior` by the values."""
        sizes = values[:-1]
        if (sizes < -9.0).any() or (sizes > 1.0).any():
            return np.zeros(len(values))
        covariance = self.signal(values) + np.diag(self.noise(values) / self.weights)
        residual, precision = self.residual(values), np.linalg.inv(covariance)
        pulled = precision @ residual
        by_covariance = 0.5 * (np.outer(pulled, pulled) - precision)
        slopes = [2.0 * np.exp(2.0 * v) * (by_covariance * part).sum() for v, part in zip(values, self.parts.values())]  # noqa: B905
        for metal, value in zip(METALS, values[len(self.parts) :], strict=False):
            own = np.diag(by_covariance) * self.of_metal[metal] / self.weights
            slopes.append(2.0 * np.exp(2.0 * value) * own.sum())
        moved = values + _STEP * (np.arange(len(values)) == len(slopes))
        slopes.append(-pulled @ (self.residual(moved) - residual) / _STEP)
        return np.asarray(slopes) - (values - MEANS) / SPREADS**2

    def weighed(self, values: Array) -> Model:
        """The same with the weights that Student's tails give its rows, each seen from all others."""
        mean, variance = self.left_out(values, [np.array([k]) for k in range(len(self.rows))])
        far = (self.residual(values) - mean) ** 2 / variance
        return replace(self, weights=np.minimum(1.0, (TAILS + 1.0) / (TAILS + far)))

    def left_out(self, values: Array, groups: list[Places]) -> tuple[Array, Array]:
        """Mean and variance of the residual of rows that are predicted together from all rows that are in no group with
        them, of each shape [rows]; NaN where a row is in no group."""
        y, noise = self.residual(values), self.noise(values)
        precision = np.linalg.inv(self.signal(values) + np.diag(noise / self.weights))
        pulled = precision @ y
        mean, variance = np.full((2, len(y)), np.nan)
        for group in groups:
            own = np.linalg.inv(precision[np.ix_(group, group)])
            mean[group] = y[group] - own @ pulled[group]
            variance[group] = np.diag(own) + noise[group] * (1.0 - 1.0 / self.weights[group])
        return mean, variance

    def predicted(self, values: Array, fitted: Mask, tested: Places) -> tuple[Array, Array]:
        """Mean and variance of the residual of some rows from the fitted ones, of each shape [tested]."""
        known = np.flatnonzero(fitted)
        signal, noise = self.signal(values), self.noise(values)
        factor = cho_factor(signal[np.ix_(known, known)] + np.diag(noise[known] / self.weights[known]), lower=True)
        across = signal[np.ix_(tested, known)]
        mean = across @ cho_solve(factor, self.residual(values)[known])
        left = np.diag(signal)[tested] - (across * cho_solve(factor, across.T).T).sum(axis=1)
        return mean, left + noise[tested]

    def velocity(self, values: Array, mean: Array, variance: Array) -> tuple[Array, Array, Array]:
        """Median and ends of the 90 % interval of the limit velocity of every row [m/s]."""
        noise = np.minimum(self.noise(values), variance)
        normal, tails = 1.645**2, student(TAILS).ppf(0.95) ** 2
        half = 0.5 * np.sqrt(normal * (variance - noise) + tails * noise)
        middle = np.log(self.rows.velocity) + 0.5 * (mean - self.residual(values))
        return np.exp(middle), np.exp(middle - half), np.exp(middle + half)


def fit(rows: Rows, *, rounds: int = 3) -> Fit:
    """Find the most probable sizes of the parts and the friction; rows that lie far outside count less."""
    model, values = Model(rows), MEANS
    for turn in range(rounds):

        def cost(at: Array, model: Model = model) -> tuple[float, Array]:
            return -model.log_posterior(at), -model.gradient(at)

        values = minimize(cost, values, jac=True, method="L-BFGS-B", options={"maxiter": 80}).x
        if turn < rounds - 1:
            model = model.weighed(values)
    return Fit(values, model.log_posterior(values))


def plates_of(rows: Rows) -> Plates:
    """The plates of rows; flow stress and hardness are the means of their material."""
    flow, hardness = (_mean_of(rows.material, values) for values in (rows.flow_stress, rows.hardness))
    plates = {field.name: getattr(rows, field.name) for field in fields(Plates)}
    return Plates(**plates | {"flow_stress": flow, "hardness": hardness})


def packaged(rows: Rows, of: Fit) -> dict[str, Any]:
    """What the package holds of a fit (`strength.limit_fit`)."""
    model = Model(rows).weighed(of.values)
    columns: dict[str, list[Any]] = {name: values.tolist() for name, values in vars(plates_of(rows)).items()}
    columns["residual"] = model.residual(of.values).tolist()
    columns["noise"] = (model.noise(of.values) / model.weights).tolist()
    rounded = {
        name: [float(f"{value:.7g}") if isinstance(value, float) else value for value in values]
        for name, values in columns.items()
    }
    sizes = {name: float(f"{size:.6g}") for name, size in of.scales.items()}
    test = {metal: float(f"{np.hypot(sizes.pop(f'test, {metal}'), 2.0 * UNMEASURED):.4g}") for metal in METALS}
    return {"sizes": sizes, "test": test, "rows": rounded}


def _mean_of(labels: NDArray[np.str_], values: Array) -> Array:
    """Of each row the mean of the rows with its label, shape [rows]."""
    _, place = np.unique(labels, return_inverse=True)
    return np.asarray((np.bincount(place, values) / np.bincount(place))[place])
