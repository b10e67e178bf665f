"""The march: how a shot starts and ends, and that its window does not change its outcome (docs/model.md §1)."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels.status import Status
from warpimpact.scene import (
    CirclePattern,
    Core,
    Impact,
    Numerics,
    Plate,
    Record,
    Scene,
    Shots,
)
from warpimpact.solver import replay, resolution, simulate

from .probes import CONE, OGIVE, PAPER

Array = NDArray[np.float64]

SOLID = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, degradation_interval=1e-6)
SMALL = SOLID.model_copy(update={"size": (10e-3, 10e-3)})
HARD = SOLID.model_copy(update={"resistance": 1e11})
HOLES = SOLID.model_copy(update={"pattern": CirclePattern(diameter=12e-3, spacing=(20e-3, 20e-3))})
WEIGHTLESS = Plate(thickness=4e-3, resistance=0.0, shear_coefficient=0.05, degradation=0.8)
DRAFT = Numerics(level=0)


def at(plate: Plate) -> Scene:
    """The paper's core shot at a plate, seen 50 mm behind it."""
    return Scene(core=PAPER, target=plate, record=Record(standoffs=(0.05,)))


def shots_of(**columns: Any) -> Shots:
    """Shots of 825 m/s at the origin, except for the given columns."""
    values = dict.fromkeys(("hit_y", "hit_z", *Impact.model_fields), 0.0) | {"velocity": 825.0} | columns
    arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(value, dtype=float)) for value in values.values()))
    return Shots(**dict(zip(values, (array.copy() for array in arrays), strict=True)))


def slanted_shots(count: int = 40) -> Shots:
    """Random shots; no axis is nearly parallel to the plate."""
    rng = np.random.default_rng(1)
    return shots_of(
        hit_y=rng.uniform(-5e-3, 5e-3, count),
        hit_z=rng.uniform(-5e-3, 5e-3, count),
        velocity=rng.uniform(300.0, 900.0, count),
        obliquity=rng.uniform(0.0, 0.7, count),
        azimuth=rng.uniform(-np.pi, np.pi, count),
        pitch=rng.uniform(-0.5, 0.5, count),
        yaw=rng.uniform(-0.5, 0.5, count),
        spin=rng.uniform(-2e4, 2e4, count),
    )


def launched(core: Core, shots: Shots) -> dict[str, Array]:
    """How shots start: first rows of their traces through a plate without resistance, drifted back."""
    numerics = Numerics(level=0, precision="double", time_step=1e-6)
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
    straight, slanted = launched(core, shots_of()), launched(core, slanted_shots())
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
        (SOLID, {"velocity": 300.0, "obliquity": 1.4}, Status.RICOCHETED),
        (HOLES, {}, Status.UNTOUCHED),
        (HOLES, {"hit_y": 40e-3, "hit_z": -60e-3}, Status.UNTOUCHED),
        (HOLES, {"hit_y": 10e-3}, Status.PERFORATED),
        (SOLID.model_copy(update={"size": (10e-3, 30e-3)}), {"hit_y": 9e-3}, Status.UNTOUCHED),
        (SOLID.model_copy(update={"size": (10e-3, 30e-3)}), {"hit_z": 9e-3}, Status.PERFORATED),
        (SMALL, {"hit_y": -7.5e-3}, Status.PERFORATED),  # 2.5 mm beside the plate, the core 3 mm
        (SMALL, {"hit_z": 9e-3, "obliquity": 0.25 * np.pi, "azimuth": -0.5 * np.pi}, Status.PERFORATED),
    ],
)
def test_status_tells_how_the_shot_ended(plate: Plate, shot: dict[str, float], status: Status, device: str) -> None:
    outcomes = simulate.simulate(at(plate), shots_of(**shot), numerics=DRAFT, device=device)
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
    outcomes = simulate.simulate(at(SOLID), shots_of(), numerics=DRAFT, device=device)
    assert Status(outcomes.status[0]) is Status.UNFINISHED
    assert np.isnan(outcomes.residual_velocity[0])
