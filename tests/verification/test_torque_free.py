"""Torque-free flight of the spinning core: through a hole, and behind a plate (docs/model.md §5, 6.5, 6.6)."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import CirclePattern

from . import references
from .scenes import PAPER_CORE, STANDOFFS, histories, paper_plate, shots_at, simulate, solid_plate

WIDE_HOLE = paper_plate(pattern=CirclePattern(diameter=40e-3, spacing=(60e-3, 60e-3)))
THROUGH_HOLE = {"velocity": 826.0, "pitch": 3.0, "yaw": -2.0, "spin": 1.7e4}
EPSILON = {"single": 2.0**-23, "double": 2.0**-52}
PRECISIONS = pytest.mark.parametrize("precision", list(EPSILON))

# Past the edge of a small plate: the plate pushes the nose aside, and the core flies on without contact.
SMALL_PLATE = solid_plate(size=(10e-3, 10e-3))
PAST_THE_EDGE = {"velocity": 600.0, "yaw": 10.0, "pitch": 3.0, "spin": 1.7e4}
EDGE = (7e-3, 1e-3)


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


def test_attitude_at_the_standoffs_is_that_of_precession() -> None:
    shots = shots_at(*EDGE, **PAST_THE_EDGE)
    (history,) = histories(SMALL_PLATE, shots, precision="double")
    outcomes = simulate(SMALL_PLATE, shots, precision="double")
    assert outcomes.status[0] == Status.PERFORATED
    # The centre of mass passes x = h + d at this time after the last traced step.
    planes = SMALL_PLATE.thickness + np.array(STANDOFFS)
    time = (planes - history.position[-1, 0]) / history.velocity[-1, 0]
    axis = references.torque_free_axis(
        time, history.axis[-1], history.angular_momentum[-1], PAPER_CORE.mass_properties.inertia_transverse
    )
    # Traced and untraced kernels are compiled apart, and may round differently: 1e-12 against angles of order 1.
    assert outcomes.pitch[0] == pytest.approx(np.arctan2(axis[:, 2], axis[:, 0]), abs=1e-11)
    assert outcomes.yaw[0] == pytest.approx(np.arctan2(axis[:, 1], axis[:, 0]), abs=1e-11)
    assert outcomes.tilt[0] == pytest.approx(np.arccos(axis[:, 0]), abs=1e-11)
    direction = history.velocity[-1] / np.linalg.norm(history.velocity[-1])
    assert outcomes.total_yaw[0] == pytest.approx(np.arccos(axis @ direction), abs=1e-11)
    assert np.ptp(outcomes.tilt) > 0.1
