"""Whole hits by finite elements: symmetry, energy, layers, meshes, and the fast law (docs/continuum.md)."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from warpimpact import CirclePattern, Continuum, Plate, Record, Scene, simulate
from warpimpact.continuum import meshing, one_hit
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import NoPattern, PolynomialCore, Shots
from warpimpact.scene.flow import Flow

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
STEEL = Flow(yield_stress=2.03e9, hardening=568e6, rate_exponent=0.001, fracture_work=2.31e9)
COARSE = 0.667e-3
"""Elements of a hit [m]: six through the plate."""


def shots_at(*hits: tuple[float, float], velocity: float = 825.0, **own: float) -> Shots:
    """Shots at some hit points [m], along the normal unless told otherwise."""
    count = len(hits)
    values = {"velocity": velocity, "obliquity": 0.0, "azimuth": 0.0, "pitch": 0.0, "yaw": 0.0, "spin": 0.0} | own
    return Shots(
        hit_y=np.array([y for y, _ in hits]),
        hit_z=np.array([z for _, z in hits]),
        **{name: np.full(count, value) for name, value in values.items()},
    )


def scene_of(plate: Plate) -> Scene:
    return Scene(core=CORE, target=plate, record=Record(standoffs=(0.05, 0.13)))


HOLES = Plate(thickness=4e-3, resistance=2.6e9, pattern=CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3)))
SOLID = Plate(thickness=4e-3, resistance=2.6e9, pattern=NoPattern())


def computed(plate: Plate, shots: Shots, **settings: Any) -> Outcomes:
    chosen = {"flows": (STEEL,), "spacing": COARSE} | settings
    return simulate(scene_of(plate), shots, numerics=Continuum(**chosen))


@pytest.fixture(scope="module", autouse=True)
def _small_patch() -> Iterator[None]:
    """Patches that are too small for a result: what these tests show does not depend on that, and they take half."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(meshing, "FINE", 1.7)
        patch.setattr(meshing, "PATCH", 4.0)
        yield


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> float:
    """Elements that are too coarse for a result [m], whose hourglasses take much; what they show does not depend on
    that."""
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 1.0)
    return 1.0e-3


@pytest.fixture(scope="module")
def centred() -> Outcomes:
    return computed(HOLES, shots_at((0.0, 0.0), (4.5e-3, 4.5e-3)))


def test_a_symmetric_hit_leaves_straight(centred: Outcomes) -> None:
    assert (centred.status == Status.PERFORATED).all()
    assert np.degrees(centred.tilt).max() < 0.005
    assert (centred.residual_velocity < 820.0).all()
    way = SOLID.thickness + CORE.length  # from the first touch of the nose to the last one, at most of the base
    assert (centred.contact_duration > SOLID.thickness / 825.0).all()
    assert (centred.contact_duration < way / 700.0).all()


def test_energy_is_kept(centred: Outcomes) -> None:
    """What the core lost is in motion, stress, viscosity and contact: a scheme about the middles of steps keeps
    that."""
    assert (centred.energy_imbalance < 1e-3).all()
    assert (centred.hourglass_share < 0.12).all()


def test_a_result_has_the_same_bits_however_many_threads_compute_it(centred: Outcomes) -> None:
    shots = shots_at((0.0, 0.0), (4.5e-3, 4.5e-3))
    again = simulate(scene_of(HOLES), shots, numerics=Continuum(flows=(STEEL,), spacing=COARSE), threads=1)
    for name, values in vars(centred).items():
        assert np.array_equal(values, getattr(again, name), equal_nan=True), name


def test_a_plate_turned_with_its_shot_gives_the_turned_outcome(coarse: float) -> None:
    """y → z, z → −y, for a shot that is oblique, yawed and spins. In double precision no element fails otherwise."""
    own, numerics = {"obliquity": 0.3, "spin": 1.7e4}, {"double": True, "spacing": coarse}
    one = computed(HOLES, shots_at((1.5e-3, 0.5e-3), azimuth=0.2, yaw=0.03, **own), **numerics)
    turned = computed(HOLES, shots_at((-0.5e-3, 1.5e-3), azimuth=0.2 + 0.5 * math.pi, pitch=0.03, **own), **numerics)
    assert one.status[0] == turned.status[0] == Status.PERFORATED
    assert turned.residual_velocity == pytest.approx(one.residual_velocity, abs=0.02)
    velocity = one.exit_velocity[0]
    assert turned.exit_velocity[0] == pytest.approx([velocity[0], -velocity[2], velocity[1]], abs=0.05)
    assert np.degrees(turned.tilt) == pytest.approx(np.degrees(one.tilt), abs=0.05)


def test_a_core_that_touches_nothing_flies_on_as_by_the_fast_law() -> None:
    plate = Plate(thickness=4e-3, resistance=2.6e9, pattern=CirclePattern(diameter=12e-3, spacing=(16e-3, 16e-3)))
    shots = shots_at((0.0, 0.0), spin=1.7e4, obliquity=0.1)
    fast, slow = simulate(scene_of(plate), shots), computed(plate, shots)
    assert fast.status[0] == slow.status[0] == Status.UNTOUCHED
    assert slow.residual_velocity == pytest.approx(fast.residual_velocity, rel=1e-6)
    assert slow.tilt == pytest.approx(fast.tilt, abs=1e-6)
    assert slow.angular_velocity == pytest.approx(fast.angular_velocity, rel=1e-6, abs=1e-3)
    assert slow.energy_loss[0] == 0.0
