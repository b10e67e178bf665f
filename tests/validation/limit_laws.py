"""Laws of a plate's resistance and simple rivals, fitted to published limit velocities, and what they predict.

Every law gives the logarithm of a limit velocity as a + x(k) + s ε: a belongs to the material, x follows from the plate
and from the parameters k of a node, ε is standard normal and s is the discrepancy. A Gaussian prior of a and a grid of
k and s with prior weights make evidence and prediction exact sums.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import stats

from .limit_rows import CORE, DENSITY, NODES, Array, Rows, metal

CONSTRAINT = 3.0
"""Prior median of Y over flow stress where Y does not depend on the thickness: that of indentation (Tabor)."""
STRENGTH_SPREAD = 0.5
"""Prior standard deviation of ln Y."""


class Prior(NamedTuple):
    """Values of a parameter and their prior weights."""

    values: Array
    weights: Array


def _weighed(values: Array, density: Array) -> Prior:
    return Prior(values, density / density.sum())


def fixed(value: float) -> Prior:
    """A parameter that is known."""
    return Prior(np.array([value]), np.ones(1))


_ETA, _B, _C, _N = (
    np.linspace(0.01, 0.15, 8),
    np.linspace(0.5, 1.5, 5),
    np.linspace(0.05, 0.85, 5),
    np.linspace(0.4, 1, 25),
)
FRICTION = _weighed(_ETA, stats.lognorm(0.5, scale=0.05).pdf(_ETA))
"""η: the paper's 0.05, within a factor of 2.7 with a probability of 95 %."""
QUADRATIC = _weighed(_B, stats.norm(1.0, 0.25).pdf(_B))
"""B: spherical cavity expansion gives 1.5 in an incompressible plate and about 1 in metals."""
LINEAR = _weighed(_C, stats.norm(0.45, 0.2).pdf(_C))
"""C: fits of the three-term law to cavity expansion in aluminium give about 0.44 with this definition of Y."""
EXPONENT = _weighed(_N, stats.norm(0.7, 0.15).pdf(_N))
"""De Marre's exponent of the thickness, 0.7."""
_S = np.array([0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.09, 0.13])
DISCREPANCY = _weighed(_S, stats.lognorm(0.5, scale=0.025).pdf(_S) * np.gradient(_S))
"""s: relative discrepancy of a limit velocity, of experiment and law together."""


def thin_plate(thickness: Array) -> Array:
    """Y over flow stress of a ductile plate under a sharp rigid core (Rosenberg and Dekel), shape as `thickness` [m].

    Near a free face material is pushed aside more easily, so a plate resists the less the thinner it is.
    """
    calibres = thickness / CORE.diameter
    return np.where(calibres < 1.0 / 3.0, 2.0 / 3.0 + 4.0 * calibres, 2.0 + 0.8 * np.log(np.maximum(calibres, 1.0)))


class Shapes(NamedTuple):
    """What a law says of some rows before its strength is fitted.

    Attributes:
        x: logarithm of the limit velocity less a, shape [nodes, rows].
        weights: prior weights of the nodes, shape [nodes].
    """

    x: Array
    weights: Array


@dataclass(frozen=True)
class Law:
    """One law, or a rival.

    Attributes:
        name: as it is shown.
        parameters: how many are free, beside the discrepancy.
        friction, linear, quadratic: priors of η, C and B; None marks a rival that knows no core.
        exponent: prior of the exponent of the thickness, of a rival.
        thin: whether Y depends on the thickness as in `thin_plate`.
    """

    name: str
    parameters: int
    friction: Prior | None = None
    linear: Prior | None = None
    quadratic: Prior | None = None
    exponent: Prior | None = None
    thin: bool = False

    def shapes(self, rows: Rows) -> Shapes:
        """What the law says of the rows."""
        return self._rival(rows) if self.exponent is not None else self._model(rows)

    def expected(self, rows: Rows) -> Array:
        """Prior mean of a: that of the flow stress of the plate, shape [rows]."""
        return 0.5 * np.log(rows.flow_stress * (1.0 if self.thin else CONSTRAINT))

    def _rival(self, rows: Rows) -> Shapes:
        """½ m v² = Y π R² h / cos θ at a thickness of four calibres, another exponent on both sides of it."""
        assert self.exponent is not None
        reference = 4.0 * CORE.diameter
        work = np.pi * CORE.max_radius**2 * reference / CORE.mass_properties.mass
        x = np.multiply.outer(self.exponent.values, np.log(rows.thickness / reference))
        oblique = np.where(self.exponent.values == 0.5, 0.5, 1.0)  # De Marre divides by cos θ
        x -= np.multiply.outer(oblique, np.log(np.cos(rows.obliquity)))
        return Shapes(x + 0.5 * np.log(2.0 * work), self.exponent.weights)

    def _model(self, rows: Rows) -> Shapes:
        assert self.friction is not None
        linear, quadratic = self.linear or fixed(0.0), self.quadratic or fixed(0.0)
        relative = rows.density / np.array([DENSITY[metal(density)] for density in rows.density])
        x = np.array([
            unit_velocity(rows, eta, c * np.sqrt(relative), b * relative)
            for eta in self.friction.values
            for c in linear.values
            for b in quadratic.values
        ])  # fmt: skip
        x += 0.5 * np.log(thin_plate(rows.thickness)) if self.thin else 0.0
        weights = np.multiply.outer(np.multiply.outer(self.friction.weights, linear.weights), quadratic.weights)
        return Shapes(x, weights.ravel())


def unit_velocity(rows: Rows, friction: float, linear: Array, quadratic: Array) -> Array:
    """Logarithm of the limit velocity at Y = 1 Pa, interpolated in the table by parabolas, shape [rows].

    Args:
        friction: η.
        linear, quadratic: C and B of the density of the table, shape [rows].
    """
    values = 2.0 * np.log(rows.unit)
    for name, at in (("friction", np.full(len(rows), friction)), ("linear", linear), ("quadratic", quadratic)):
        weights = _lagrange(np.array(NODES[name]), at)
        values = np.einsum("rn...,rn->r...", values, weights)
    return 0.5 * values


def _lagrange(nodes: Array, at: Array) -> Array:
    """Weights of the nodes for polynomials through them, shape [at, nodes]."""
    weights = np.ones((len(at), len(nodes)))
    for i, own in enumerate(nodes):
        for other in np.delete(nodes, i):
            weights[:, i] *= (at - other) / (own - other)
    return weights


LAWS = (
    Law("static", 2, FRICTION),
    Law("Poncelet", 3, FRICTION, quadratic=QUADRATIC),
    Law("three-term", 4, FRICTION, LINEAR, QUADRATIC),
    Law("static, thin plate", 2, FRICTION, thin=True),
)
RIVALS = (
    Law("De Marre, prior", 2, exponent=EXPONENT),
    Law("De Marre, 0.7", 1, exponent=fixed(0.7)),
    Law("energy per area", 1, exponent=fixed(0.5)),
)


@dataclass(frozen=True)
class Fit:
    """A law fitted to some rows of one material; arrays of shape [discrepancies, nodes].

    Attributes:
        evidence: logarithm of the marginal likelihood of ln v.
        weights: posterior.
        offset, spread: mean and standard deviation of a.
    """

    law: Law
    evidence: float
    weights: Array
    offset: Array
    spread: Array

    def predict(self, rows: Rows) -> tuple[Array, Array, Array]:
        """Median and both ends of the 90 % interval of the limit velocity [m/s], each of shape [rows]."""
        x = self.law.shapes(rows).x
        spread = np.hypot(self.spread, DISCREPANCY.values[:, None])
        found = np.empty((3, len(rows)))
        for row in range(len(rows)):
            mean = self.offset + x[:, row]
            found[:, row] = [_quantile(self.weights, mean, spread, share) for share in (0.5, 0.05, 0.95)]
        median, low, high = np.exp(found)
        return median, low, high

    def strength(self) -> tuple[float, float, float]:
        """Median and both ends of the 90 % interval of Y [Pa]; of the flow stress where the law is for thin plates."""
        found = [_quantile(self.weights, self.offset, self.spread, share) for share in (0.5, 0.05, 0.95)]
        median, low, high = np.exp(2.0 * np.array(found))
        return float(median), float(low), float(high)


def fit(law: Law, rows: Rows, *, expected: float | None = None, strength_spread: float = STRENGTH_SPREAD) -> Fit:
    """Fit a law to rows of one material.

    The covariance of the rows is s² I + p² 1 1ᵀ with p the prior spread of a, so determinant and inverse are known.

    Args:
        expected: prior mean of a; None follows from the flow stress.
        strength_spread: prior standard deviation of ln Y.
    """
    shapes = law.shapes(rows)
    mean = float(law.expected(rows).mean()) if expected is None else expected
    residual = np.log(rows.velocity) - mean - shapes.x
    prior, noise, count = (strength_spread / 2.0) ** 2, DISCREPANCY.values[:, None] ** 2, len(rows)
    total, squares = residual.sum(axis=1), (residual**2).sum(axis=1)
    share = prior / (noise + count * prior)
    log = -0.5 * (squares - share * total**2) / noise
    log -= 0.5 * (np.log1p(count * prior / noise) + count * np.log(2.0 * np.pi * noise))
    log = log + np.log(DISCREPANCY.weights)[:, None] + np.log(shapes.weights)
    peak = log.max()
    weights = np.exp(log - peak)
    spread = np.sqrt(prior * noise / (noise + count * prior))
    return Fit(
        law=law,
        evidence=float(peak + np.log(weights.sum())),
        weights=weights / weights.sum(),
        offset=mean + share * total,
        spread=np.broadcast_to(spread, weights.shape),
    )


def power_law(rows: Rows, tested: Rows) -> Array:
    """De Marre's law v = K hⁿ / cos θ by least squares: limit velocities of the tested rows [m/s].

    n is free where the rows have two thicknesses that differ, else 0.7.
    """
    logs, level = np.log(rows.thickness), np.log(rows.velocity * np.cos(rows.obliquity))
    centred = logs - logs.mean()
    varied = np.ptp(logs) > 1e-9
    exponent = (centred * level).sum() / (centred**2).sum() if varied else 0.7
    answer = level.mean() + exponent * (np.log(tested.thickness) - logs.mean()) - np.log(np.cos(tested.obliquity))
    return np.asarray(np.exp(answer))


def _quantile(weights: Array, mean: Array, spread: Array, share: float) -> float:
    """Quantile of a mixture of normal distributions, by bisection."""
    low, high = float((mean - 6.0 * spread).min()), float((mean + 6.0 * spread).max())
    for _ in range(40):
        middle = 0.5 * (low + high)
        below = float((weights * stats.norm.cdf((middle - mean) / spread)).sum())
        low, high = (middle, high) if below < share else (low, middle)
    return 0.5 * (low + high)
