"""Rings of the core: a closed surface, whose areas and volume are the core's."""

import numpy as np
import pytest

from warpimpact.scene import ConeCore, Core, OgiveCore, PolynomialCore, ProfileCore
from warpimpact.solver.rings import rings_of

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, density=7850.0)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, density=7850.0)
TABLE = ProfileCore(s=(0.0, 3e-3, 11e-3, 20e-3), r=(1e-3, 2e-3, 3e-3, 2.5e-3), density=7850.0)
CORES = pytest.mark.parametrize("core", [PAPER, OGIVE, CONE, TABLE], ids=["paper", "ogive", "cone", "table"])


@CORES
def test_rings_close_the_surface(core: Core) -> None:
    around = 16
    rings = rings_of(core, 20, around)
    assert around * rings.area_axial.sum() == pytest.approx(0.0, abs=1e-12 * np.pi * core.max_radius**2)
    # Seen from the side a core shows 2 ∫ r ds; azimuths of the patches are those of their middles.
    s, weights = np.polynomial.legendre.leggauss(200)
    shadow = core.length * core.radius(core.length * (1 + s) / 2) @ weights
    facing = np.cos(2 * np.pi * (np.arange(around) + 0.5) / around).clip(0).sum()
    assert facing * rings.area_radial.sum() == pytest.approx(shadow, rel=1e-4)


@CORES
def test_volume_of_the_rings_converges_to_the_core_s(core: Core) -> None:
    # V = ⅓ ∮ x·dA with one point per patch: second order in the rings.
    volume = core.mass_properties.mass / 7850.0
    errors = []
    for axial in (16, 32, 64):
        rings = rings_of(core, axial, 256)
        actual = 256 / 3 * (rings.station @ rings.area_axial + rings.radius @ rings.area_radial)
        errors.append(abs(actual / volume - 1))
    assert errors[0] < 0.01
    assert errors[2] < max(errors[0] / 8, 1e-4)
