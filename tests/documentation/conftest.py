"""Pilots of few shots: pages show how the commands are used, and their results are not looked at."""

import pytest

from warpimpact.solver import pilot


@pytest.fixture(autouse=True)
def small_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SHOTS", "SHOTS_OF_FINE", "MOST"):
        monkeypatch.setattr(pilot, name, 8)
