"""A hierarchical fit of published limit velocities: one law for all materials, one strength for each.

ln Y of a row is a sum of normal parts: what tensile test and hardness say of its material, the material's own excess,
an exponent of h/d and a growth with the angle (common, and the material's own), what all rows of a projectile, of a
projectile in a material, and of a source share, and what neighbouring thicknesses of one plate, projectile and angle
share. The rest is the measured standard deviation and the scatter of tests, with the tails of Student's t. Given the
sizes of these parts everything is normal, so that predictions are exact and a likelihood costs one Cholesky
decomposition.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.stats import t as student

from .limit_rows import Array, Rows, joined, log_unit, unit

HEAVY = 5000.0
"""Plate density that parts steel from aluminium [kg/m³]."""
CONSTRAINT = 3.0
"""Prior median of Y over flow stress: that of indentation (Tabor)."""
TYPICAL = {True: (1500e6, 480.0), False: (350e6, 120.0)}
"""Flow stress [Pa] and hardness [HV] of a usual steel and a usual aluminium."""
PART_SCALES = {
    "material": 0.15,
    "projectile": 0.1,
    "projectile in a material": 0.05,
    "source": 0.04,
    "angle in a material": 0.2,
    "exponent in a material": 0.05,
    "thickness": 0.05,
    "test": 0.03,
}
"""Prior medians of the standard deviations of the parts of ln Y; each is lognormal with σ = 0.7."""
_OF_SCALES = 0.7
_NEAR = 0.2
"""Ratio of thicknesses, as a logarithm, over which rows of a plate share what the law misses."""
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
        """Standard deviations of the parts of ln Y."""
        return dict(zip(names(self.law), np.exp(self.values).tolist(), strict=False))

    @property
    def coefficients(self) -> dict[str, float]:
        """η, C and B."""
        return coefficients(self.law, self.values)


def names(law: Law) -> list[str]:
    """The parts of ln Y in a law whose size is fitted."""
    return [name for name in PART_SCALES if law.exponent or name != "exponent in a material"]


def coefficients(law: Law, values: Array) -> dict[str, float]:
    """η, C and B of a law at some values of its parameters."""
    given = dict(zip(law.free, values[len(names(law)) :].tolist(), strict=True))
    friction = min(float(np.exp(given["friction"])), 0.3) if "friction" in given else law.friction
    return {"friction": friction, "linear": given.get("linear", 0.0), "quadratic": given.get("quadratic", 0.0)}


@dataclass
class Model:
    """Rows under a law: covariances of the parts of ln Y, shape [rows, rows] each.

    Attributes:
        rows: what was measured.
        law: the law.
        weights: of rows, below 1 where a row lies far outside.
    """

    rows: Rows
    law: Law
    weights: Array = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        rows = self.rows
        self.nodes = unit(rows, self.law.onset)
        self.weights = np.ones(len(rows)) if not len(self.weights) else self.weights
        steel = rows.density > HEAVY
        flow, hardness = (_mean_of(rows.material, values) for values in (rows.flow_stress, rows.hardness))
        usual = np.array([TYPICAL[bool(one)] for one in steel]).T
        self.expected = np.log(CONSTRAINT * flow)
        excess = np.log(flow / usual[0])
        harder = np.log(hardness / usual[1]) - excess
        metal, material = _same(steel), _same(rows.material)
        angle, size = -np.log(np.cos(rows.obliquity)), np.log(rows.calibres)
        self.basis = {"usual": steel, "excess": excess, "harder": harder, "size": size, "angle": angle}
        bare = rows.bare.astype(float)
        self.fixed = metal * (0.5**2 + 0.3**2 * (np.outer(excess, excess) + np.outer(harder, harder)))
        self.fixed += 0.3**2 * metal * np.outer(angle, angle) + 0.1**2 * np.outer(bare, bare)
        if self.law.exponent:
            self.fixed += 0.2**2 * metal * np.outer(size, size)
        plate = material * _same(rows.projectile)
        near = np.subtract.outer(np.log(rows.thickness), np.log(rows.thickness)) / _NEAR
        parts = {
            "material": material,
            "projectile": _same(rows.projectile) * metal,
            "projectile in a material": plate,
            "source": _same(rows.source),
            "angle in a material": material * np.outer(angle, angle),
            "exponent in a material": material * np.outer(size - 1.0, size - 1.0),
            "thickness": plate * _same(rows.obliquity.round(3)) * np.exp(-0.5 * near**2),
        }
        self.parts = {name: parts[name] for name in names(self.law) if name in parts}
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
        return np.asarray(self.measured + np.exp(2.0 * values[names(self.law).index("test")]))

    def signal(self, values: Array) -> Array:
        """Covariance of ln Y without the noise, shape [rows, rows]."""
        found = self.fixed.copy()
        for name, part in self.parts.items():
            found += np.exp(2.0 * values[names(self.law).index(name)]) * part
        return found

    def strength(self, values: Array, wanted: Rows) -> tuple[Array, Array]:
        """Mean and standard deviation of ln Y of some plates of these materials, without what a source and a single
        thickness add, of each shape [wanted]."""
        count = len(self.rows)
        both = Model(joined(self.rows, wanted), self.law)
        shared = both.fixed.copy()
        for name, part in both.parts.items():
            if name not in ("thickness", "source"):
                shared += np.exp(2.0 * values[names(self.law).index(name)]) * part
        known = self.signal(values) + np.diag(self.noise(values) / self.weights)
        factor, across = cho_factor(known, lower=True), shared[count:, :count]
        mean = both.expected[count:] + across @ cho_solve(factor, self.residual(values))
        left = np.diag(shared)[count:] - (across * cho_solve(factor, across.T).T).sum(axis=1)
        return mean, np.sqrt(left)

    def log_posterior(self, values: Array) -> float:
        """Logarithm of marginal likelihood and prior."""
        count = len(names(self.law))
        medians = np.log([PART_SCALES[name] for name in names(self.law)])
        prior = -0.5 * (((values[:count] - medians) / _OF_SCALES) ** 2).sum()
        for name, value in zip(self.law.free, values[count:], strict=True):
            mean, spread = COEFFICIENTS[name]
            prior -= 0.5 * ((value - mean) / spread) ** 2
        if (values[:count] < -9.0).any() or (values[:count] > 1.0).any():
            return -1e10
        covariance = self.signal(values) + np.diag(self.noise(values) / self.weights)
        factor = cho_factor(covariance, lower=True)
        y = self.residual(values)
        likelihood = -np.log(np.diag(factor[0])).sum() - 0.5 * y @ cho_solve(factor, y)
        return float(prior + likelihood - 0.5 * len(y) * np.log(2.0 * np.pi))

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


def fit(rows: Rows, law: Law = CHOSEN, *, rounds: int = 2) -> Fit:
    """Find the most probable sizes of the parts and coefficients of a law; rows that lie far outside count less."""
    start = np.log([PART_SCALES[name] for name in names(law)])
    values = np.concatenate([start, [COEFFICIENTS[name][0] for name in law.free]])
    model = Model(rows, law)
    for turn in range(rounds):
        options = {"maxiter": 25 if turn < rounds - 1 else 60}
        found = minimize(lambda at, model=model: -model.log_posterior(at), values, method="L-BFGS-B", options=options)
        values = found.x
        if turn < rounds - 1:
            model = model.weighed(values)
    return Fit(law, values, model.log_posterior(values))


def _same(labels: NDArray[np.generic]) -> Array:
    return (labels[:, None] == labels[None, :]).astype(float)


def _mean_of(labels: NDArray[np.str_], values: Array) -> Array:
    """Of each row the mean of the rows with its label, shape [rows]."""
    _, place = np.unique(labels, return_inverse=True)
    return np.asarray((np.bincount(place, values) / np.bincount(place))[place])
