"""Localized interaction: normal stress on an advancing surface element (MODEL §4, Ben-Dor et al.)."""

import math

from .model import Model
from .plate import Plate
from .units import NonNegativeNumber


class Interaction(Model):
    """σ = static·Y + linear·√(ρY)·v_n + quadratic·ρ·v_n², v_n the normal speed of the element.

    The default is the paper's constant stress Y; (A, 0, B) is Poncelet's law, (A, C, B) the three-term
    law of spherical cavity expansion.
    """

    static: NonNegativeNumber = 1.0
    linear: NonNegativeNumber = 0.0
    quadratic: NonNegativeNumber = 0.0

    def coefficients(self, plate: Plate) -> tuple[float, float, float]:
        """(a0 [Pa], a1 [Pa s/m], a2 [Pa s²/m²]) of σ = a0 + a1·v_n + a2·v_n² in undegraded material."""
        resistance, density = plate.resistance, plate.density
        return (
            self.static * resistance,
            self.linear * math.sqrt(density * resistance),
            self.quadratic * density,
        )
