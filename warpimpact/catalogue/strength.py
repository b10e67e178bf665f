"""The resistance Y of a plate from published limit velocities: a hierarchical fit of their rows.

ln Y of a plate and projectile is a sum of normal parts (docs/validation.md). Two plates share a part as far as they
share what it belongs to: a material, a projectile, a source, an angle, a thickness in calibres. With the fitted sizes
of the parts, the rows give a normal distribution for any further plate, with a mean and a standard deviation.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIT_FILE = Path(__file__).parent / "limit_fit.json"
"""Rows and sizes of the fit; `python -m tests.validation.limit_catalogue` writes it."""
STEEL_DENSITY = 5000.0
"""Plate density that parts steel from aluminium [kg/m³]."""
CONSTRAINT = 3.0
"""Prior median of Y over flow stress, as in indentation (Tabor)."""
TYPICAL_METAL = {True: (1500e6, 480.0), False: (350e6, 120.0)}
"""Flow stress [Pa] and hardness [HV] of a usual steel and a usual aluminium."""
SAME_THICKNESS, SAME_CURVE = 0.2, 0.5
"""Ratios, as logarithms, over which plates share the part of a single thickness, and the part of a curve in
calibres."""
Z_90 = 1.645
"""Standard deviations from the middle of a normal distribution to the ends of its 90 % interval."""


@dataclass(frozen=True)
class Plates:
    """Plates, and what hits them; arrays of shape [plates].

    Attributes:
        projectile, bare: name in the catalogue, and whether the core alone was fired.
        material, source: names; a plate without a source has a source of its own.
        thickness, calibres: [m], and in diameters of the core.
        obliquity: [rad].
        density: [kg/m³].
        flow_stress: mean of yield and tensile strength of the material [Pa].
        hardness: of the material, Vickers.
    """

    projectile: NDArray[np.str_]
    bare: NDArray[np.bool_]
    material: NDArray[np.str_]
    source: NDArray[np.str_]
    thickness: Array
    calibres: Array
    obliquity: Array
    density: Array
    flow_stress: Array
    hardness: Array

    @property
    def steel(self) -> NDArray[np.bool_]:
        """Whether a plate is of steel."""
        return self.density > STEEL_DENSITY

    @property
    def expected(self) -> Array:
        """ln Y that indentation predicts."""
        return np.asarray(np.log(CONSTRAINT * self.flow_stress))

    @property
    def strengths(self) -> tuple[Array, Array]:
        """How much stronger than usual plates are, and how much harder than their strength suggests, as logarithms."""
        flow, hardness = np.array([TYPICAL_METAL[bool(steel)] for steel in self.steel]).T
        excess = np.log(self.flow_stress / flow)
        return excess, np.log(self.hardness / hardness) - excess


PART_SCALES: Mapping[str, float] = {
    "material": 0.15,
    "projectile": 0.1,
    "projectile in a material": 0.05,
    "source": 0.04,
    "angle in a material": 0.2,
    "exponent in a material": 0.05,
    "thickness": 0.05,
    "curve in calibres": 0.1,
    "curve in calibres of a projectile": 0.05,
}
"""Parts of ln Y whose sizes are fitted, for steel and for aluminium apart, and the prior medians of their standard
deviations."""
STEEL_ALONE = ("curve in calibres", "curve in calibres of a projectile")
"""Parts that aluminium does without: its rows follow a power of h/d."""


def part_names() -> list[str]:
    """All parts with their metal."""
    metals = {name: ("steel",) if name in STEEL_ALONE else ("steel", "aluminium") for name in PART_SCALES}
    return [f"{name}, {metal}" for name in PART_SCALES for metal in metals[name]]


def shared(plates: Plates, others: Plates) -> tuple[Array, dict[str, Array]]:
    """The common part of ln Y of plates and of others: the covariance of the parts of known size, and that of each
    fitted part at size 1, of shape [plates, others] each."""
    metals = {
        "steel": np.outer(plates.steel, others.steel).astype(float),
        "aluminium": np.outer(~plates.steel, ~others.steel).astype(float),
    }
    metal = metals["steel"] + metals["aluminium"]
    material = _same(plates.material, others.material)
    projectile = _same(plates.projectile, others.projectile)
    angles = np.outer(-np.log(np.cos(plates.obliquity)), -np.log(np.cos(others.obliquity)))
    size, other_size = np.log(plates.calibres), np.log(others.calibres)
    (excess, harder), (other_excess, other_harder) = plates.strengths, others.strengths
    fixed = metal * (0.5**2 + 0.3**2 * (np.outer(excess, other_excess) + np.outer(harder, other_harder) + angles))
    fixed += 0.1**2 * metal * np.outer(plates.bare, others.bare)
    fixed += 0.2**2 * metal * np.outer(size, other_size)
    curve = _near(size, other_size, SAME_CURVE)
    angle_alike = _same(plates.obliquity.round(3), others.obliquity.round(3))
    parts = {
        "material": material,
        "projectile": projectile,
        "projectile in a material": material * projectile,
        "source": _same(plates.source, others.source),
        "angle in a material": material * angles,
        "exponent in a material": material * np.outer(size - 1.0, other_size - 1.0),
        "thickness": material
        * projectile
        * angle_alike
        * _near(np.log(plates.thickness), np.log(others.thickness), SAME_THICKNESS),
        "curve in calibres": curve,
        "curve in calibres of a projectile": projectile * curve,
    }
    named = (name.rpartition(", ") for name in part_names())
    return fixed, {f"{part}, {of}": parts[part] * metals[of] for part, _, of in named}


class Resistance(NamedTuple):
    """The resistance of a plate and its uncertainty.

    Attributes:
        median: median of Y [Pa].
        deviation: standard deviation of ln Y; 0 where unknown.
        test: standard deviation of ln Y that the scatter of a test of the plate would add.
    """

    median: float
    deviation: float = 0.0
    test: float = 0.0

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the 90 % interval [Pa]."""
        factor = float(np.exp(Z_90 * self.deviation))
        return self.median / factor, self.median * factor


@dataclass(frozen=True)
class LimitFit:
    """The fit of the package.

    Attributes:
        rows: the measured plates.
        sizes: standard deviations of the parts of ln Y, by their names with the metal.
        test: standard deviation of ln Y by tests, by metal.
        pulled: weights of the rows in the mean of further plates, shape [rows].
        precision: inverse of the covariance of ln Y of the rows, shape [rows, rows].
    """

    rows: Plates
    sizes: Mapping[str, float]
    test: Mapping[str, float]
    pulled: Array
    precision: Array

    @classmethod
    def of(
        cls, rows: Plates, sizes: Mapping[str, float], test: Mapping[str, float], residual: Array, noise: Array
    ) -> LimitFit:
        """The fit of rows with these residuals, ln Y minus the prediction by indentation, and noise, the variance of
        ln Y of a row on its own; shape [rows] each."""
        precision = np.asarray(np.linalg.inv(covariance(rows, rows, sizes) + np.diag(noise)), dtype=np.float64)
        return cls(rows, sizes, test, precision @ residual, precision)

    def predicted(self, plates: Plates) -> tuple[Array, Array]:
        """Mean and standard deviation of ln Y of plates, of shape [plates] each; a test adds its own scatter."""
        across = covariance(plates, self.rows, self.sizes)
        left = np.diag(covariance(plates, plates, self.sizes)) - np.einsum(
            "pr,rs,ps->p", across, self.precision, across
        )
        return plates.expected + across @ self.pulled, np.sqrt(np.maximum(left, 0.0))


def covariance(plates: Plates, others: Plates, sizes: Mapping[str, float]) -> Array:
    """Covariance of ln Y of plates and others, shape [plates, others]."""
    total, parts = shared(plates, others)
    for name, size in sizes.items():
        total += size**2 * parts[name]
    return total


def resistance_of(
    material: str, *, projectile: str | None, diameter: float, thickness: float, obliquity: float
) -> Resistance:
    """Resistance of a plate of a material of the package, by all published rows of its metal, against the core of a
    threat; None, or one without rows, is any other. Diameter of the core and thickness in m, obliquity in rad.

    Raises:
        KeyError: no row is of the material.
    """
    fit = limit_fit(material)
    first = np.flatnonzero(fit.rows.material == material)[:1]
    plate = Plates(
        projectile=np.array([projectile or "any other"]),
        bare=np.array([False]),
        material=np.array([material]),
        source=np.array(["this plate"]),
        thickness=np.array([thickness]),
        calibres=np.array([thickness / diameter]),
        obliquity=np.array([obliquity]),
        density=fit.rows.density[first],
        flow_stress=fit.rows.flow_stress[first],
        hardness=fit.rows.hardness[first],
    )
    mean, deviation = fit.predicted(plate)
    test = fit.test["steel" if plate.steel[0] else "aluminium"]
    return Resistance(float(np.exp(mean[0])), float(deviation[0]), test)


def limit_fit(material: str) -> LimitFit:
    """The fit of the rows of a material's metal.

    Raises:
        KeyError: no row is of the material.
    """
    densities = dict(zip(_stored()["rows"]["material"], _stored()["rows"]["density"], strict=True))
    return _of_metal(densities[material] > STEEL_DENSITY)


@cache
def _of_metal(steel: bool) -> LimitFit:
    stored = _stored()
    columns = {name: np.array(values) for name, values in stored["rows"].items()}
    which = (columns["density"] > STEEL_DENSITY) == steel
    chosen = {name: column[which] for name, column in columns.items()}
    residual, noise = chosen.pop("residual"), chosen.pop("noise")
    return LimitFit.of(Plates(**chosen), stored["sizes"], stored["test"], residual, noise)


@cache
def _stored() -> dict[str, Any]:
    stored: dict[str, Any] = json.loads(FIT_FILE.read_text(encoding="utf-8"))
    return stored


def _same(labels: NDArray[np.generic], others: NDArray[np.generic]) -> Array:
    return np.asarray(labels[:, None] == others[None, :], dtype=np.float64)


def _near(place: Array, other: Array, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * (np.subtract.outer(place, other) / width) ** 2))
