"""A shot that leaves the largest window that is tried has the history of its march there."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import Hits, Impact, Numerics, Scene, make_shots
from warpimpact.solver import grid, marching, replay
from warpimpact.solver.simulate import simulate

from ...verification.scenes import PAPER_CORE, paper_plate


def test_the_history_ends_where_the_march_in_the_largest_window_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "SLACK", 0.1)
    monkeypatch.setattr(marching, "MAX_DOUBLINGS", 2)
    plate = paper_plate()
    scene, shots = (
        Scene(core=PAPER_CORE, target=plate),
        make_shots(Impact(velocity=825.0), Hits(count=8, seed=1), plate),
    )
    level = Numerics(level=2)
    left = np.flatnonzero(simulate(scene, shots, numerics=level, device="cpu").status == Status.LEFT_WINDOW)
    assert len(left)
    march, contact = replay.traced(scene, shots[left[:1]], level)
    assert contact.status.numpy() == [Status.LEFT_WINDOW]
    assert contact.steps.numpy() == [march.memory.prepared.rows - 1]
