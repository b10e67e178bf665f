"""Some steps of a small hit: bounds of all arrays in debug mode, the same bits again, and a core that presses."""

import numpy as np

from warpimpact.continuum.meshing import SheetMesh
from warpimpact.continuum.one_hit import OneHit, Start
from warpimpact.scene import PolynomialCore
from warpimpact.scene.flow import Flow

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
STEEL = Flow(yield_stress=2.03e9, hardening=568e6, rate_exponent=0.001, fracture_work=2.31e9)


def small_hit() -> OneHit:
    """Two layers of 5 × 5 elements with a hole beside the core; the second one begins where the first one ends."""
    y, z = np.meshgrid(*[1e-3 * (np.arange(6) - 2.5)] * 2, indexing="ij")
    solid = np.ones((5, 5), dtype=bool)
    solid[0, :2] = False
    sheets = [SheetMesh(y, z, solid, 1e-3 * np.arange(first, first + 3), 1e-3) for first in (0, 2)]
    still, upright = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    start = Start(
        np.array([-17.5e-3, 2e-4, 0.0]), upright, np.array([825.0, 0.0, 0.0]), still, 4e-3, 1.5e-8, 1.65e-7, 0.1
    )
    return OneHit(CORE, start, sheets, [STEEL, STEEL])


def test_a_small_hit_has_the_same_bits_again() -> None:
    one, other = small_hit(), small_hit()
    for hit in (one, other):
        hit.advance(150)
    assert one.flight == other.flight
    assert one.touched[0]
    assert one.flight["steps"] == 150
    assert one.flight["state"]["velocity"][0] < 825.0
    assert one.energies.imbalance < 0.01
    for name in ("position", "stress", "alive"):
        assert np.array_equal(getattr(one.mesh, name).numpy(), getattr(other.mesh, name).numpy()), name
