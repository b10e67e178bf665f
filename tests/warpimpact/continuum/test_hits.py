"""Hits by finite elements: what is refused, which are failures, their meshes and their history."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact import (
    CirclePattern,
    FastLaw,
    FiniteElements,
    Layer,
    OgiveCore,
    Plate,
    Record,
    Scene,
    SlotPattern,
    simulate,
)
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum import finite_elements, many_hits, meshing, one_hit
from warpimpact.continuum.front import stopped_energies
from warpimpact.continuum.handover import memory_of
from warpimpact.continuum.meshing import BodyMesh, Encounter, runs_of
from warpimpact.continuum.one_hit import Energies, OneHit, volumes_of
from warpimpact.continuum.replay import replay_continuum
from warpimpact.errors import TooLong
from warpimpact.kernels.status import Status
from warpimpact.scene import ConeCore, NoPattern, PolynomialCore, Shots
from warpimpact.scene.flow import Flow
from warpimpact.solver.device import Worker, find_device

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
PLATE = Plate(thickness=4e-3, resistance=2.6e9)
HOLES = PLATE.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3))})
STEEL, SOFT = flow_entry("ARMOX560T Johnson-Cook").flow, flow_entry("AA6082-T6").flow
SHOT = Shots(*(np.array([value]) for value in (0.0, 0.0, 825.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
COARSE = FiniteElements(flows=(STEEL,), spacing=2e-3)


def solid_of(mesh: BodyMesh) -> NDArray[np.bool_]:
    """Whether a column of a layer has material."""
    return mesh.present[0, :-1, :-1]


@pytest.mark.parametrize(
    ("spacing", "duration"), [(5.0e-5, r"[\d.]+ h"), (1.0e-5, r"\d+ days"), (1.0e-9, r"\S+ years")]
)
def test_a_hit_that_takes_too_long_is_refused_before_it_is_meshed(spacing: float, duration: str) -> None:
    fine = FiniteElements(flows=(STEEL,), spacing=spacing)
    sentence = rf"up to .* elements of .* mm and about {duration} of one CPU core, but at most 2 h are .*\(--element\)$"
    with pytest.raises(TooLong, match=sentence):
        simulate(Scene(core=CORE, target=PLATE), SHOT, method=fine, device="cpu", threads=1)


def test_hits_that_take_too_much_memory_are_refused_with_what_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpimpact.continuum.cost.free_memory", lambda: 2**20)
    with pytest.raises(MemoryError, match=r"mm; 3 hits at a time take .* GiB, but .* GiB are free for it; give larger"):
        COARSE.estimate_cost(Scene(core=CORE, target=PLATE), SHOT).check(threads=3)


@pytest.mark.parametrize(
    ("target", "flow", "velocity"),
    [
        pytest.param(HOLES, STEEL, 825.0, id="cores that pass"),
        pytest.param(HOLES, STEEL, 250.0, id="cores that tumble and stop in holes"),
        pytest.param(PLATE.model_copy(update={"thickness": 15e-3, "resistance": 1e9}), SOFT, 300.0, id="that stop"),
        pytest.param((HOLES, Layer(thickness=6e-3, gap=20e-3, resistance=2.6e9)), STEEL, 700.0, id="between layers"),
    ],
)
def test_elements_and_steps_are_foreseen_within_a_factor_of_two(
    target: Plate | tuple[Plate, Layer], flow: Flow, velocity: float
) -> None:
    """In the mean of three hits, counted on drafts."""
    places = [(1.5e-3, 0.5e-3), (3.0e-3, 2.5e-3), (4.4e-3, 4.0e-3)]
    scene, shot = Scene(core=CORE, target=target), {"velocity": np.array([velocity]), "yaw": np.array([0.02])}
    shots = Shots.joined([SHOT.assign(shot | {"hit_y": np.array([y]), "hit_z": np.array([z])}) for y, z in places])
    method, counted = FiniteElements(flows=(flow,), spacing=1e-3, friction=0.03), list[int]()

    def count(hit: OneHit) -> None:
        awake = zip(hit.meshes, hit.mesh.awake.numpy(), strict=True)
        counted.append(50 * sum(mesh.nodes for mesh, marched in awake if marched))

    for number in range(3):
        method.prepare_hit(scene, shots, number, {}).march(every=50, follow=count)
    assert 0.5 < sum(counted) / 3 / method.estimate_cost(scene, shots).work < 2.0


@pytest.mark.parametrize(
    ("energies", "status"),
    [
        (Energies(lost=100.0, given=99.0, kinetic=1.0, work=93.0, hourglass=5.0), Status.PERFORATED),
        (Energies(lost=100.0, given=99.0, kinetic=1.0, work=90.0, hourglass=5.0), Status.UNBALANCED),
        (Energies(lost=100.0, given=103.0, kinetic=1.0, work=97.0, hourglass=5.0), Status.UNBALANCED),
        (Energies(lost=100.0, given=99.0, kinetic=1.0, work=85.0, hourglass=13.0), Status.HOURGLASSED),
        (Energies(lost=100.0, given=float("nan"), kinetic=1.0, work=85.0, hourglass=13.0), Status.UNBALANCED),
    ],
)
def test_a_hit_that_loses_energy_to_its_numerics_is_a_failure(energies: Energies, status: Status) -> None:
    assert one_hit.status_by_energies(Status.PERFORATED, energies) is status
    assert one_hit.status_by_energies(Status.NOT_FINITE, energies) is Status.NOT_FINITE


def test_a_gpu_computes_the_hits_of_a_scene_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """The CPU stands in for it. The slower hit ends last, and the outcomes have the order of the shots."""
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 1.0)
    gpu = SimpleNamespace(is_cpu=False, alias="cpu")
    monkeypatch.setattr(finite_elements, "find_device", lambda name: gpu if name == "gpu" else find_device(name))
    shots = replace(Shots.joined([SHOT, SHOT]), velocity=np.array([500.0, 825.0]))
    messages: list[tuple[int, int]] = []
    there, here = (
        simulate(
            Scene(core=CORE, target=PLATE),
            shots,
            method=COARSE,
            device=device,
            progress=lambda done, total: messages.append((done, total)),
        )
        for device in ("gpu", "cpu")
    )
    assert messages[:2] == [(1, 2), (2, 2)]
    assert (there.status == Status.PERFORATED).all()
    assert there.residual_velocity == pytest.approx(here.residual_velocity, abs=0.01)
    assert there.residual_velocity[1] > there.residual_velocity[0] + 300.0
    assert there.picture_time == pytest.approx(here.picture_time, rel=1e-3)
    assert (there.picture == here.picture).mean() > 0.99


def test_a_failed_hit_has_no_outcome() -> None:
    """Two elements through the plate: their hourglasses take more than 12 %."""
    messages: list[tuple[int, int]] = []
    outcomes = simulate(
        Scene(core=CORE, target=PLATE, record=Record(standoffs=(0.05,))),
        SHOT,
        method=COARSE,
        progress=lambda done, total: messages.append((done, total)),
    )
    assert outcomes.status[0] == Status.HOURGLASSED
    assert np.isnan(outcomes.residual_velocity[0])
    assert np.isnan(outcomes.tilt).all()
    assert outcomes.hourglass_share[0] > 0.12
    assert messages == [(1, 1)]


def test_a_hit_with_large_hourglasses_is_computed_again_with_less_resistance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the resistance takes less of the energy. The hit then counts, and a replay has its bits."""
    scene, method = Scene(core=CORE, target=PLATE), FiniteElements(flows=(SOFT,), spacing=1e-3)
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 0.5)
    first = simulate(scene, SHOT, method=method, device="cpu")
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 0.9 * first.hourglass_share[0])
    second = simulate(scene, SHOT, method=method, device="cpu")
    assert second.status[0] == first.status[0] == Status.PERFORATED
    assert second.hourglass_share[0] < 0.9 * first.hourglass_share[0]
    again = replay_continuum(scene, SHOT, method, snapshots=0).outcomes
    assert again.residual_velocity[0] == second.residual_velocity[0]


def test_a_method_gives_the_variables_that_it_names() -> None:
    scene, worker = Scene(core=CORE, target=PLATE), Worker("cpu", 1)
    law, elements = (method.prepare(scene, SHOT, worker) for method in (FastLaw(level=0), COARSE))
    own = {name for name, values in vars(elements.compute()).items() if values is not None} - {
        name for name, values in vars(law.compute()).items() if values is not None
    }
    assert law.variables == ()
    assert own == {*elements.variables}


def test_a_march_has_what_belongs_to_its_shot_and_its_layers() -> None:
    """Thickness and offset of the shot, friction and materials of the settings; nothing is computed."""
    holes = PLATE.model_copy(update={"pattern": CirclePattern(diameter=8e-3, spacing=(60e-3, 60e-3))})
    scene = Scene(core=CORE, target=(holes, Layer(thickness=2e-3, gap=10e-3, resistance=1e9)))
    shot = SHOT.assign({"thickness": np.array([3e-3]), "offset_y": np.array([6e-3])})
    continuum = FiniteElements(flows=(STEEL, SOFT), spacing=1e-3, friction=0.07)
    conditions = memory_of(scene, shot, Worker("cpu", 1)).prepared.conditions
    hit = continuum.prepare_hit(scene, shot, 0, conditions)
    assert hit.start.friction == 0.07
    assert hit.flows == [STEEL, SOFT]
    hit.extend()
    first, second = hit.meshes
    assert first.ends == pytest.approx((0.0, 3e-3))
    assert second.ends == pytest.approx((13e-3, 15e-3))
    assert not solid_of(first).all()
    middles = [0.25 * (at[:-1, :-1] + at[1:, :-1] + at[:-1, 1:] + at[1:, 1:]) for at in first.position[1:, 0]]
    hole = ~solid_of(first) & (np.hypot(*middles) < 12e-3)
    along = middles[0][hole]
    assert 0.5 * (along.min() + along.max()) == pytest.approx(6e-3, abs=0.7e-3)  # its pattern moved by 6 mm


def test_a_core_that_reaches_the_edge_of_the_mesh_has_left_it(monkeypatch: pytest.MonkeyPatch, device: str) -> None:
    """It is computed again with wider meshes, and has left the widest one, if that is narrow. One hit is told once."""
    monkeypatch.setattr(meshing, "FINE", 0.5)
    monkeypatch.setattr(meshing, "PATCH", 0.6)
    messages: list[tuple[int, int]] = []
    narrow, scene = FiniteElements(flows=(STEEL,), spacing=1e-3), Scene(core=CORE, target=PLATE)
    again = simulate(scene, SHOT, method=narrow, progress=lambda done, total: messages.append((done, total)))
    assert again.status[0] == Status.PERFORATED
    assert messages == [(1, 1)]
    monkeypatch.setattr(one_hit, "WIDER", (1.0,))
    assert simulate(scene, SHOT, method=narrow).status[0] == Status.LEFT_WINDOW
    conditions = memory_of(scene, SHOT, Worker("cpu", 1)).prepared.conditions
    ((number, together),) = many_hits.together([narrow.prepare_hit(scene, SHOT, 0, conditions, device)])
    assert (number, together.status) == (0, Status.LEFT_WINDOW)


def test_a_mesh_covers_what_a_turned_core_sweeps_and_its_way_through_the_layer() -> None:
    """A core that flies along (1, 0.5, 0) and lies across, with an arm of a, sweeps a − r beyond a radius along z; the
    layer is h thick, so it goes on by 0.5 h along y. Memory is set aside for as many nodes as the mesh has."""
    layer = meshing.Encounter(CORE, PLATE, (0.0, 0.0), 0.1, 1e-3, 1.6)
    state = np.array([0.02, 0.01, 0.0]), np.array([600.0, 300.0, 0.0]), np.array([0.0, 0.0, 1.0])
    along_y, along_z = layer.extents(*state)
    nose, radius, way = CORE.mass_properties.centre_of_mass, CORE.max_radius, 0.25 * PLATE.thickness
    swept = max(nose, CORE.length - nose) - radius
    assert along_y == pytest.approx((0.05 + way, 1.6 * (2.5 * radius + way), 1.6 * (5.0 * radius + way)))
    assert along_z == pytest.approx((0.0, 1.6 * (2.5 * radius + swept), 1.6 * (5.0 * radius + swept)))
    assert layer.nodes(*state) == layer.mesh(*state).nodes


ROUND = CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3))
HOLED, GAP, BASE = Plate(thickness=4e-3, resistance=2.6e9, pattern=ROUND), 20e-3, 2e-3
OFF_CENTRE = Shots(*(np.array([value]) for value in (2e-3, 0.0, 825.0, 0.0, 0.0, 0.0, 0.0, 0.0)))


def test_a_layer_is_at_rest_until_it_has_its_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first picture shows the base as it lies, the last one with what the core has left; the end has the same bits
    as without a history."""
    monkeypatch.setattr(meshing, "PATCH", 3.5)
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 1.0)
    layer = Layer(thickness=BASE, resistance=2.6e9, gap=GAP)
    scene = Scene(core=CORE, target=(HOLED, layer), record=Record(standoffs=(0.05,)))
    continuum = FiniteElements(flows=(flow_entry("ARMOX560T Johnson-Cook").flow,), spacing=1e-3)
    replayed = replay_continuum(scene, OFF_CENTRE, continuum)
    outcomes, deformed = simulate(scene, OFF_CENTRE, method=continuum), replayed.deformed
    assert outcomes.status[0] == Status.PERFORATED
    assert replayed.outcomes.residual_velocity[0] == outcomes.residual_velocity[0]
    assert deformed is not None
    middles = deformed.position[:, deformed.corners].mean(axis=2)
    front = HOLED.thickness + GAP
    of_base = middles[0, :, 0] > front - 1e-3
    assert of_base.any()
    assert deformed.position[0, :, 0].max() == pytest.approx(front + BASE)
    assert deformed.left[0].all()
    assert not deformed.left[-1, of_base].all()
    assert deformed.strain[-1, ~of_base].max() > 0.0
    assert deformed.strain[0, of_base].max() == 0.0
    assert deformed.strain[-1, of_base & deformed.left[-1]].max() > 0.1


SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
OGIVE = OgiveCore(diameter=6e-3, crh=3, length=20e-3, mass=4e-3)
ALONG_X = np.array([1.0, 0.0, 0.0])


def plate_of(pattern: SlotPattern | CirclePattern | NoPattern) -> Plate:
    return Plate(thickness=4e-3, resistance=2.6e9, pattern=pattern)


def mesh_of(pattern: SlotPattern | CirclePattern | NoPattern, hit: tuple[float, float] = (0.0, 0.0)) -> BodyMesh:
    return Encounter(OGIVE, plate_of(pattern), hit, 0.0, 0.5e-3, 1.4).mesh(0.0 * ALONG_X, 800.0 * ALONG_X, ALONG_X)


@pytest.mark.parametrize("pattern", [SLOTS, ROUND])
def test_nodes_at_a_hole_lie_on_its_edge(pattern: SlotPattern | CirclePattern) -> None:
    hit = (1.3e-3, 0.7e-3)
    mesh = mesh_of(pattern, hit)
    around = np.pad(solid_of(mesh), 1, mode="edge").astype(int)
    count = around[:-1, :-1] + around[1:, :-1] + around[:-1, 1:] + around[1:, 1:]
    y, z = mesh.position[1:, 0]
    fine = (np.abs(y) < 7e-3) & (np.abs(z) < 7e-3)
    adjacent = (count > 0) & (count < 4) & fine
    assert adjacent.sum() > 50
    separation = np.abs(plate_of(pattern).edge_distance(y[adjacent] + hit[0], z[adjacent] + hit[1]))
    assert np.quantile(separation, 0.95) < 0.02 * mesh.spacing
    assert separation.max() < mesh.spacing


def test_the_mass_of_the_mesh_is_that_of_the_plate_with_its_holes() -> None:
    mesh = mesh_of(ROUND)
    volume, _ = volumes_of(mesh)
    half = float(mesh.position[1].max())
    whole = (volume.sum() / 4e-3) / (2.0 * half) ** 2
    assert whole == pytest.approx(1.0 - ROUND.open_area, abs=0.05)  # the mesh ends somewhere in a cell
    assert solid_of(mesh_of(NoPattern())).all()


def test_a_mirrored_plate_has_the_mirrored_mesh() -> None:
    mesh = mesh_of(SLOTS)
    y, z = mesh.position[1:, 0]
    assert y == pytest.approx(-y[::-1], abs=1e-12)
    assert z == pytest.approx(-z[:, ::-1], abs=1e-12)
    assert np.array_equal(solid_of(mesh), solid_of(mesh)[::-1, ::-1])


def test_runs_hold_all_elements_in_whole_lanes() -> None:
    present = np.zeros(200, dtype=bool)
    present[[3, 4, 9, 60, 61, 199]] = True
    runs = runs_of(present, 1000)
    inside = np.concatenate([np.arange(*run) for run in runs])
    assert {*(1000 + np.flatnonzero(present))} <= {*inside.tolist()}
    assert len(inside) == len({*inside.tolist()})
    assert (np.diff(runs, axis=1) % 8 == 0).all()
    assert not len(runs_of(np.zeros(5, dtype=bool), 0))


@pytest.mark.parametrize(
    ("depth", "share"),
    [
        (6e-3, (6.0**3 - 2.0**3) / (3.0 * 8.0**2 * 4.0)),
        (10e-3, 0.5 + (8.0**3 - 6.0**3) / (3.0 * 8.0**2 * 4.0)),
        (14e-3, 1.0),
    ],
)
def test_a_core_at_rest_has_worked_as_much_as_it_has_opened(depth: float, share: float) -> None:
    """A cone of 8 mm in a plate of 4 mm: its section grows with the square of the depth; the shank opens no more."""
    scene = Scene(core=ConeCore(diameter=6e-3, length=20e-3, cone_length=8e-3, mass=3e-3), target=PLATE)
    place = np.array([[depth - scene.core.mass_properties.centre_of_mass, 0.0, 0.0]])
    assert stopped_energies(scene, place, np.array([[1.0, 0.0, 0.0]])) == pytest.approx(1.0 - 1.0 / share, rel=2e-3)
