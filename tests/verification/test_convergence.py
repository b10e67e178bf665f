"""Finer numerics shrink the error; without a rate outcomes depend on Y/v² alone (docs/model.md §4, 6.9)."""

from typing import Any

import numpy as np

from warpimpact.kernels.status import Status

from .scenes import Array, paper_plate, scattered_hits, shots_at, simulate

# Half of the hits are normal, half are oblique and yawed; none lies on a line of symmetry.
SHOTS = shots_at(*scattered_hits(64), obliquity=[0.0, 20.0] * 32, azimuth=30.0, yaw=[0.0, 2.0] * 32)


def orders(settings: list[dict[str, Any]], device: str) -> Array:
    """Observed orders of residual velocity and of tilt at 130 mm, shape (2,). Each setting is twice as fine as the one
    before. The order is the slope of log2 of the changes between settings, as root mean squares over the hits."""
    outcomes = [simulate(paper_plate(), SHOTS, precision="double", device=device, **each) for each in settings]
    answers = np.array([[o.residual_velocity, o.tilt[:, 1]] for o in outcomes])
    changes = np.sqrt(np.mean(np.diff(answers, axis=0) ** 2, axis=2))
    return -np.polyfit(np.arange(len(changes)), np.log2(changes), 1)[0]


def test_time_step_is_of_first_order(device: str) -> None:
    # The onset of contact is a ramp as wide as the step. Measured: 1.0 to 1.3 (three sets of hits).
    steps = [3.2e-6, 1.6e-6, 0.8e-6, 0.4e-6, 0.2e-6, 0.1e-6]
    patches = {"patches_axial": 24, "patches_around": 48}
    assert (orders([{"time_step": step, **patches} for step in steps], device) > 0.7).all()


def test_patches_are_nearly_of_second_order(device: str) -> None:
    # A patch acts at its centre: second order, except where an edge or a rim crosses it. Measured: 1.5 to 1.9.
    numerics = [{"time_step": 0.4e-6, "patches_axial": n, "patches_around": 2 * n} for n in (16, 32, 64, 128)]
    assert (orders(numerics, device) > 1.2).all()


def test_grid_is_nearly_of_second_order(device: str) -> None:
    # Cells interpolate linearly: second order, except where the edge of a hole crosses them. Measured: 1.4 to 1.7.
    scene = {"time_step": 0.4e-6, "patches_axial": 48, "patches_around": 96}
    spacings = [0.5e-3, 0.25e-3, 0.125e-3, 0.0625e-3]
    assert (orders([{"grid_spacing": spacing, **scene} for spacing in spacings], device) > 1.2).all()


SPEEDS = np.array([825.0, 300.0, 1650.0])
BY_PATH = {"degradation": 0.8, "degradation_interval": None, "degradation_distance": 0.825e-3}


def scaled(speed: float, device: str, **material: Any) -> Array:
    """Outcomes without a unit, [hits, 6], at a speed and the resistance that goes with it: residual share of energy,
    tilt at both stand-offs, deflection and status; oblique and yawed."""
    plate = paper_plate(resistance=2.6e9 * (speed / SPEEDS[0]) ** 2, **material)
    shots = shots_at(*scattered_hits(12), velocity=speed, obliquity=12.0, azimuth=50.0, yaw=2.0)
    actual = simulate(plate, shots, precision="double", device=device)
    kept = 1.0 - actual.energy_loss / actual.energy_loss.max()
    share = np.square(actual.residual_velocity / speed)
    return np.column_stack([share, kept, actual.tilt, actual.deflection, actual.status])


def test_outcomes_depend_on_resistance_over_speed_squared_alone(device: str) -> None:
    # Time steps are ways at impact velocity, so every step is the same but for rounding.
    first, *others = (scaled(speed, device, **BY_PATH) for speed in SPEEDS)
    assert (first[:, -1] == Status.PERFORATED).all()
    assert np.ptp(first[:, 0]) > 0.05
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-8, atol=1e-8)


def test_by_time_a_slow_core_weakens_the_plate_more(device: str) -> None:
    fast, slow = (scaled(speed, device, degradation=0.8)[:, 0] for speed in (825.0, 300.0))
    assert (slow > fast).all()
