"""A core of elements: its mesh, its motion, its bending, and how it compares with a rigid one (docs/continuum.md)."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact import FiniteElements, Plate, Record, Scene, simulate
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum import bullet_mesh, meshing
from warpimpact.continuum.bullet_mesh import core_mesh, section_of
from warpimpact.continuum.many_hits import ManyHits
from warpimpact.continuum.meshing import BodyMesh, volumes_of
from warpimpact.continuum.one_hit import OneHit
from warpimpact.continuum.replay import replay_continuum
from warpimpact.kernels.continuum import choices
from warpimpact.kernels.status import Status
from warpimpact.scene.flow import Flow
from warpimpact.scene.rigid import axis_of

from .scenes import PAPER_CORE as CORE
from .scenes import SLOTS, shots_at
from .test_continuum import ELASTIC, STEEL, alone, nodal
from .test_continuum_bullet import bullet
from .test_continuum_contact import vectors

Array = NDArray[np.float64]

SCENE = Scene(
    core=CORE, target=Plate(thickness=4e-3, resistance=2.6e9, pattern=SLOTS), record=Record(standoffs=(0.05,))
)
STIFF = Flow(youngs_modulus=2.1e12, yield_stress=1.0e15, fracture_work=1.0e20)
BREAKING = flow_entry("core steel").flow
HARD = BREAKING.model_copy(update={"fracture_stress": None})
COARSE: dict[str, Any] = {"flows": (STEEL,), "spacing": 1e-3}


LONG = pytest.mark.skipif(
    "config.getoption('warp_mode') == 'debug'", reason="thousands of steps, and others read the same arrays"
)


@pytest.fixture(autouse=True)
def _rough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Patches and meshes that are too rough for a result: what these tests show does not depend on it."""
    monkeypatch.setattr(meshing, "FINE", 1.7)
    monkeypatch.setattr(meshing, "PATCH", 4.0)
    monkeypatch.setattr(bullet_mesh, "AROUND", 16)
    monkeypatch.setattr(bullet_mesh, "ALONG", 1.2e-3)
    monkeypatch.setattr(bullet_mesh, "CORE_ACROSS", 6)
    monkeypatch.setattr(bullet_mesh, "CORE_ALONG", 0.25)
    monkeypatch.setattr("warpimpact.continuum.one_hit.LARGEST_HOURGLASS_SHARE", 1.0)


def hit_of(device: str = "cpu", *, shots: Any = None, **settings: Any) -> OneHit:
    """A hit in double precision, of a core in its bullet."""
    method = FiniteElements(**COARSE | {"core": HARD, "bullet": bullet(), "double": True} | settings)
    return method.prepare_hit(SCENE, shots or shots_at(2e-3, obliquity=7.0, yaw=3.0, spin=1.7e4), 0, {}, device)


def masses(hit: OneHit) -> Array:
    """Of all nodes [kg]."""
    inverse = hit.inverse_mass
    return np.divide(1.0, inverse, out=np.zeros(len(inverse)), where=inverse > 0.0)


def momentum(hit: OneHit) -> Array:
    """Of all bodies [N s], and its moment about the origin [N m s], shape [6]."""
    own = masses(hit) * vectors(hit, "velocity")
    return np.concatenate([own.sum(axis=1), np.cross(vectors(hit, "position"), own, axis=0).sum(axis=1)])


def test_the_mesh_of_a_core_has_its_mass_and_nearly_its_moments_of_inertia(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    mesh = core_mesh(CORE, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), 1.0)
    volume, _ = volumes_of(mesh)
    assert (volume[mesh.present.ravel()] > 0.0).all()
    body, mass = CORE.mass_properties, volume * CORE.mass / volume.sum()
    corners = [mesh.position.reshape(3, -1)]
    for offset in (1, mesh.row, mesh.plane):
        corners += [np.roll(one, -offset, axis=1) for one in corners]
    x, y, z = np.mean(corners, axis=0)
    assert float(mass @ x) == pytest.approx(0.0, abs=0.01 * CORE.mass * body.centre_of_mass)
    assert float(mass @ (y**2 + z**2)) == pytest.approx(body.inertia_axial, rel=0.03)
    assert float(mass @ (x**2 + y**2)) == pytest.approx(body.inertia_transverse, rel=0.02)


@LONG
def test_a_free_rod_swings_in_bending_as_timoshenko_says() -> None:
    """The first mode of a free rod of the length l has ω = 22.37 / l² √(E I / ρ A) by Euler and Bernoulli; rotary
    inertia and shear lower it by some 1.5 % at ten diameters. Its middle stands still after a quarter of a period."""
    length, radius, section = 40e-3, 2e-3, section_of(8)
    along = np.linspace(0.0, length, 41)[:, None, None]
    present = np.ones((41, 9, 9), dtype=bool)
    present[-1], present[:, -1], present[:, :, -1] = False, False, False
    position = np.stack(np.broadcast_arrays(along, radius * section[0], radius * section[1]))
    hit = alone(BodyMesh(position, present, 0.5e-3), ELASTIC, free=True)
    number, share = 4.73004 / length, 0.982502
    x = number * nodal(hit, "position")[0]
    nodal(hit, "velocity")[1] = np.cosh(x) + np.cos(x) - share * (np.sinh(x) + np.sin(x))
    middle, times, speeds = 20 * 81 + 40, list[float](), list[float]()
    while not speeds or speeds[-1] < 0.0:
        hit.advance(1)
        times.append(float(hit.flight["time"]) - 0.5 * float(hit.flight["before"]))
        speeds.append(float(nodal(hit, "velocity")[1, middle]))
    quarter = float(np.interp(0.0, speeds[-2:], times[-2:]))
    slender = number**2 * 0.5 * radius * math.sqrt(ELASTIC.youngs_modulus / ELASTIC.density)
    assert 0.5 * math.pi / quarter == pytest.approx(0.985 * slender, rel=0.02)


def test_a_core_that_flies_freely_turns_as_a_rigid_one() -> None:
    """Its state is that of its nodes: a turn about an axis across at ω, and one about its own."""
    hit = hit_of(bullet=None, core=STIFF, shots=shots_at())
    own = slice(hit.firsts[0], hit.firsts[0] + hit.meshes[0].nodes)
    velocity, omega = np.array([-50.0, 20.0, 10.0]), np.array([2.0e4, 0.0, 5.0e3])
    mass, place = masses(hit)[own], vectors(hit, "position")[:, own]
    centre = place @ mass / mass.sum()
    moving = velocity[:, None] + np.cross(omega, place - centre[:, None], axis=0)
    hit.mesh.velocity.numpy().reshape(3, -1)[:, own] = moving
    hit.advance(400)
    time, state, body = float(hit.flight["time"]), hit.flight["state"], hit.start.body
    assert np.array(state["velocity"]) == pytest.approx(velocity, abs=0.01)
    assert np.array(state["position"]) == pytest.approx(centre + time * velocity, abs=2e-7)
    spinning = omega * [body.inertia_axial, body.inertia_transverse, body.inertia_transverse]
    assert np.array(state["angular_momentum"]) == pytest.approx(spinning, abs=0.03 * spinning.max())
    axis = Rotation.from_rotvec(time * spinning / body.inertia_transverse).apply([1.0, 0.0, 0.0])
    assert axis_of(state["attitude"]) == pytest.approx(axis, abs=0.02 * omega[2] * time)


@LONG
@pytest.mark.parametrize("place", [1.0e-3, 2.0e-3], ids=["in a hole", "at an edge"])
def test_a_stiff_core_leaves_as_a_rigid_one(place: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """With ten times the modulus of steel: a tenth of what steel bends is left, some 1.5° at the edge. On finer meshes
    the velocities differ by 2.4 m/s at most. The plate has the same resistance against hourglasses."""
    monkeypatch.setattr(choices, "DEFORMING_HOURGLASS", choices.DEFORMING_HOURGLASS._replace(value=1.0))
    rigid, stiff = (simulate(SCENE, shots_at(place), method=FiniteElements(**COARSE, core=of)) for of in (None, STIFF))
    assert rigid.status[0] == stiff.status[0] == Status.PERFORATED
    assert stiff.residual_velocity == pytest.approx(rigid.residual_velocity, abs=4.0)
    assert np.degrees(stiff.tilt) == pytest.approx(np.degrees(rigid.tilt), abs=2.5)


def test_all_momentum_stays_where_the_plate_floats() -> None:
    """To 1e-9 of the bullet's, and energy within a per cent, while jacket and core enter."""
    hit = hit_of(friction=0.1)
    hit.mesh.impedance.zero_()
    before = momentum(hit)
    hit.advance(900)
    assert hit.mesh.touched.numpy()[2] > 0.0  # the core touches the plate
    assert momentum(hit)[:3] == pytest.approx(before[:3], abs=1e-9 * before[0])
    assert momentum(hit)[3:] == pytest.approx(before[3:], abs=3e-5)
    energies = hit.energies
    assert min(energies.lost, energies.taken) > 1.0
    assert energies.imbalance < 0.01


def test_a_core_has_the_same_bits_alone_and_in_company(device: str) -> None:
    """And the numbers of the march of one hit, to the rounding of other sums."""
    one, alone_, other = hit_of(), hit_of(device), hit_of(device)
    rough = hit_of(device, friction=0.2, core=None)
    one.advance(60)
    ManyHits([alone_]).advance(60)
    ManyHits([rough, other]).advance(60)
    assert alone_.flight == other.flight
    assert np.array(alone_.flight["state"]["position"]) == pytest.approx(one.flight["state"]["position"], abs=1e-12)
    assert vectors(alone_, "position") == pytest.approx(vectors(one, "position"), abs=1e-12)
    for name in ("position", "stress", "alive", "work"):
        assert np.array_equal(getattr(alone_.mesh, name).numpy(), getattr(other.mesh, name).numpy()), name


@LONG
def test_a_core_that_yields_goes_straight_through_the_middle_of_a_web() -> None:
    """And slower than a core that does not yield by what it takes itself; energy is kept."""
    shots, steel = shots_at(4e-3, 4e-3), Flow(yield_stress=1.0e15, fracture_work=1.0e20)
    elastic, yielding = (simulate(SCENE, shots, method=FiniteElements(**COARSE, core=of)) for of in (steel, HARD))
    assert yielding.status[0] == elastic.status[0] == Status.PERFORATED
    assert max(yielding.energy_imbalance[0], elastic.energy_imbalance[0]) < 0.01
    assert np.degrees([yielding.tilt, elastic.tilt]).max() < 4.0
    assert yielding.residual_velocity != pytest.approx(elastic.residual_velocity, abs=0.5)
    replayed = replay_continuum(SCENE, shots, FiniteElements(**COARSE, core=HARD))
    assert replayed.outcomes.residual_velocity[0] == yielding.residual_velocity[0]


@LONG
def test_a_core_breaks_at_an_edge_and_stays_whole_in_a_hole() -> None:
    """Its parts have its mass, and energy is kept. A core as strong as it is drawn, shot by shot."""
    places = shots_at((0.0, 2e-3, 2e-3))
    shots = replace(places, strength=np.array([2.5e9, 2.5e9, 1.0e14]))
    outcomes = simulate(SCENE, shots, method=FiniteElements(**COARSE, core=BREAKING))
    assert (outcomes.status == Status.PERFORATED).all()
    assert outcomes.broken.tolist() == [0.0, 1.0, 0.0]
    assert outcomes.fragments[0] == outcomes.fragments[2] == 1.0
    assert outcomes.fragments[1] >= 2.0
    assert outcomes.eroded_mass[0] == pytest.approx(0.0, abs=1e-12)
    assert outcomes.fragment_mass[0] == pytest.approx(CORE.mass)
    assert 0.1 * CORE.mass < outcomes.fragment_mass[1] < 0.9 * CORE.mass - outcomes.eroded_mass[1]
    assert 0.2 * CORE.length < outcomes.broken_section[1] < 0.8 * CORE.length
    assert outcomes.fragment_energy[1] > 0.5 * outcomes.fragment_mass[1] * outcomes.residual_velocity[1] ** 2
    assert outcomes.energy_imbalance.max() < 0.01


@LONG
def test_the_state_of_a_broken_core_is_that_of_its_leading_fragment() -> None:
    hit = hit_of(bullet=None, core=BREAKING.model_copy(update={"fracture_stress": 2.5e9}), shots=shots_at(2e-3))
    hit.mesh.impedance.zero_()
    before, result = momentum(hit), hit.march()
    assert result.fragments is not None
    assert result.fragments.broken
    assert momentum(hit)[:3] == pytest.approx(before[:3], abs=1e-9 * before[0])
    elements, own = hit.mesh.leading.numpy() * hit.mesh.alive.numpy() > 0.0, hit.meshes[0]
    corners = np.array([x * own.plane + y * own.row + z for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    nodes = np.unique(np.flatnonzero(elements[: hit.firsts[1]])[:, None] + corners)
    mass = masses(hit)[nodes]
    assert np.array(result.flight["state"]["velocity"]) == pytest.approx(
        vectors(hit, "velocity")[:, nodes] @ mass / mass.sum(), abs=0.5
    )


def test_bending_of_a_core_of_elements_is_refused() -> None:
    scene = SCENE.model_copy(update={"record": Record(standoffs=(0.05,), bending=True)})
    with pytest.raises(ValueError, match=r'output.bending needs a rigid core; give continuum.core = "rigid"'):
        simulate(scene, shots_at(), method=FiniteElements(**COARSE, core=HARD))
