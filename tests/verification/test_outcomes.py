"""How a shot may end, and that the size of its window has no effect."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.scene import ProfileCore
from warpimpact.solver import marching

from .scenes import REFERENCE, paper_plate, scattered_hits, shots_at, simulate, solid_plate

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


def test_a_flat_nose_does_not_weaken_the_plate_under_itself_alone() -> None:
    # A disc of patches wider than ℓ leaves gaps in the exposure and weakens its own cells too much: too little drag.
    core = ProfileCore(s=(0.0, 20e-3), r=(3e-3, 3e-3), mass=4e-3)
    plate = solid_plate(shear_coefficient=1e-9, degradation=0.3)
    lost = [
        825.0 - simulate(plate, shots_at(), core=core, **numerics).residual_velocity[0] for numerics in ({}, REFERENCE)
    ]
    assert lost[0] == pytest.approx(lost[1], rel=0.06)  # measured: 3.9 %; 36 % with rings as wide as the profile's
