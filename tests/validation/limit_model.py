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
"""Over which derivatives by coefficients of a law are taken."""

_OF_SCALES = 0.7
"""Standard deviation of the logarithm of every size, a priori."""
TEST = 0.03
"""Prior median of the scatter of tests, in ln Y, of each metal."""
UNMEASURED = 0.0115
"""Relative standard deviation of a row that has none: the median of those that have."""
TAILS = 4.0
"""Degrees of freedom of the scatter of tests."""
COEFFICIENTS = {"friction": (np.log(0.05), 0.5), "linear": (0.45, 0.2), "quadratic": (1.0, 0.25)}
"""Normal priors of ln η, C and B: the paper's η; cavity expansion in metals (docs/validation.md)."""
Mask = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True)
class Law:
    """A law of resistance.

    Attributes:
        name: as it is shown.
        free: which of η, C and B are fitted; the others are 0, and η is `friction`.
        exponent: whether Y grows with a power of h/d.
        friction: η where it is not fitted.
        onset: κ, where it is not that of the package.
    """

    name: str
    free: tuple[str, ...] = ("friction",)
    exponent: bool = False
    friction: float = 0.05
    onset: float | None = None


LAWS = (
    Law("constant stress, no friction", free=(), friction=0.0),
    Law("constant stress"),
    Law("constant stress, no onset", onset=0.0),
    Law("constant stress, wide onset", onset=0.02),
    Law("Poncelet", free=("friction", "quadratic")),
    Law("three-term", free=("friction", "linear", "quadratic")),
    Law("strength by h/d", exponent=True),
    Law("three-term, by h/d", free=("friction", "linear", "quadratic"), exponent=True),
)
CHOSEN = LAWS[6]


@dataclass(frozen=True)
class Fit:
    """Sizes of the parts and coefficients of a law, most probable given some rows.

    Attributes:
        law: the law.
        values: logarithms of the standard deviations in the order of `names`, then the coefficients.
        log_posterior: of the fitted rows at these values.
    """

    law: Law
    values: Array
    log_posterior: float

    @property
    def scales(self) -> dict[str, float]:
        """Standard deviations of the parts of ln Y, and of tests."""
        return dict(zip(names(self.law), np.exp(self.values).tolist(), strict=False))

    @property
    def coefficients(self) -> dict[str, float]:
        """η, C and B."""
        return coefficients(self.law, self.values)


def names(law: Law) -> list[str]:
    """The parts of ln Y in a law whose size is fitted; the scatter of tests comes last."""
    return [*part_names(by_thickness=law.exponent), *(f"test, {metal}" for metal in METALS)]


def medians(law: Law) -> Array:
    """Logarithms of the prior medians of `names`."""
    scales = [PART_SCALES.get(name.rpartition(", ")[0], TEST) for name in names(law)]
    return np.asarray(np.log(scales))


def coefficients(law: Law, values: Array) -> dict[str, float]:
    """η, C and B of a law at some values of its parameters."""
    given = dict(zip(law.free, values[len(names(law)) :].tolist(), strict=True))
    friction = min(float(np.exp(given["friction"])), 0.3) if "friction" in given else law.friction
    return {"friction": friction, "linear": given.get("linear", 0.0), "quadratic": given.get("quadratic", 0.0)}


@dataclass
class Model:
    """Rows under a law.

    Attributes:
        rows: what was measured.
        law: the law.
        weights: of rows, below 1 where a row lies far outside.
        fixed, parts: what rows share (`strength.shared`), shape [rows, rows] each.
    """

    rows: Rows
    law: Law
    weights: Array = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        rows = self.rows
        self.nodes = unit(rows, self.law.onset)
        self.weights = np.ones(len(rows)) if not len(self.weights) else self.weights
        plates = plates_of(rows)
        self.expected = plates.expected
        self.fixed, self.parts = shared(plates, plates, by_thickness=self.law.exponent)
        self.of_metal = {"steel": plates.steel, "aluminium": ~plates.steel}
        relative = rows.deviation / rows.velocity
        self.measured = (2.0 * np.where(np.isfinite(relative), relative, UNMEASURED)) ** 2

    def residual(self, values: Array) -> Array:
        """ln Y that each row asks for, less what indentation expects, shape [rows]."""
        own = coefficients(self.law, values)
        rows = self.rows
        scaled = 2.0 * np.log(rows.velocity) + np.log(rows.mass / rows.diameter**3)
        return np.asarray(scaled - log_unit(self.nodes, rows, **own) - self.expected)

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
        means, spreads = self._prior()
        sizes = values[: len(self.parts) + len(METALS)]
        if (sizes < -9.0).any() or (sizes > 1.0).any():
            return -1e10
        factor = cho_factor(self.signal(values) + np.diag(self.noise(values) / self.weights), lower=True)
        residual = self.residual(values)
        likelihood = -np.log(np.diag(factor[0])).sum() - 0.5 * residual @ cho_solve(factor, residual)
        prior = -0.5 * (((values - means) / spreads) ** 2).sum()
        return float(prior + likelihood - 0.5 * len(residual) * np.log(2.0 * np.pi))

    def gradient(self, values: Array) -> Array:
        """Derivatives of `log_posterior` by the values."""
        means, spreads = self._prior()
        sizes = values[: len(self.parts) + len(METALS)]
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
        for place in range(len(slopes), len(values)):
            moved = values + _STEP * (np.arange(len(values)) == place)
            slopes.append(-pulled @ (self.residual(moved) - residual) / _STEP)
        return np.asarray(slopes) - (values - means) / spreads**2

    def _prior(self) -> tuple[Array, Array]:
        """Means and standard deviations of the values."""
        scales, of_law = medians(self.law), [COEFFICIENTS[name] for name in self.law.free]
        means = np.concatenate([scales, [mean for mean, _ in of_law]])
        return means, np.concatenate([np.full(len(scales), _OF_SCALES), [spread for _, spread in of_law]])

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


def fit(rows: Rows, law: Law = CHOSEN, *, rounds: int = 3) -> Fit:
    """Find the most probable sizes of the parts and coefficients of a law; rows that lie far outside count less."""
    model = Model(rows, law)
    values = model._prior()[0]
    for turn in range(rounds):

        def cost(at: Array, model: Model = model) -> tuple[float, Array]:
            return -model.log_posterior(at), -model.gradient(at)

        values = minimize(cost, values, jac=True, method="L-BFGS-B", options={"maxiter": 80}).x
        if turn < rounds - 1:
            model = model.weighed(values)
    return Fit(law, values, model.log_posterior(values))


def plates_of(rows: Rows) -> Plates:
    """The plates of rows; flow stress and hardness are the means of their material."""
    flow, hardness = (_mean_of(rows.material, values) for values in (rows.flow_stress, rows.hardness))
    plates = {field.name: getattr(rows, field.name) for field in fields(Plates)}
    return Plates(**plates | {"flow_stress": flow, "hardness": hardness})


def packaged(rows: Rows, found: Fit) -> dict[str, Any]:
    """What the package holds of a fit (`strength.limit_fit`)."""
    model = Model(rows, found.law).weighed(found.values)
    columns: dict[str, list[Any]] = {name: values.tolist() for name, values in vars(plates_of(rows)).items()}
    columns["residual"] = model.residual(found.values).tolist()
    columns["noise"] = (model.noise(found.values) / model.weights).tolist()
    rounded = {
        name: [float(f"{value:.7g}") if isinstance(value, float) else value for value in values]
        for name, values in columns.items()
    }
    sizes = {name: float(f"{size:.6g}") for name, size in found.scales.items()}
    test = {metal: float(f"{np.hypot(sizes.pop(f'test, {metal}'), 2.0 * UNMEASURED):.4g}") for metal in METALS}
    return {"sizes": sizes, "test": test, "rows": rounded}


def _mean_of(labels: NDArray[np.str_], values: Array) -> Array:
    """Of each row the mean of the rows with its label, shape [rows]."""
    _, place = np.unique(labels, return_inverse=True)
    return np.asarray((np.bincount(place, values) / np.bincount(place))[place])
