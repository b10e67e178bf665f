"""The law by which the material resists (docs/model.md §4), and its stress on the host.

kernels/interaction.py has the same stress on the device. The host integrates limit velocities of solid plates from it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .model import Model
from .target import Plate
from .units import NonNegativeNumber, PositiveNumber


class FreeSurface(Model):
    """How material near a face or an edge resists less, and steep surfaces are pressed harder (docs/model.md §4.9).

    r is the radius of the core at a surface element, H the thickness of the layer. The numbers were fitted to finite
    elements without friction and weakening, with `quadratic` = 1 beside them (docs/continuum.md).

    Attributes:
        reach: λ; A·Y is divided by 1 + r / λH.
        attack: c; c·A·Y·sin α is added, α the angle between the surface and the velocity of the core.
        cover: k; the element presses by 1 − exp(−k b / r), b the length of material ahead of it along its normal in the
            plane of the layer.
        carried: s; of the material behind the element, which the core pushes ahead of itself, this share adds to b.
        gap: t; of the distance from there to an element in a hole, this share is taken off.
    """

    reach: PositiveNumber = 1.0
    attack: NonNegativeNumber = 1.45
    cover: PositiveNumber = 1.7
    carried: NonNegativeNumber = 0.35
    gap: NonNegativeNumber = 0.05


class Interaction(Model):
    """σ = static·Y + linear·√(ρY)·v_n + quadratic·ρ·v_n², v_n the normal speed of the element.

    The default is the paper's constant stress Y; (A, 0, B) is Poncelet's law, (A, C, B) the three-term
    law of spherical cavity expansion.

    Attributes:
        static: A, share of the resistance Y.
        linear: C, of √(ρY)·v_n.
        quadratic: B, of ρ·v_n².
        onset: κ, closing speed over which contact sets in, as a share of the speed v of the centre of mass. Normal
            stress, friction and exposure are multiplied by min(1, v_n / (κ v)). With 0 contact sets in at once; the
            outcome of a wall with friction that slides along itself, such as a shank, then depends on the numerics.
        free_surface: how material near faces and edges resists less; without it, it does not.
    """

    static: NonNegativeNumber = 1.0
    linear: NonNegativeNumber = 0.0
    quadratic: NonNegativeNumber = 0.0
    onset: NonNegativeNumber = 0.005
    free_surface: FreeSurface | None = None


NEAR_EDGES = Interaction(quadratic=1.0, free_surface=FreeSurface())
"""The law with free surfaces as it was fitted, with the inertia of what is pushed aside."""
TERMS = ("static", "linear", "quadratic")
"""Keys of the terms of the stress; that at rest is the first."""


def coefficients(terms: Mapping[str, Any], resistance: Any, density: float) -> dict[str, Any]:
    """a0 [Pa], a1 [Pa s/m] and a2 [Pa s²/m²] of σ = a0 + a1·v_n + a2·v_n² in undegraded material, from A, C, B by key,
    Y [Pa] and ρ [kg/m³]. All but the density may be arrays of shapes that broadcast."""
    a0, a1 = terms["static"] * resistance, terms["linear"] * np.sqrt(density * resistance)
    return {"a0": a0, "a1": a1, "a2": terms["quadratic"] * density}


def normal_stress(law: Interaction, plate: Plate, resistance: Any, closing: Any, attack: Any, radius: Any) -> Any:
    """Normal stress [Pa] of undamaged material; all but law and plate may be arrays that broadcast.

    Args:
        resistance, closing: Y [Pa], and the closing speed v_n [m/s].
        attack, radius: sine of the angle between surface and velocity of the core, and its radius there [m].
    """
    a0, a1, a2 = coefficients(dict(law), resistance, plate.density).values()
    if (free := law.free_surface) is not None:
        a0 = a0 * (1.0 / (1.0 + radius / (free.reach * plate.thickness)) + free.attack * np.minimum(attack, 1.0))
    return a0 + closing * (a1 + a2 * closing)
