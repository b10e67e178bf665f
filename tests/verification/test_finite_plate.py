"""Edges, holes that are left out or wide, and glancing hits: impulse, free flight and windows (docs/model.md §4, 5)."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import CirclePattern, ConeCore
from warpimpact.solver import marching

from .scenes import paper_plate, scattered_hits, shots_at, simulate, solid_plate

VELOCITY, THICKNESS, HALF_SIZE = 825.0, 4e-3, 10e-3
WEAK = 2.6e4  # [Pa]: the core turns by 1e-5 of what it does in the paper's plate
CONE_LENGTH, RADIUS = 15e-3, 3e-3
CONE = ConeCore(diameter=2 * RADIUS, length=25e-3, cone_length=CONE_LENGTH, mass=4e-3)


def impulse(shear_coefficient: float) -> tuple[float, float]:
    """Lateral impulse [N s] and angular impulse about z [N m s] on the half of the cone that faces −y.

    In straight flight every element of it is in the plate for h/v and carries Y (−n + η t). With k = r' it has
    n dA = (k, e_r) r dφ ds, t dA = (−1, k e_r) r dφ ds and the arm (ξ, r e_r), ξ ahead of the centre of mass; so, as
    ∫ cos φ dφ = −2 over the half,

        ∫ F_y dt = 2 Y h/v (1 − η k) ∫ r ds,      ∫ M_z dt = 2 Y h/v ∫ [(1 − η k) ξ − (k + η) r] r ds.
    """
    slope, centre = RADIUS / CONE_LENGTH, CONE.mass_properties.centre_of_mass
    radius_integral, square_integral = RADIUS * CONE_LENGTH / 2, RADIUS**2 * CONE_LENGTH / 3
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
