"""A shot that leaves the largest window that is tried has the history of its march there."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import Hits, Impact, Numerics, Plate, PolynomialCore, Scene, SlotPattern, make_shots
from warpimpact.solver import marching, replay, windows
from warpimpact.solver.simulate import simulate

PLATE = Plate(
    thickness=4e-3,
    resistance=2.6e9,
    shear_coefficient=0.05,
    degradation=0.8,
    pattern=SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True),
)
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)


def test_the_history_ends_where_the_march_in_the_largest_window_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "SLACK", 0.1)
    monkeypatch.setattr(marching, "MAX_DOUBLINGS", 2)
    scene, shots = Scene(core=CORE, target=PLATE), make_shots(Impact(velocity=825.0), Hits(count=8, seed=1), PLATE)
    level = Numerics(level=2)
    left = np.flatnonzero(simulate(scene, shots, numerics=level, device="cpu").status == Status.LEFT_WINDOW)
    assert len(left)
    march, contact = replay.traced(scene, shots[left[:1]], level)
    assert contact.status.numpy() == [Status.LEFT_WINDOW]
    assert contact.steps.numpy() == [march.memory.prepared.rows - 1]
