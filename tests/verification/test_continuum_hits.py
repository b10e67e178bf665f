"""Whole hits by finite elements: symmetry, energy, layers, meshes, and the fast law (docs/continuum.md)."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from warpimpact import CirclePattern, FiniteElements, Layer, Plate, Record, Scene, simulate
from warpimpact.continuum import meshing, one_hit
from warpimpact.continuum.handover import layers_before_base, room_of, worse_bending
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import NoPattern, Shots, Target
from warpimpact.scene.flow import Flow
from warpimpact.solver.fast_law import FastLaw

from .scenes import PAPER_CORE as CORE
from .scenes import shots_at

STEEL = Flow(yield_stress=2.03e9, hardening=568e6, rate_exponent=0.001, fracture_work=2.31e9)
COARSE = 0.667e-3
"""Elements of a hit [m]: six through the plate."""


def scene_of(plate: Plate) -> Scene:
    return Scene(core=CORE, target=plate, record=Record(standoffs=(0.05, 0.13)))


HOLES = Plate(thickness=4e-3, resistance=2.6e9, pattern=CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3)))
SOLID = Plate(thickness=4e-3, resistance=2.6e9, pattern=NoPattern())


def computed(plate: Plate, shots: Shots, **settings: Any) -> Outcomes:
    chosen = {"flows": (STEEL,), "spacing": COARSE} | settings
    return simulate(scene_of(plate), shots, method=FiniteElements(**chosen))


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
    return computed(HOLES, shots_at([0.0, 4.5e-3], [0.0, 4.5e-3]))


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
    shots = shots_at([0.0, 4.5e-3], [0.0, 4.5e-3])
    again = simulate(scene_of(HOLES), shots, method=FiniteElements(flows=(STEEL,), spacing=COARSE), threads=1)
    for name, values in vars(centred).items():
        assert np.array_equal(values, getattr(again, name), equal_nan=True), name


def test_a_plate_turned_with_its_shot_gives_the_turned_outcome(coarse: float) -> None:
    """y → z, z → −y, for a shot that is oblique, yawed and spins. In double precision no element fails otherwise."""
    own, numerics = {"obliquity": 17.0, "spin": 1.7e4}, {"double": True, "spacing": coarse}
    one = computed(HOLES, shots_at(1.5e-3, 0.5e-3, azimuth=11.0, yaw=2.0, **own), **numerics)
    turned = computed(HOLES, shots_at(-0.5e-3, 1.5e-3, azimuth=101.0, pitch=2.0, **own), **numerics)
    assert one.status[0] == turned.status[0] == Status.PERFORATED
    assert turned.residual_velocity == pytest.approx(one.residual_velocity, abs=0.02)
    velocity = one.exit_velocity[0]
    assert turned.exit_velocity[0] == pytest.approx([velocity[0], -velocity[2], velocity[1]], abs=0.05)
    assert np.degrees(turned.tilt) == pytest.approx(np.degrees(one.tilt), abs=0.05)


def test_a_core_that_touches_nothing_flies_on_as_by_the_fast_law() -> None:
    plate = Plate(thickness=4e-3, resistance=2.6e9, pattern=CirclePattern(diameter=12e-3, spacing=(16e-3, 16e-3)))
    shots = shots_at(spin=1.7e4, obliquity=6.0)
    fast, slow = simulate(scene_of(plate), shots), computed(plate, shots)
    assert fast.status[0] == slow.status[0] == Status.UNTOUCHED
    assert slow.residual_velocity == pytest.approx(fast.residual_velocity, rel=1e-6)
    assert slow.tilt == pytest.approx(fast.tilt, abs=1e-6)
    assert slow.angular_velocity == pytest.approx(fast.angular_velocity, rel=1e-6, abs=1e-3)
    assert slow.energy_loss[0] == 0.0


# --- Elements through the add-on, the fast law through the base (continuum/handover.py) ---

HANDED_ON = FiniteElements(flows=(STEEL,), spacing=1.0e-3, layers=1)
GAP = 60e-3


def before(base: Layer) -> Target:
    return Target(layers=(HOLES, base))


def test_behind_a_base_that_does_not_resist_a_core_ends_as_without_it(coarse: float) -> None:
    shots, behind = shots_at(1.5e-3, 0.5e-3, obliquity=11.0, spin=1.7e4, yaw=2.0), GAP + 5e-3
    alone = Scene(core=CORE, target=HOLES, record=Record(standoffs=(0.05 + behind, 0.13 + behind), bending=True))
    air = before(Layer(thickness=5e-3, gap=GAP, resistance=0.0, shear_coefficient=0.05))
    through = Scene(core=CORE, target=air, record=Record(standoffs=(0.05, 0.13), bending=True))
    one, other = (simulate(scene, shots, method=HANDED_ON, device="cpu") for scene in (alone, through))
    assert one.status[0] == other.status[0] == Status.PERFORATED
    assert other.layer_status[0].tolist() == [Status.PERFORATED, Status.PERFORATED]
    for name in ("residual_velocity", "deflection", "exit_velocity", "energy_loss", "bending_stress"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-5, abs=1e-5), name
    spins = [np.linalg.norm(outcomes.angular_velocity) for outcomes in (one, other)]  # the axis goes on turning
    assert spins[1] == pytest.approx(spins[0], rel=1e-5)
    assert other.tilt == pytest.approx(one.tilt, abs=1e-4)


def test_of_two_passages_the_larger_stress_and_the_first_break_count() -> None:
    kinds = [(name, float) for name in ("moment", "moment_station", "stress", "stress_station", "broken_time")]
    rows = np.dtype([*kinds, ("broken", int)])
    before = np.array([(1.0, 0.1, 5.0, 0.2, 3.0, 1), (9.0, 0.3, 4.0, 0.4, 0.0, 0)], dtype=rows)
    later = np.array([(2.0, 0.5, 4.0, 0.6, 8.0, 1), (3.0, 0.7, 6.0, 0.8, 7.0, 1)], dtype=rows)
    worst = [(2.0, 0.5, 5.0, 0.2, 3.0, 1), (9.0, 0.3, 6.0, 0.8, 7.0, 1)]
    assert worse_bending(before, later).tolist() == worst


@pytest.mark.parametrize("thickness", [6e-3, 40e-3], ids=["that it passes", "that stops it"])
def test_a_straight_core_enters_the_base_as_a_shot_of_its_velocity(thickness: float, coarse: float) -> None:
    base = Layer(thickness=thickness, gap=GAP, resistance=2e9, shear_coefficient=0.05)
    shots = shots_at()
    through = simulate(Scene(core=CORE, target=before(base)), shots, method=HANDED_ON, device="cpu")
    assert through.layer_status[0, 0] == Status.PERFORATED
    slower = shots_at(velocity=float(through.layer_residual_velocity[0, 0]))
    plate = SOLID.model_copy(update={"thickness": thickness, "resistance": 2e9, "shear_coefficient": 0.05})
    alone = simulate(Scene(core=CORE, target=plate), slower, method=FastLaw(level=3), device="cpu")
    assert through.status[0] == through.layer_status[0, 1] == alone.status[0]
    assert through.residual_velocity == pytest.approx(alone.residual_velocity, abs=0.3)
    lost = 0.5 * CORE.mass * (825.0**2 - alone.residual_velocity[0] ** 2)
    assert through.energy_loss[0] == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize(
    ("layers", "expected"),
    [
        pytest.param((HOLES, Layer(thickness=5e-3, gap=GAP, resistance=1e9)), 1, id="a solid base behind a gap"),
        pytest.param((HOLES, Layer(thickness=5e-3, gap=10e-3, resistance=1e9)), 2, id="no room for the core"),
        pytest.param((HOLES, Layer(**HOLES.model_dump(), gap=GAP)), 2, id="a perforated base"),
        pytest.param((SOLID, Layer(thickness=5e-3, gap=GAP, resistance=1e9)), 1, id="a solid add-on"),
        pytest.param((SOLID,), 1, id="one plate"),
    ],
)
def test_elements_are_for_layers_in_front_of_a_solid_base(layers: tuple[Layer, ...], expected: int) -> None:
    assert layers_before_base(CORE, Target(layers=layers)) == expected


@pytest.mark.parametrize(
    ("gap", "layers", "sentence"),
    [(GAP, 3, "got 3, but the target has 2"), (0.9 * room_of(CORE), 1, "layer 1 is 27.77 mm.* needs 30.86 mm")],
)
def test_a_handover_without_room_is_refused(gap: float, layers: int, sentence: str) -> None:
    scene = Scene(core=CORE, target=before(Layer(thickness=5e-3, gap=gap, resistance=1e9)))
    with pytest.raises(ValueError, match=sentence):
        simulate(scene, shots_at(), method=HANDED_ON.model_copy(update={"layers": layers}), device="cpu")
