"""How a shot may end, and that the size of its window has no effect."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.solver import marching

from .scenes import paper_plate, scattered_hits, shots_at, simulate

GLANCING = {"obliquity": 70.0, "azimuth": 40.0}


def test_glancing_hits_end_within_the_windows_they_are_given(monkeypatch: pytest.MonkeyPatch, device: str) -> None:
    shots = shots_at(*scattered_hits(16), **GLANCING)
    outcomes = simulate(paper_plate(), shots, device=device)
    assert not (outcomes.status >= Status.UNFINISHED).any()
    assert {Status.PERFORATED, Status.RICOCHETED} <= set(outcomes.status)
    monkeypatch.setattr(marching, "MAX_DOUBLINGS", 1)  # they do need wider windows
    first = simulate(paper_plate(), shots, device=device)
    left = first.status == Status.LEFT_WINDOW
    assert left.any()
    for name in ("residual_velocity", "tilt", "angular_velocity"):
        assert np.isnan(getattr(first, name)[left]).all(), name
