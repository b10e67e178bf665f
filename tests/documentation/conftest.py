"""Pilots of few shots: pages show how the commands are used, and their results are not looked at."""

from functools import partial

import pytest

from warpimpact.solver import accuracy


@pytest.fixture(autouse=True)
def small_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    pilot_size = partial(accuracy.pilot_size, least=8)
    monkeypatch.setattr("warpimpact.runs.compute.pilot_size", pilot_size)
    monkeypatch.setattr("warpimpact.solver.simulate.pilot_size", pilot_size)
