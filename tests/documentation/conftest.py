"""Pilots of few shots: pages show how the commands are used, and their results are not looked at."""

import pytest

from warpimpact.scene.numerics import Accuracy
from warpimpact.solver import accuracy


@pytest.fixture(autouse=True)
def small_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    pilot_size = accuracy.pilot_size

    def few(wanted: Accuracy, least: int = 8) -> int:
        return pilot_size(wanted, min(least, 8))

    monkeypatch.setattr("warpimpact.runs.compute.pilot_size", few)
    monkeypatch.setattr("warpimpact.solver.simulate.pilot_size", few)
