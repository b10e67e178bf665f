"""Without a rate in the law, outcomes depend on Y/v² alone (docs/model.md §4, 6.9)."""

from typing import Any

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import Plate

from .scenes import Array, paper_plate, scattered_hits, shots_at, simulate

HITS = scattered_hits(12)
SPEEDS = np.array([825.0, 300.0, 1650.0])
BY_PATH = {"degradation": 0.8, "degradation_interval": None, "degradation_distance": 0.825e-3}


def scaled(speed: float, device: str, **material: Any) -> Array:
    """Outcomes without a unit, [hits, 6], at a speed and the resistance that goes with it: residual share of energy,
    tilt at both stand-offs, deflection and status; oblique and yawed, one of the hits arrested by nothing."""
    plate: Plate = paper_plate(resistance=2.6e9 * (speed / SPEEDS[0]) ** 2, **material)
    shots = shots_at(*HITS, velocity=speed, obliquity=12.0, azimuth=50.0, yaw=2.0)
    actual = simulate(plate, shots, precision="double", device=device)
    kept = 1.0 - actual.energy_loss / actual.energy_loss.max()
    share = np.square(actual.residual_velocity / speed)
    return np.column_stack([share, kept, actual.tilt, actual.deflection, actual.status])


@pytest.mark.parametrize("material", [BY_PATH, {"degradation": 1.0}], ids=["by path", "lasting"])
def test_outcomes_depend_on_resistance_over_speed_squared_alone(material: dict[str, Any], device: str) -> None:
    # Time steps are ways at impact velocity, so every step is the same but for rounding.
    first, *others = (scaled(speed, device, **material) for speed in SPEEDS)
    assert (first[:, -1] == Status.PERFORATED).all()
    assert np.ptp(first[:, 0]) > 0.05
    for other in others:
        np.testing.assert_allclose(other, first, rtol=1e-8, atol=1e-8)


def test_by_time_a_slow_core_weakens_the_plate_more(device: str) -> None:
    fast, slow = (scaled(speed, device, degradation=0.8)[:, 0] for speed in (825.0, 300.0))
    assert (slow > fast).all()
