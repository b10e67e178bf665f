"""Several shots at one plate: exposure adds, cores leave channels (docs/model.md §8), and nothing else couples them."""

from dataclasses import replace
from math import acos, pi, sqrt
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import ArrayLike

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Layer, Numerics, Plate, Record, Scene, Shots, Target
from warpimpact.solver import marching, replay
from warpimpact.solver import simulate as simulation
from warpimpact.solver.marching import Marching
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare

from . import references
from .scenes import BASE, PAPER_CORE, STANDOFFS, paper_plate, scattered_hits, shots_at, solid_plate

SAMPLES, COUNT = 12, 4
TARGETS = pytest.mark.parametrize("behind", [(), (BASE,)], ids=["plate", "two layers"])


def bursts_of(offset_y: ArrayLike, offset_z: ArrayLike = 0.0, **arrival: Any) -> Shots:
    """SAMPLES bursts about scattered hits; offsets [m] of shape [n], or [SAMPLES, n]."""
    hit_y, hit_z = (at[:, None] for at in scattered_hits(SAMPLES))
    y, z = np.broadcast_arrays(hit_y + offset_y, hit_z + offset_z)
    return burst(shots_at(y.ravel(), z.ravel(), **arrival), y.shape[1])


def burst(shots: Shots, count: int) -> Shots:
    """The same shots, so many in a row at one plate."""
    number = np.arange(len(shots))
    return replace(shots, sample=number // count, burst_order=number % count)


def apart(shots: Shots) -> Shots:
    """The same shots, each at a plate of its own, in the build of bursts, as a compiler rounds otherwise in another."""
    return burst(shots, 1)


def near_bursts() -> Shots:
    """Bursts whose hits lie a few millimetres apart, with arrivals that differ."""
    rng = np.random.default_rng(2)
    spread = {"velocity": (600.0, 900.0), "yaw": (-5.0, 5.0), "obliquity": (0.0, 20.0), "spin": (0.0, 2e4)}
    arrival = {name: rng.uniform(*ends, SAMPLES * COUNT) for name, ends in spread.items()}
    return bursts_of(*rng.normal(0.0, 2e-3, (2, SAMPLES, COUNT)), **arrival)


def scene_of(plate: Plate, behind: tuple[Layer, ...] = (), **record: Any) -> Scene:
    return Scene(core=PAPER_CORE, target=Target(layers=(plate, *behind)), record=Record(standoffs=STANDOFFS, **record))


def simulate(
    plate: Plate, shots: Shots, behind: tuple[Layer, ...] = (), device: str = "cpu", **numerics: Any
) -> Outcomes:
    numerics = {"level": 0} | numerics
    return simulation.simulate(scene_of(plate, behind), shots, numerics=Numerics(**numerics), device=device)


def assert_identical(got: Outcomes, expected: Outcomes) -> None:
    for name, values in vars(expected).items():
        np.testing.assert_array_equal(getattr(got, name), values, err_msg=name)


@TARGETS
def test_far_apart_shots_have_the_bits_of_first_shots(behind: Any, device: str) -> None:
    shots = bursts_of(0.1 * np.arange(COUNT), yaw=3.0, pitch=2.0, spin=1.7e4)
    got = simulate(paper_plate(), shots, behind, device)
    for order in range(COUNT):
        turned = np.roll(np.arange(len(shots)).reshape(SAMPLES, COUNT), -order, axis=1).ravel()
        first = simulate(paper_plate(), burst(shots[turned], COUNT), behind, device)
        for name, values in vars(got).items():
            np.testing.assert_array_equal(getattr(first, name)[::COUNT], values[order::COUNT], err_msg=name)


@TARGETS
def test_near_shots_notice_each_other_and_the_first_does_not(behind: Any, device: str) -> None:
    shots = near_bursts()
    got, alone = (simulate(paper_plate(), s, behind, device) for s in (shots, apart(shots)))
    faster = (got.residual_velocity - alone.residual_velocity).reshape(SAMPLES, COUNT)
    np.testing.assert_array_equal(faster[:, 0], 0.0)
    assert (faster[:, 1:] > 5.0).mean() > 0.7


def test_what_touches_a_plate_of_no_resistance_once_passes_it_freely(device: str) -> None:
    # β → 0: the second core at the same place meets the channel of the first and loses nothing.
    shots = burst(shots_at(np.zeros(2)), 2)
    got = simulate(solid_plate(degradation=0.0), shots, device=device)
    assert got.residual_velocity[1] == 825.0


@pytest.mark.parametrize(
    ("plate", "behind"),
    [
        ({}, ()),
        ({"degradation": 1.0}, ()),
        ({"thickness": 12e-3, "resistance": 1e9}, ()),
        ({"degradation": 1.0}, (BASE,)),
        ({}, (BASE.model_copy(update={"gap": 0.0}),)),
    ],
    ids=["weakens", "does not weaken", "thick", "two layers", "laminate"],
)
def test_a_core_leaves_its_cross_section_open(plate: dict[str, Any], behind: Any, device: str) -> None:
    shots = burst(shots_at(np.zeros(3)), 3)
    behind = tuple(layer.model_copy(update={"pattern": solid_plate().pattern}) for layer in behind)
    share = []
    for level in (0, 3, 6):
        work = simulate(solid_plate(**plate), shots, behind, device, level=level).energy_loss
        share.append(work[1:] / work[0])
    assert np.max(share) < 0.05
    assert (share[2] < 0.025).all()


def lens(offset: float, radius: float) -> float:
    """Area that two circles of one radius have in common [m²]."""
    half = min(1.0, 0.5 * offset / radius)
    return 2.0 * radius**2 * (acos(half) - half * sqrt(1.0 - half**2))


@pytest.mark.parametrize("obliquity", [0.0, 40.0])
def test_a_core_does_the_work_of_the_material_that_earlier_ones_left(obliquity: float, device: str) -> None:
    # Nothing weakens or rubs: the work is Y times the volume that a core displaces. Of parallel cores that are d apart,
    # across the plane of fire, the second one displaces h / cos θ times πR² less the lens that both have in common.
    radius, thickness, resistance = references.PAPER_LARGEST_RADIUS, 4e-3, 1e8
    lasting = {"degradation": 0.5, "degradation_interval": 1e3, "shear_coefficient": 1e-9}  # in the build of the others
    plate = solid_plate(thickness=thickness, resistance=resistance, **lasting)
    offsets = np.linspace(0.0, 6.0 * radius, 25)
    y, z = np.zeros(50), np.stack([np.zeros(25), offsets], axis=1).ravel()
    shots = burst(shots_at(y, z, velocity=2500.0, obliquity=obliquity), 2)
    area = np.array([pi * radius**2 - lens(offset, radius) for offset in offsets])
    off = []
    for level in (1, 6):
        work = simulate(plate, shots, device=device, level=level).energy_loss.reshape(-1, 2)
        free = work[:, 1] * np.cos(np.deg2rad(obliquity)) / (resistance * thickness * pi * radius**2)
        off.append(np.abs(free - area / (pi * radius**2)).max())
    assert off[0] < 0.03
    assert off[1] < 0.4 * off[0]


def test_a_core_at_rest_leaves_no_channel(device: str) -> None:
    plate = solid_plate(degradation=1.0, resistance=2e10, thickness=8e-3)
    got = simulate(plate, burst(shots_at(np.zeros(2)), 2), device=device)
    assert got.energy_loss[1] == got.energy_loss[0]


@pytest.mark.parametrize("offset", [0.5e-3, 1.37e-3])
def test_the_exposure_of_a_burst_is_the_sum_of_what_its_shots_add(offset: float) -> None:
    # Bilinear reading keeps the sum of a field: what the second window holds is what both shots gave. Both cores sweep
    # a solid plate once, each at its own speed.
    shots = burst(shots_at([0.0, offset], [0.0, 0.6 * offset]), 2)
    prepared = prepare(scene_of(solid_plate()), shots, Numerics(precision="double", patches_axial=23))
    memory = Memory(prepared, wp.get_device("cpu"))
    cells = Marching(memory, 1).cells
    scratch = memory.scratch(1, cells)
    order, outcomes = memory.put(np.arange(2), wp.int32), memory.outcomes()
    memory.launch(order, outcomes, scratch, 1, 0, 2)
    added = scratch.earlier.exposure.numpy().reshape(2, *cells)
    assert (added >= 0.0).all()
    assert scratch.fields.exposure.numpy().sum() == pytest.approx(added.sum(), rel=1e-12)
    assert 0.0 < added[1].sum() < added[0].sum()


@TARGETS
@pytest.mark.parametrize("slots", [1, 5, SAMPLES])
def test_the_order_of_a_device_with_many_slots(behind: Any, slots: int) -> None:
    shots = near_bursts()
    prepared = prepare(scene_of(paper_plate(), behind), shots, Numerics(level=0))
    memory = Memory(prepared, wp.get_device("cpu"))
    cells = Marching(memory, 1).cells
    outcomes = memory.outcomes()
    order = memory.put(marching.in_turns(np.arange(len(shots)), COUNT, slots), wp.int32)
    scratch = memory.scratch(slots, cells)
    for first, number in marching.turns(len(shots), COUNT, slots):
        memory.launch(order, outcomes, scratch, slots, first, number)
    got = Outcomes.collected(prepared.scene, shots, memory.report(outcomes))
    assert_identical(got, simulate(paper_plate(), shots, behind))


def test_every_shot_of_a_failed_burst_behind_the_failure_fails() -> None:
    status = np.array([0, 5, 0, 1, 0, 0, 0, 0], dtype=np.int32)
    np.testing.assert_array_equal(marching.spoilt(status, 4), [0, 5, 5, 5, 0, 0, 0, 0])


@TARGETS
@pytest.mark.parametrize("order", [0, 2])
def test_a_replay_is_the_shot_of_its_burst(behind: Any, order: int) -> None:
    shots, numerics, scene = near_bursts(), Numerics(level=0), scene_of(solid_plate(), behind, bending=not behind)
    at = 5 * COUNT + order
    again = replay.replay(scene, shots[5 * COUNT : at + 1], numerics=numerics)
    for name, values in vars(simulation.simulate(scene, shots, numerics=numerics, device="cpu")).items():
        np.testing.assert_array_equal(getattr(again.outcomes, name)[0], values[at], err_msg=name)
    found = again.plate.share[0]
    assert found.max() == 1.0
    assert (found.min() == 0.0) == (order > 0)  # where an earlier core passed there is nothing
    assert (np.diff(again.plate.share, axis=0) <= 1e-6).all()


def test_the_literal_scheme_takes_no_burst() -> None:
    with pytest.raises(ValueError, match="the nodal scheme does not know earlier hits"):
        simulate(paper_plate(), near_bursts(), level=2, scheme="nodal")


def test_bursts_must_be_whole() -> None:
    with pytest.raises(ValueError, match="whole bursts in order"):
        simulate(paper_plate(), near_bursts()[1:])
