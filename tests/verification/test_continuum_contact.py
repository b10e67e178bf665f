"""Contact between bodies of the continuum: bars that meet, friction, and layers that touch (docs/continuum.md)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact import FiniteElements, Layer, Plate, Record, Scene, simulate
from warpimpact.continuum import meshing
from warpimpact.continuum.meshing import BodyMesh
from warpimpact.continuum.one_hit import OneHit
from warpimpact.kernels.status import Status
from warpimpact.scene import Target

from .scenes import PAPER_CORE as CORE
from .scenes import shots_at
from .test_continuum import ELASTIC, STEEL, box, start_at

Array = NDArray[np.float64]

SPACING, SPEED = 1.0e-3, 20.0


def moved(mesh: BodyMesh, by: tuple[float, float, float]) -> BodyMesh:
    """A mesh somewhere else [m]."""
    return replace(mesh, position=mesh.position + np.array(by)[:, None, None, None])


def meeting(first: BodyMesh, second: BodyMesh, velocity: Array, friction: float = 0.0) -> OneHit:
    """Two elastic bodies that float, of which the first one flies, in double precision; the core is far away."""
    start = start_at((0.0, -1.0, 0.0), 800.0)
    hit = OneHit(CORE, start, [first, second], [ELASTIC, ELASTIC], double=True, contact_friction=friction)
    hit.mesh.impedance.zero_()
    vectors(hit, "velocity")[:, body(hit, 0)] = velocity[:, None]
    return hit


def body(hit: OneHit, number: int) -> slice:
    """Nodes of a body."""
    return slice(hit.firsts[number], hit.firsts[number] + hit.meshes[number].nodes)


def vectors(hit: OneHit, name: str) -> Array:
    """Vectors of all nodes, a view, shape [3, nodes]."""
    return np.asarray(getattr(hit.mesh, name).numpy().reshape(3, -1))


def momentum(hit: OneHit, number: int) -> Array:
    """Of a body [N s], and its moment about the origin [N m s], shape [6]."""
    nodes = body(hit, number)
    masses = np.divide(1.0, hit.inverse_mass, out=np.zeros(hit.inverse_mass.shape), where=hit.inverse_mass > 0.0)[nodes]
    own = masses * vectors(hit, "velocity")[:, nodes]
    return np.concatenate([own.sum(axis=1), np.cross(vectors(hit, "position")[:, nodes], own, axis=0).sum(axis=1)])


def test_a_hit_fails_where_contact_has_no_room_for_a_face() -> None:
    """All 648 faces of a bar in one cell are more than it holds; a contact without some of them would be wrong."""
    bar = box((80, 2, 2))
    usual, crowded = (meeting(bar, moved(bar, (80 * SPACING, 0.0, 0.0)), np.array([SPEED, 0.0, 0.0])) for _ in range(2))
    crowded.mesh.contacts.cell = 1.0
    for hit in (usual, crowded):
        hit.advance(1)
    assert usual.mesh.contacts.crowded.numpy()[0] == 0
    assert crowded.result(at_edge=False).status == Status.CROWDED


@pytest.mark.parametrize("aside", [0.0, 0.3e-3], ids=["nodes on nodes", "nodes on faces"])
def test_bars_that_meet_exchange_their_velocities(aside: float) -> None:
    """Free elastic bars of the length L touch for 2 L / √(E/ρ); the first one then rests. In the mesh of a bar of two
    elements' width, waves disperse, and contact damps, so the exchange is no better than some per cent."""
    count = 20
    bar = box((count, 2, 2))
    hit = meeting(bar, moved(bar, (count * SPACING, aside, 0.0)), np.array([SPEED, 0.0, 0.0]))
    before, energy = momentum(hit, 0) + momentum(hit, 1), hit.energies.kinetic
    touched = list[float]()
    for _ in range(140):
        hit.advance(1)
        if hit.mesh.contacts.pushing.numpy()[0]:
            touched.append(float(hit.flight["time"]))
    first, second = momentum(hit, 0)[0], momentum(hit, 1)[0]
    assert first == pytest.approx(0.0, abs=0.05 * before[0])
    assert second == pytest.approx(before[0], rel=0.05)
    duration = 2.0 * count * SPACING / math.sqrt(ELASTIC.youngs_modulus / ELASTIC.density)
    assert touched[-1] - touched[0] == pytest.approx(duration, rel=0.1)
    assert (momentum(hit, 0) + momentum(hit, 1))[:3] == pytest.approx(before[:3], abs=1e-12 * before[0])
    ended = hit.energies
    assert ended.kinetic + ended.work + ended.hourglass - energy == pytest.approx(ended.given, abs=2e-3 * energy)
    assert -0.05 * energy < ended.given < 0.0  # a contact takes energy


def test_friction_is_a_share_of_the_impulse_of_the_contact() -> None:
    """A block that comes down askew on a larger one. All momentum stays, and its moment, as a node and the face behind
    which it lies are a depth apart at most."""
    turn = Rotation.from_euler("xyz", [20.0, 30.0, 40.0], degrees=True).as_matrix()
    small, large = moved(box((4, 4, 4)), (-4.2e-3, 2.2e-3, 2.3e-3)), box((4, 8, 8))
    blocks = [replace(mesh, position=np.einsum("ij,jabc->iabc", turn, mesh.position)) for mesh in (small, large)]
    impulses = []
    for friction in (0.0, 0.2):
        hit = meeting(*blocks, turn @ np.array([40.0, 60.0, 0.0]), friction)
        before = momentum(hit, 0) + momentum(hit, 1)
        hit.advance(120)
        assert momentum(hit, 0) + momentum(hit, 1) == pytest.approx(before, abs=1e-6 * np.abs(before).max())
        assert (momentum(hit, 0) + momentum(hit, 1))[:3] == pytest.approx(before[:3], abs=1e-12 * before[:3].max())
        impulses.append(turn.T @ momentum(hit, 1)[:3])
    smooth, rough = impulses
    assert smooth[0] > 0.0
    assert smooth[1:] == pytest.approx([0.0, 0.0], abs=0.02 * smooth[0])
    assert rough[1] == pytest.approx(0.2 * rough[0], rel=0.05)


def test_a_plate_of_two_layers_resists_between_one_and_two_with_a_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Layers that touch bend each by itself, but the front one is held by the rear one. Energy stays, and a symmetric
    hit leaves straight."""
    monkeypatch.setattr(meshing, "FINE", 1.7)
    monkeypatch.setattr(meshing, "PATCH", 4.0)
    plate, method = Plate(thickness=4e-3, resistance=2.6e9), FiniteElements(flows=(STEEL,), spacing=0.8e-3)
    second = Layer(thickness=4e-3, gap=0.0, resistance=2.6e9)
    speeds = []
    for target in (
        plate.model_copy(update={"thickness": 8e-3}),
        Target(layers=(plate, second)),
        Target(layers=(plate, second.model_copy(update={"gap": 10e-3}))),
    ):
        scene = Scene(core=CORE, target=target, record=Record(standoffs=(0.05,)))
        outcomes = simulate(scene, shots_at(), method=method, device="cpu")
        assert outcomes.status[0] == Status.PERFORATED
        assert outcomes.energy_imbalance[0] < 0.02
        assert np.degrees(outcomes.tilt).max() < 1.0
        speeds.append(float(outcomes.residual_velocity[0]))
    assert speeds[0] + 1.0 < speeds[1] < speeds[2] - 5.0
