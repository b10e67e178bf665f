"""Torque-free flight of the spinning core: through a hole, and behind a plate (docs/model.md §5, 6.5, 6.6)."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import CirclePattern

from .scenes import paper_plate, shots_at, simulate

WIDE_HOLE = paper_plate(pattern=CirclePattern(diameter=40e-3, spacing=(60e-3, 60e-3)))
THROUGH_HOLE = {"velocity": 826.0, "pitch": 3.0, "yaw": -2.0, "spin": 1.7e4}
EPSILON = {"single": 2.0**-23, "double": 2.0**-52}
PRECISIONS = pytest.mark.parametrize("precision", list(EPSILON))


@PRECISIONS
def test_pass_through_a_wide_hole_is_free_flight(precision: str, device: str) -> None:
    shots = shots_at(1e-3, -2e-3, **THROUGH_HOLE)
    outcomes = simulate(WIDE_HOLE, shots, precision=precision, device=device)
    assert outcomes.status[0] == Status.UNTOUCHED
    assert outcomes.residual_velocity[0] == 826.0
    assert outcomes.energy_loss[0] == outcomes.contact_duration[0] == outcomes.deflection[0] == 0.0
    # L is the spin about the axis alone, so the axis stays: its projections are the shot's pitch and yaw.
    pitch, yaw = np.deg2rad([3.0, -2.0])
    few_ulp = 8 * EPSILON[precision]
    assert outcomes.pitch == pytest.approx(pitch, abs=few_ulp)
    assert outcomes.yaw == pytest.approx(yaw, abs=few_ulp)
    tilt = np.arctan(np.hypot(np.tan(pitch), np.tan(yaw)))
    assert outcomes.tilt == pytest.approx(tilt, abs=few_ulp)
    assert outcomes.total_yaw == pytest.approx(tilt, abs=few_ulp)
    axis = np.array([1.0, np.tan(yaw), np.tan(pitch)]) * np.cos(tilt)
    assert outcomes.angular_velocity[0] == pytest.approx(1.7e4 * axis, abs=1.7e4 * few_ulp)
