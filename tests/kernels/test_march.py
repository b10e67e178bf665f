"""The march: how a shot starts, when it ends, and windows that follow a core (docs/model.md §1, 8)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import march as march_code
from warpimpact.kernels.status import RUNNING, Status
from warpimpact.kernels.variant import Variant
from warpimpact.scene import CirclePattern, Core, Hits, Impact, Plate, Record, Scene, Shots, Target, make_shots
from warpimpact.solver import grid, replay, resolution
from warpimpact.solver import prepare as preparation
from warpimpact.solver.device import find_device
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.marching import march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import simulate

from ..verification.scenes import PAPER_CORE, layer, paper_plate, shots_at
from .probes import CONE, OGIVE, PAPER

Array = NDArray[np.float64]

SOLID = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, degradation_interval=1e-6)
SMALL = SOLID.model_copy(update={"size": (10e-3, 10e-3)})
HARD = SOLID.model_copy(update={"resistance": 1e11})
HOLES = SOLID.model_copy(update={"pattern": CirclePattern(diameter=12e-3, spacing=(20e-3, 20e-3))})
WEIGHTLESS = Plate(thickness=4e-3, resistance=0.0, shear_coefficient=0.05, degradation=0.8)
DRAFT = FastLaw(level=0)


def at(plate: Plate) -> Scene:
    """The paper's core shot at a plate, seen 50 mm behind it."""
    return Scene(core=PAPER, target=plate, record=Record(standoffs=(0.05,)))


def slanted_shots(count: int = 40) -> Shots:
    """Random shots; no axis is nearly parallel to the plate."""
    rng = np.random.default_rng(1)
    return shots_at(
        *rng.uniform(-5e-3, 5e-3, (2, count)),
        velocity=rng.uniform(300.0, 900.0, count),
        obliquity=rng.uniform(0.0, 40.0, count),
        azimuth=rng.uniform(-180.0, 180.0, count),
        pitch=rng.uniform(-28.0, 28.0, count),
        yaw=rng.uniform(-28.0, 28.0, count),
        spin=rng.uniform(-2e4, 2e4, count),
    )


def launched(core: Core, shots: Shots) -> dict[str, Array]:
    """How shots start: first rows of their traces through a plate without resistance, drifted back."""
    numerics = FastLaw(level=0, precision="double", time_step=1e-6)
    memory, _, contact = replay.traced(Scene(core=core, target=WEIGHTLESS), shots, numerics)
    first = np.array([history[0] for history in replay.traces_of(memory, contact)])
    assert (first[:, 0] == 0.5e-6).all()
    return {
        "position": first[:, 1:4] - 0.5e-6 * first[:, 8:11],
        "axis": Rotation.from_quat(first[:, 4:8]).apply([1.0, 0.0, 0.0]),
        "velocity": first[:, 8:11],
        "angular_momentum": first[:, 11:14],
    }


def line_of_flight(shots: Shots) -> Array:
    sine = np.sin(shots.obliquity)
    return np.stack([np.cos(shots.obliquity), sine * np.cos(shots.azimuth), sine * np.sin(shots.azimuth)], axis=1)


def test_shot_starts_along_its_line_of_flight_through_the_hit() -> None:
    shots = slanted_shots()
    start, flight = launched(PAPER, shots), line_of_flight(shots)
    np.testing.assert_allclose(start["velocity"], shots.velocity[:, None] * flight, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(np.cross(start["position"], flight), 0.0, atol=1e-15)
    assert (start["position"][:, 0] < 0).all()


@pytest.mark.parametrize("core", [PAPER, OGIVE, CONE], ids=["paper", "ogive", "cone"])
def test_shot_starts_with_its_foremost_point_at_the_front_face(core: Core) -> None:
    straight, slanted = launched(core, shots_at()), launched(core, slanted_shots())
    nose = core.mass_properties.centre_of_mass
    np.testing.assert_allclose(straight["position"], [[-nose, 0.0, 0.0]], atol=1e-15)
    # Farthest point along x of the circles r(s) about a slanted axis.
    s = np.linspace(0.0, core.length, 4001)
    along = slanted["axis"][:, :1]
    ahead = ((nose - s) * along + core.radius(s) * np.sqrt(1 - along**2)).max(axis=1)
    gap = -(slanted["position"][:, 0] + ahead)
    assert (gap >= -1e-12).all()
    assert (gap < 0.6 * core.length / 16).all()  # half a ring too early at most, and rings differ in length


@pytest.mark.parametrize(
    ("plate", "shot", "status"),
    [
        (SOLID, {}, Status.PERFORATED),
        (HARD, {}, Status.ARRESTED),
        (SOLID, {"velocity": 300.0, "obliquity": 80.0}, Status.RICOCHETED),
        (HOLES, {}, Status.UNTOUCHED),
        (HOLES, {"hit_y": 40e-3, "hit_z": -60e-3}, Status.UNTOUCHED),
        (HOLES, {"hit_y": 10e-3}, Status.PERFORATED),
        (SOLID.model_copy(update={"size": (10e-3, 30e-3)}), {"hit_y": 9e-3}, Status.UNTOUCHED),
        (SOLID.model_copy(update={"size": (10e-3, 30e-3)}), {"hit_z": 9e-3}, Status.PERFORATED),
        (SMALL, {"hit_y": -7.5e-3}, Status.PERFORATED),  # 2.5 mm beside the plate, the core 3 mm
        (SMALL, {"hit_z": 9e-3, "obliquity": 45.0, "azimuth": -90.0}, Status.PERFORATED),
    ],
)
def test_status_tells_how_the_shot_ended(plate: Plate, shot: dict[str, float], status: Status, device: str) -> None:
    outcomes = simulate(at(plate), shots_at(**shot), method=DRAFT, device=device)
    assert Status(outcomes.status[0]) is status
    speed, initial = outcomes.residual_velocity[0], shot.get("velocity", 825.0)
    for name in ("tilt", "pitch", "yaw", "total_yaw"):
        seen = np.isfinite(getattr(outcomes, name)).all()
        assert seen == (status in (Status.PERFORATED, Status.UNTOUCHED)), name
    assert np.isfinite(outcomes.deflection[0]) == (status != Status.ARRESTED)
    if status is Status.UNTOUCHED:
        assert speed == pytest.approx(initial, rel=1e-6)
        assert outcomes.contact_duration[0] == 0.0
        assert outcomes.tilt[0, 0] == pytest.approx(0.0, abs=1e-5)
    elif status is Status.ARRESTED:
        assert speed == 0.0
    else:
        assert 0.0 < speed < initial
        assert outcomes.contact_duration[0] > 0.0


def test_shot_without_an_end_is_given_up(monkeypatch: pytest.MonkeyPatch, device: str) -> None:
    monkeypatch.setattr(resolution, "STEP_ALLOWANCE", 0.1)
    outcomes = simulate(at(SOLID), shots_at(), method=DRAFT, device=device)
    assert Status(outcomes.status[0]) is Status.UNFINISHED
    assert np.isnan(outcomes.residual_velocity[0])


VARIANT = Variant(double=True)
built = march_code.build(VARIANT)
Context, Reach, State, Pose, status_of = built.Context, built.Reach, built.State, built.Pose, built.status_of


def judge(
    context: Context,
    reach: Reach,
    across: wp.float64,
    along: wp.float64,
    touched: wp.bool,
    status: wp.array(dtype=wp.int32),
) -> None:
    """Status of a core of 2 kg inside the target, which goes back across the layers."""
    state, pose = State(), Pose()
    state.attitude = wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    state.velocity = wp.vec3d(-wp.sqrt(across), wp.sqrt(along), wp.float64(0.0))
    pose.axis = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
    status[0] = status_of(context, reach, state, pose, touched)


JUDGE = VARIANT.kernel(judge)
BEHIND = {"behind": True}
FREE = {"behind": True, "last_ring": -1, "along": 0.5}


@pytest.mark.parametrize(
    ("least", "case", "below", "above"),
    [
        pytest.param(0.01**2, {}, Status.ARRESTED, RUNNING, id="at rest: 1 % of the impact velocity"),
        pytest.param(0.05**2, BEHIND, Status.ARRESTED, RUNNING, id="turned back behind the plate: 5 %"),
        pytest.param(0.15**2, FREE, Status.ARRESTED, RUNNING, id="between layers: 15 % across them"),
        pytest.param(
            0.1 * 0.05, FREE | {"barrier": 0.05}, Status.ARRESTED, RUNNING, id="a tenth of the work of the layers"
        ),
        pytest.param(1.01, {"touched": False}, RUNNING, Status.GAINED_ENERGY, id="1 % more than at impact"),
    ],
)
def test_a_shot_ends_at_a_share_of_the_impact_energy(
    least: float, case: Mapping[str, float], below: int, above: int, device: str
) -> None:
    context, reach = Context(), Reach()
    context.impact_energy, context.depth = 1.0, 1.0
    context.body.mass, context.body.inertia_axial, context.body.inertia_transverse = 2.0, 1.0, 1.0
    reach.footprint.inside, reach.footprint.last_ring = True, case.get("last_ring", 0)
    reach.behind, reach.barrier = case.get("behind", False), case.get("barrier", 1e3)
    for share, expected in ((0.999, below), (1.001, above)):
        status = wp.empty(1, dtype=wp.int32, device=device)
        inputs = [context, reach, share * least, case.get("along", 0.0), case.get("touched", True)]
        wp.launch(JUDGE, 1, inputs=inputs, outputs=[status], device=device)
        assert status.numpy()[0] == expected


HITS = 16
PLATE = paper_plate(degradation_interval=None, degradation_distance=0.8e-3)
SOFT = Plate(thickness=25e-3, resistance=0.4e9, degradation=0.9, degradation_distance=0.8e-3)


class Marched(NamedTuple):
    outcomes: dict[str, Any]
    first: int
    last: int


def marched(target: tuple[Plate, ...], impact: dict[str, float], device: str, *, slide: bool) -> Marched:
    scene = Scene(core=PAPER_CORE, target=Target(layers=target))
    shots = make_shots(Impact(velocity=825.0, **impact), Hits(count=HITS, seed=2), target[0])
    prepared = replace(prepare(scene, shots, FastLaw(level=0)), slide=slide)
    memory = Memory(prepared, find_device(device))
    _, last, outcomes = march(memory)
    names = ("status", "steps", "velocity", "position", "axis", "angular_momentum", "energy_loss")
    return Marched({name: getattr(outcomes, name).numpy() for name in names}, prepared.cells, last)


@pytest.mark.parametrize(
    ("target", "impact"),
    [
        ((PLATE, layer(SOFT, gap=0.05)), {"obliquity": 45.0, "azimuth": 250.0}),  # cores turn in the layer behind
        ((PLATE, layer(SOFT, gap=0.02)), {"obliquity": 60.0, "azimuth": 250.0}),  # and go far aside
    ],
)
def test_a_window_that_follows_the_core_has_the_bits_of_a_wide_one(
    target: tuple[Plate, ...], impact: dict[str, float], device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grid, "SLACK", 0.2)  # narrow, so that they have to slide often
    monkeypatch.setattr(preparation, "WIDER_BEHIND", 0.1)
    wide, follows = (marched(target, impact, device, slide=slide) for slide in (False, True))
    for name, values in wide.outcomes.items():
        np.testing.assert_array_equal(follows.outcomes[name], values, err_msg=name)
    assert follows.first == wide.first
    assert follows.last < wide.last
