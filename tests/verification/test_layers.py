"""Targets of several layers, edges and wide holes: closed forms, and targets that say the same thing in two ways
(docs/model.md §4, 5, 6.10).
"""

from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import CirclePattern, ConeCore, Layer, Plate, Target
from warpimpact.solver import marching, resolution

from . import references
from .scenes import PAPER_CORE, layer, paper_plate, scattered_hits, shots_at, simulate, solid_plate

RADIUS = references.PAPER_LARGEST_RADIUS
Y, Z = scattered_hits(24)
TURNED = {"obliquity": 15.0, "azimuth": 40.0, "pitch": 4.0, "yaw": -6.0}
SMOOTH = 1e-9
"""No friction to speak of, in the build of the kernels that has it."""
MISSES = {"pattern": CirclePattern(diameter=0.4, spacing=(1.0, 1.0)), "degradation_length": 5e-3}
"""A layer through whose hole all cores of these tests pass."""


def layered(plate: Plate, *layers: Layer, **shots: Any) -> Outcomes:
    """Outcomes of a target."""
    return simulate(Target(layers=(plate, *layers)), **shots)


def assert_alike(got: Outcomes, expected: Outcomes, velocity: float, angle: float) -> None:
    """Both end alike, to so many m/s and degrees."""
    assert (got.status == expected.status).all()
    assert got.residual_velocity == pytest.approx(expected.residual_velocity, abs=velocity)
    assert np.degrees(got.tilt) == pytest.approx(np.degrees(expected.tilt), abs=angle, nan_ok=True)
    assert np.degrees(got.deflection) == pytest.approx(np.degrees(expected.deflection), abs=angle, nan_ok=True)


# A patch on a seam counts by its share in either layer, so a laminate is exact at any resolution. Measured: 5e-4 m/s.
def test_parts_without_a_gap_are_the_whole(device: str) -> None:
    whole = solid_plate(thickness=6e-3, degradation=1.0, shear_coefficient=0.12)
    shots = shots_at(Y, Z, **TURNED)
    parts = [layer(whole, thickness=share * whole.thickness) for share in (0.2, 0.5, 0.3)]
    scene: dict[str, Any] = {"shots": shots, "device": device, "time_step": 1e-6}
    expected = simulate(whole, **scene)
    front = whole.model_copy(update={"thickness": parts[0].thickness})
    assert_alike(layered(front, *parts[1:], **scene), expected, velocity=2e-3, angle=2e-3)


# The core, 27.9 mm long, touches both layers at once in all but the last of these.
@pytest.mark.parametrize("gap", [0.0, 15e-3, 0.2])
def test_work_of_a_normal_hit_is_that_of_all_layers(gap: float, device: str) -> None:
    # m (v0² − v²)/2 = Σ Y h πR² without friction, whatever the gaps.
    front = solid_plate(thickness=2e-3, resistance=2e9, shear_coefficient=SMOOTH, degradation=1.0)
    behind = [layer(front, thickness=3e-3, resistance=3e9, gap=gap), layer(front, thickness=1e-3, gap=gap)]
    work = pi * RADIUS**2 * (2e-3 * 2e9 + 3e-3 * 3e9 + 1e-3 * 2e9)
    expected = np.sqrt(825.0**2 - 2.0 * work / references.PAPER_MASS)
    outcomes = layered(front, *behind, shots=shots_at([0.0, 0.3e-3], [0.0, 0.1e-3]), device=device, level=2)
    assert (outcomes.status == Status.PERFORATED).all()
    assert (outcomes.layer_status == Status.PERFORATED).all()
    assert outcomes.residual_velocity == pytest.approx(expected, abs=0.4)  # κ takes some; measured: 0.1
    assert outcomes.layer_residual_velocity[:, -1] == pytest.approx(outcomes.residual_velocity, abs=1e-3)


def test_depth_in_a_base_is_that_of_the_energy_left(device: str) -> None:
    # What the plate leaves of the energy is spent on the hole: Y ∫ πr² ds, r the radius of the core where it enters.
    front = solid_plate(thickness=2e-3, shear_coefficient=SMOOTH, degradation=1.0)
    base = layer(front, thickness=60e-3, resistance=4e9, gap=0.1)
    left = 0.5 * references.PAPER_MASS * 825.0**2 - 2.6e9 * 2e-3 * pi * RADIUS**2

    def spent(depth: float) -> float:
        def area(s: float) -> float:
            return pi * float(PAPER_CORE.radius(np.array(min(s, 22.68e-3)))) ** 2

        return 4e9 * quad(area, 0.0, depth, points=[22.68e-3])[0] - left

    expected = brentq(spent, 1e-3, 59e-3)
    outcomes = layered(front, base, shots=shots_at([0.0, 0.3e-3], [0.0, 0.1e-3]), device=device)
    assert (outcomes.status == Status.ARRESTED).all()
    assert (outcomes.stopped_in == 1).all()
    assert (outcomes.layer_status == [Status.PERFORATED, Status.ARRESTED]).all()
    assert outcomes.depth == pytest.approx(expected, abs=0.1e-3)
    thin = base.model_copy(update={"thickness": 14e-3})  # the nose comes out of its rear face
    held = layered(front, thin, shots=shots_at([0.0], [0.0], yaw=10.0), device=device)
    assert (held.stopped_in == 1).all()
    assert (held.depth > 14e-3 + 0.1e-3).all()


def test_a_plate_behind_air_is_the_plate_where_the_line_of_flight_meets_it(device: str) -> None:
    nothing = Plate(thickness=1e-3, resistance=0.0)
    distance, scene = 0.101, {"device": device, "time_step": 1e-6}
    attitude = {"obliquity": 30.0, "azimuth": 40.0, "yaw": 3.0}
    way = distance * np.tan(np.radians(30.0))
    there = Y + way * np.cos(np.radians(40.0)), Z + way * np.sin(np.radians(40.0))
    expected = simulate(paper_plate(), shots_at(*there, **attitude), **scene)
    behind = layer(paper_plate(), gap=0.1)
    got = layered(nothing, behind, shots=shots_at(Y, Z, **attitude), **scene)
    assert_alike(got, expected, velocity=0.3, angle=0.3)  # the steps begin elsewhere; measured: 0.05, 0.05
    shifted = layer(paper_plate(), gap=0.1, offset=tuple(to[0] - at[0] for to, at in zip(there, (Y, Z), strict=True)))
    got = layered(nothing, shifted, shots=shots_at(Y, Z, **attitude), **scene)
    assert_alike(got, simulate(paper_plate(), shots_at(Y, Z, **attitude), **scene), velocity=0.3, angle=0.3)


def test_flight_between_layers_is_exact_for_a_core_that_turns(device: str) -> None:
    # A layer without resistance fills the gap: the core crosses it step by step, and must come out the same.
    slots, base = paper_plate(), layer(solid_plate(thickness=3e-3), gap=0.1)
    filling = Layer(thickness=0.1, resistance=0.0)
    scene: dict[str, Any] = {"shots": shots_at(Y, Z, spin=1.7e4), "device": device, "time_step": 0.4e-6}
    jumps = layered(slots, base, **scene)
    steps = layered(slots, filling, base.model_copy(update={"gap": 0.0}), **scene)
    assert np.degrees(jumps.tilt).max() > 25.0
    assert_alike(jumps, steps, velocity=0.2, angle=0.2)
    assert jumps.layer_residual_velocity[:, 0] == pytest.approx(steps.layer_residual_velocity[:, 0], abs=2e-3)


def test_a_layer_that_is_missed_changes_nothing(device: str) -> None:
    scene: dict[str, Any] = {"shots": shots_at(Y, Z, **TURNED), "device": device}
    slots, base = paper_plate(), layer(paper_plate(), gap=20e-3)
    missed = layer(slots, **MISSES | {"gap": 5e-3})
    plain = layered(slots, missed, **scene)
    other = layered(slots, missed.model_copy(update={"offset": (0.0, -0.1)}), **scene)
    for name, values in vars(plain).items():
        np.testing.assert_array_equal(getattr(other, name), values, err_msg=name)
    assert (plain.layer_status[:, 1] == Status.UNTOUCHED).all()
    assert_alike(plain, simulate(slots, **scene), velocity=1e-3, angle=np.inf)  # stand-offs lie behind all layers
    between = layered(slots, missed, base.model_copy(update={"gap": 11e-3}), **scene)
    without = layered(slots, base, **scene)
    # A compiler may sum the loads of three layers in another order than those of two: measured, one ulp.
    assert_alike(between, without, velocity=5e-4, angle=5e-4)


def test_a_core_that_turns_back_from_the_base_with_little_speed_rests_there(device: str) -> None:
    # What is left of its tumbling pushes it out. It would cross the gap, and rest behind the plate, after 2 to 20 ms.
    base = layer(solid_plate(degradation=1.0, resistance=5e9), thickness=3e-3, gap=0.1)
    shots = shots_at([2.276e-3, 5.628e-3], [4.13e-3, 6.856e-3])
    outcomes = layered(paper_plate(), base, shots=shots, device=device, level=2)
    assert (outcomes.status == Status.ARRESTED).all()
    assert (outcomes.stopped_in == 1).all()
    assert (outcomes.exit_position[:, 0] > 0.1).all()
    assert (outcomes.contact_duration < 0.5e-3).all()


def test_a_core_that_slides_between_layers_stays_there(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Through a wide hole, off the base at a small angle, and along the rear face of the plate, beside any hole.
    monkeypatch.setattr(resolution, "STEP_ALLOWANCE", 3)
    hole = CirclePattern(diameter=0.3, spacing=(1.0, 1.0))
    front = paper_plate(
        thickness=10e-3, degradation=1.0, shear_coefficient=SMOOTH, pattern=hole, degradation_length=5e-3
    )
    base = Layer(thickness=40e-3, resistance=2e9, gap=0.2)
    shots = shots_at([-0.1, 0.05], [0.0, 2e-3], obliquity=75.0)
    outcomes = layered(front, base, shots=shots, device=device, level=0)
    assert (outcomes.status == Status.ARRESTED).all()
    assert (outcomes.stopped_in == -1).all()
    assert (outcomes.layer_status == [Status.UNTOUCHED, Status.RICOCHETED]).all()
    assert np.abs(outcomes.exit_position[:, 1]).min() > 1.0


VELOCITY, THICKNESS, HALF_SIZE = 825.0, 4e-3, 10e-3
WEAK = 2.6e4  # [Pa]: the core turns by 1e-5 of what it does in the paper's plate
CONE_LENGTH, CONE_RADIUS = 15e-3, 3e-3
CONE = ConeCore(diameter=2 * CONE_RADIUS, length=25e-3, cone_length=CONE_LENGTH, mass=4e-3)


def impulse(shear_coefficient: float) -> tuple[float, float]:
    """Lateral impulse [N s] and angular impulse about z [N m s] on the half of the cone that faces −y.

    In straight flight every element of it is in the plate for h/v and carries Y (−n + η t). With k = r' it has
    n dA = (k, e_r) r dφ ds, t dA = (−1, k e_r) r dφ ds and the arm (ξ, r e_r), ξ ahead of the centre of mass; so, as
    ∫ cos φ dφ = −2 over the half,

        ∫ F_y dt = 2 Y h/v (1 − η k) ∫ r ds,      ∫ M_z dt = 2 Y h/v ∫ [(1 − η k) ξ − (k + η) r] r ds.
    """
    slope, centre = CONE_RADIUS / CONE_LENGTH, CONE.mass_properties.centre_of_mass
    radius_integral, square_integral = CONE_RADIUS * CONE_LENGTH / 2, CONE_RADIUS**2 * CONE_LENGTH / 3
    lateral = 1 - shear_coefficient * slope
    scale = 2 * WEAK * THICKNESS / VELOCITY
    turning = lateral * (centre * radius_integral - square_integral / slope)
    return scale * lateral * radius_integral, scale * (turning - (slope + shear_coefficient) * square_integral)


# Rings and sectors are finite, and the edge is spread over half a cell of the grid. Measured: 3.4e-3 of the force,
# 3.5e-3 of the moment. Nothing weakens within microseconds.
@pytest.mark.parametrize(("along", "turning"), [("y", [0.0, 0.0, 1.0]), ("z", [0.0, -1.0, 0.0])])
def test_half_a_cone_on_an_edge_receives_its_impulse(along: str, turning: list[float], device: str) -> None:
    material = {"resistance": WEAK, "shear_coefficient": 0.3, "degradation": 0.5, "degradation_interval": 1e3}
    plate, shots = solid_plate(size=(2 * HALF_SIZE, 2 * HALF_SIZE), **material), shots_at(**{f"hit_{along}": HALF_SIZE})
    outcomes = simulate(plate, shots, core=CONE, precision="double", device=device)
    assert outcomes.status[0] == Status.PERFORATED
    lateral, angular = impulse(0.3)
    mass, _, _, inertia = CONE.mass_properties
    assert outcomes.deflection[0] == pytest.approx(lateral / mass / VELOCITY, rel=4e-3)
    expected = angular / inertia * np.array(turning)
    assert outcomes.angular_velocity[0] == pytest.approx(expected, rel=5e-3, abs=1e-9 * abs(expected).max())


def test_holes_of_a_finite_plate_may_be_listed() -> None:
    # Slots reach 6 mm along z about 0, ±16 mm (even rows) and ±8 mm (odd rows); those at ±16 mm are left out.
    size = (48e-3, 48e-3)
    whole = [(8e-3 * row, z) for row in range(-2, 3) for z in ([0.0] if row % 2 == 0 else [-8e-3, 8e-3])]
    slots = paper_plate().pattern.model_copy(update={"holes": whole, "spacing": size, "staggered": False})
    bounded = paper_plate(size=size, pattern=slots)
    left_out = shots_at([0.0, 1.0e-3, -0.5e-3], [16e-3, 15e-3, -15e-3])
    kept = shots_at([0.0, 1.0e-3, 7e-3], [0.0, 3e-3, 9e-3])
    solid = simulate(solid_plate(size=size), left_out).residual_velocity
    assert simulate(bounded, left_out).residual_velocity == pytest.approx(solid, abs=1e-3)
    unbounded = simulate(paper_plate(), kept).residual_velocity
    assert simulate(bounded, kept).residual_velocity == pytest.approx(unbounded, abs=0.02)
    assert np.abs(simulate(paper_plate(), left_out).residual_velocity - solid).min() > 5.0


@pytest.mark.parametrize(("precision", "epsilon"), [("single", 2.0**-23), ("double", 2.0**-52)])
def test_pass_through_a_wide_hole_is_free_flight(precision: str, epsilon: float, device: str) -> None:
    plate = paper_plate(pattern=CirclePattern(diameter=40e-3, spacing=(60e-3, 60e-3)))
    shots = shots_at(1e-3, -2e-3, velocity=826.0, pitch=3.0, yaw=-2.0, spin=1.7e4)
    outcomes = simulate(plate, shots, precision=precision, device=device)
    assert outcomes.status[0] == Status.UNTOUCHED
    assert outcomes.residual_velocity[0] == 826.0
    assert outcomes.energy_loss[0] == outcomes.contact_duration[0] == outcomes.deflection[0] == 0.0
    # L is the spin about the axis alone, so the axis stays: its projections are the shot's pitch and yaw.
    pitch, yaw = np.deg2rad([3.0, -2.0])
    tilt = np.arctan(np.hypot(np.tan(pitch), np.tan(yaw)))
    for name, angle in {"pitch": pitch, "yaw": yaw, "tilt": tilt, "total_yaw": tilt}.items():
        assert getattr(outcomes, name) == pytest.approx(angle, abs=8 * epsilon), name
    axis = np.array([1.0, np.tan(yaw), np.tan(pitch)]) * np.cos(tilt)
    assert outcomes.angular_velocity[0] == pytest.approx(1.7e4 * axis, abs=1.7e4 * 8 * epsilon)


def test_glancing_hits_stay_within_their_windows(monkeypatch: pytest.MonkeyPatch, device: str) -> None:
    shots = shots_at(*scattered_hits(16), obliquity=70.0, azimuth=40.0)
    outcomes = simulate(paper_plate(), shots, device=device)
    assert not (outcomes.status >= Status.UNFINISHED).any()
    assert {Status.PERFORATED, Status.RICOCHETED} <= set(outcomes.status)
    monkeypatch.setattr(marching, "MAX_DOUBLINGS", 1)  # they do need wider windows
    first = simulate(paper_plate(), shots, device=device)
    left = first.status == Status.LEFT_WINDOW
    assert left.any()
    for name in ("residual_velocity", "tilt", "angular_velocity"):
        assert np.isnan(getattr(first, name)[left]).all(), name
