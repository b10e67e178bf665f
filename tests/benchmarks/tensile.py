"""Constants of the continuum by rule from the tensile test of a metal."""

import math
from typing import NamedTuple

from scipy.special import lambertw

from warpimpact.catalogue.strength import STEEL_DENSITY
from warpimpact.scene.flow import Flow


class Metal(NamedTuple):
    """Usual values of a kind of metal, as in `Flow`, and the logarithmic plastic strain where necking begins."""

    youngs_modulus: float
    poissons_ratio: float
    uniform_strain: float
    rate_exponent: float
    heat_capacity: float
    melting_range: float
    fracture_work: float


STEEL = Metal(210.0e9, 0.33, 0.06, 0.005, 452.0, 1507.0, 2.0e9)
ALUMINIUM = Metal(70.0e9, 0.33, 0.08, 0.001, 910.0, 600.0, 150.0e6)
"""Its fracture work is between that of AA6082-T6 and that of AA7075-T651."""


def flow_from_tensile_test(density: float, yield_stress: float, tensile_strength: float) -> Flow:
    """Constants by rule: yield, then one Voce term to the true ultimate stress.

    Where necking begins the true stress R_m e^(ε_u) equals its slope (Considère), which gives both constants of the
    term. A metal whose strengths allow no such point does not harden beyond that stress.

    Args:
        density: [kg/m³]; it tells steel from aluminium.
        yield_stress, tensile_strength: engineering values [Pa].
    """
    metal = STEEL if density > STEEL_DENSITY else ALUMINIUM
    ultimate = tensile_strength * math.exp(metal.uniform_strain)
    gain = max(ultimate - yield_stress, 0.0)
    slope = metal.uniform_strain * ultimate / gain if gain else math.inf
    exponent = float(-slope - lambertw(-slope * math.exp(-slope), k=-1).real) if slope < 1.0 else 1.0
    return Flow(
        density=density,
        yield_stress=yield_stress,
        voce_stress=(gain / -math.expm1(-exponent), 0.0),
        voce_rate=(exponent / metal.uniform_strain, 0.0),
        **{name: value for name, value in metal._asdict().items() if name in Flow.model_fields},
    )
