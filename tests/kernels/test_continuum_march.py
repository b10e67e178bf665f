"""Some steps of small hits, alone and together: bounds of all arrays in debug mode, the same bits again, and a core
that presses; and the exponential and the logarithm of the flow."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import ArrayLike

from warpimpact.continuum.many_hits import ManyHits
from warpimpact.continuum.meshing import BodyMesh
from warpimpact.continuum.one_hit import OneHit, Start
from warpimpact.kernels.continuum import hexahedra
from warpimpact.kernels.variant import Variant
from warpimpact.scene import MassProperties, PolynomialCore
from warpimpact.scene.flow import Flow

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
STEEL = Flow(yield_stress=2.03e9, hardening=568e6, rate_exponent=0.001, fracture_work=2.31e9)


def small_hit(velocity: float = 825.0, across: int = 5, *, double: bool = False, device: str = "cpu") -> OneHit:
    """Two layers of 5 × 5 elements with a hole beside the core; the second one begins where the first one ends."""
    y, z = np.meshgrid(*[1e-3 * (np.arange(across + 1) - 0.5 * across)] * 2, indexing="ij")
    solid = np.ones((across, across), dtype=bool)
    solid[0, :2] = False
    meshes = [BodyMesh.of_layer(y, z, solid, 1e-3 * np.arange(first, first + 3), 1e-3) for first in (0, 2)]
    still, upright = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    body = MassProperties(4e-3, CORE.mass_properties.centre_of_mass, 1.5e-8, 1.65e-7)
    start = Start(np.array([-17.5e-3, 2e-4, 0.0]), upright, np.array([velocity, 0.0, 0.0]), still, body, 0.1, 1.0e12)
    return OneHit(CORE, start, meshes, [STEEL, STEEL], double, device)


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


DIFFERENT = [(825.0, 5), (400.0, 8), (600.0, 6)]
"""Velocities of hits [m/s], and elements across their meshes."""
ELEMENTAL = ("stress", "strain", "damage", "heat", "work", "hourglass_work", "force", "crossing")
"""Arrays of elements, which mean nothing where no element is."""


def separation(values: ArrayLike, expected: ArrayLike) -> float:
    """Largest difference, as a share of the largest number."""
    return float(np.abs(np.subtract(values, expected)).max() / np.abs(expected).max())


@pytest.mark.parametrize(("double", "rounding"), [(True, 1e-11), (False, 1e-5)])
def test_hits_take_the_same_steps_together_as_one_by_one(double: bool, rounding: float, device: str) -> None:
    """To the rounding of other sums: an error in the order of a step, or of its length, is much larger."""
    one_by_one = [small_hit(*own, double=double) for own in DIFFERENT]
    together = [small_hit(*own, double=double, device=device) for own in DIFFERENT]
    many = ManyHits(together)
    for _ in range(3):
        many.advance(50)
    for one, other in zip(one_by_one, together, strict=True):
        one.advance(150)
        assert one.touched.any()
        for name in ("time", "step", "before", "first_touch", "last_touch", "steps", "status"):
            assert other.flight[name] == pytest.approx(one.flight[name], rel=rounding), name
        for name in ("position", "velocity", "attitude", "angular_momentum"):
            assert separation(other.flight["state"][name], one.flight["state"][name]) < rounding, name
        there = one.mesh.alive.numpy() > 0.0
        for name in ("position", "velocity", "contact_work", "radiated", "near", *ELEMENTAL):
            given, expected = (getattr(hit.mesh, name).numpy().reshape(-1, one.mesh.size) for hit in (other, one))
            where = there if name in ELEMENTAL else slice(None)
            assert separation(given[:, where], expected[:, where]) < 100 * rounding, name
        for name in ("moment", "stress", "stress_station"):
            assert other.flight["bending"][name] == pytest.approx(one.flight["bending"][name], rel=100 * rounding), name
        assert other.mesh.alive.numpy().tolist() == one.mesh.alive.numpy().tolist()
        assert other.mesh.awake.numpy().tolist() == one.mesh.awake.numpy().tolist()
        assert other.mesh.touched.numpy() == pytest.approx(one.mesh.touched.numpy(), rel=rounding)


def test_a_hit_has_the_same_bits_alone_and_together(device: str) -> None:
    alone, first, last, later = (small_hit(device=device) for _ in range(4))
    ManyHits([alone]).advance(150)
    others = [small_hit(*own, device=device) for own in DIFFERENT[1:]]
    ManyHits([first, others[0]]).advance(150)
    many = ManyHits([others[1], last])
    many.advance(150)
    many.put(1, later)
    many.advance(150)
    for other in (first, last, later):
        assert alone.flight == other.flight
        for name in ("position", "stress", "alive", "work"):
            assert np.array_equal(getattr(alone.mesh, name).numpy(), getattr(other.mesh, name).numpy()), name
    assert others[1].flight["steps"] == 300


@pytest.mark.parametrize("double", [False, True])
def test_exponential_and_logarithm_are_those_of_numpy(double: bool) -> None:
    variant = Variant(double=double)
    use, real = hexahedra.elementary(variant.real), variant.real

    def evaluate(
        x: wp.array(dtype=real), y: wp.array(dtype=real), powers: wp.array(dtype=real), logs: wp.array(dtype=real)
    ):
        k = wp.tid()
        powers[k] = use.exp(x[k])
        logs[k] = use.log(y[k])

    x = np.concatenate([np.linspace(-60.0, 60.0, 2001), np.linspace(-1e-3, 1e-3, 101)])
    y = np.geomspace(1e-20, 1e20, len(x))
    given: Any = [wp.array(values, dtype=real, device="cpu") for values in (x, y)]
    powers, logs = (wp.zeros(len(x), dtype=real, device="cpu") for _ in range(2))
    wp.launch(variant.kernel(evaluate), len(x), inputs=[*given, powers, logs], device="cpu")
    digits = 1e-14 if double else 4e-7
    x, y = (values.numpy().astype(np.float64) for values in given)
    reduction = np.finfo(np.float64 if double else np.float32).eps * np.abs(x)  # x less a multiple of ln 2, without FMA
    assert (np.abs(powers.numpy() / np.exp(x) - 1.0) < digits + reduction).all()
    assert np.allclose(logs.numpy(), np.log(y), rtol=digits, atol=digits)
