"""The materials of the continuum: flow and failure (docs/continuum.md)."""

from typing import Annotated

from pydantic import Field

from .model import Model
from .units import NonNegativeNumber, NonNegativeStress, Number, PositiveDensity, PositiveNumber, PositiveStress

NEVER = 1.0e30
"""Stress or strain beyond any."""


class Flow(Model):
    """Constants of a material in the continuum: elastic, modified Johnson–Cook with two Voce terms, Cockcroft–Latham.

    σ = (A + B ε^n + Σ Q (1 − e^(−C ε))) (1 + ε̇/ε̇₀)^c (1 − T*^m).

    Attributes:
        density: [kg/m³].
        youngs_modulus: E [Pa].
        poissons_ratio: Poisson's ν.
        yield_stress, hardening, exponent: A, B [Pa] and n.
        voce_stress, voce_rate: Q [Pa] and C of the two terms.
        rate_exponent, reference_rate: c, and ε̇₀ [1/s].
        softening: exponent m of the heat.
        heat_capacity: [J/(kg K)].
        melting_range: from the temperature before the shot to melting [K].
        taylor_quinney: share of the plastic work that becomes heat.
        fracture_work: W_cr, the integral of the largest principal stress over the plastic strain at fracture [Pa].
        spall_stress, fracture_stress: mean stress and largest principal stress at which it parts [Pa]; None is never.
        fracture_strain: plastic strain at which it parts; None is never.
    """

    density: PositiveDensity = 7850.0
    youngs_modulus: PositiveStress = 210.0e9
    poissons_ratio: Annotated[Number, Field(ge=0.0, lt=0.5)] = 0.33
    yield_stress: PositiveStress
    hardening: NonNegativeStress = 0.0
    exponent: NonNegativeNumber = 1.0
    voce_stress: tuple[NonNegativeStress, NonNegativeStress] = (0.0, 0.0)
    voce_rate: tuple[NonNegativeNumber, NonNegativeNumber] = (0.0, 0.0)
    rate_exponent: NonNegativeNumber = 0.0
    reference_rate: Annotated[Number, Field(gt=0.0)] = 5.0e-4
    softening: Annotated[Number, Field(gt=0.0)] = 1.0
    heat_capacity: Annotated[Number, Field(gt=0.0)] = 452.0
    melting_range: Annotated[Number, Field(gt=0.0)] = 1507.0
    taylor_quinney: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.9
    fracture_work: PositiveStress
    spall_stress: PositiveStress | None = None
    fracture_stress: PositiveStress | None = None
    fracture_strain: PositiveNumber | None = None

    def scaled(self, factor: float) -> "Flow":
        """All stresses and the fracture work times a factor, so that the strain at fracture stays."""
        first, second = self.voce_stress
        names = ("yield_stress", "hardening", "fracture_work", "spall_stress", "fracture_stress")
        stresses = {name: factor * stress for name in names if (stress := getattr(self, name)) is not None}
        return self.model_copy(update={**stresses, "voce_stress": (factor * first, factor * second)})

    @property
    def shear_modulus(self) -> float:
        """G [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))

    @property
    def bulk_modulus(self) -> float:
        """K [Pa]."""
        return self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poissons_ratio))

    @property
    def wave_modulus(self) -> float:
        """K + 4G/3 [Pa]."""
        return self.bulk_modulus + 4.0 / 3.0 * self.shear_modulus

    @property
    def wave_speed(self) -> float:
        """Of dilatational waves [m/s]."""
        return float((self.wave_modulus / self.density) ** 0.5)

    @property
    def constants(self) -> dict[str, float | tuple[float, float]]:
        """Fields of a Material (kernels/continuum/fields.py)."""
        given = ("density", "yield_stress", "hardening", "exponent", "voce_stress", "voce_rate", "rate_exponent")
        return {name: getattr(self, name) for name in (*given, "reference_rate", "softening", "fracture_work")} | {
            "bulk": self.bulk_modulus,
            "shear": self.shear_modulus,
            "wave_speed": self.wave_speed,
            "spall": self.spall_stress or NEVER,
            "tensile": self.fracture_stress or NEVER,
            "ductility": self.fracture_strain or NEVER,
            "heating": self.taylor_quinney / (self.density * self.heat_capacity * self.melting_range),
        }
