"""Targets of several layers: closed forms, and targets that say the same thing in two ways (docs/model.md §6.10)."""

from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import CirclePattern, Layer, NoPattern, Plate, Target
from warpimpact.solver import resolution

from . import references
from .scenes import PAPER_CORE, layer, paper_plate, scattered_hits, shots_at, simulate, solid_plate

RADIUS = references.PAPER_LARGEST_RADIUS
Y, Z = scattered_hits(24)
TURNED = {"obliquity": 15.0, "azimuth": 40.0, "pitch": 4.0, "yaw": -6.0}
SMOOTH = 1e-9
"""No friction to speak of, in the build of the kernels that has it."""
MISSES = {"pattern": NoPattern(), "size": (1e-3, 1e-3), "offset": (0.5, 0.0)}
"""A layer that no core of these tests comes near."""


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
    assert held.depth == pytest.approx(14e-3, rel=1e-6)


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
    other = layered(slots, missed.model_copy(update={"offset": (0.0, -0.7)}), **scene)
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
