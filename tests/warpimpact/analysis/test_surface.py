"""What presses on the core's surface adds up to the force that the march recorded."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.replay_geometry import pressed
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
RESISTANCE = 2.6e9


@pytest.fixture(scope="module")
def histories() -> list[xarray.Dataset]:
    text = SLOTTED_PLATE.read_text().replace("shear_coefficient = 0.05", "shear_coefficient = 0")
    result = run(Campaign.from_text(text, name="a", folder=Path(), count=8), device="cpu")
    return [replay(result, hit, folder=Path()) for hit in range(8)]


def largest(history: xarray.Dataset) -> int:
    return int(np.linalg.norm(history["force"], axis=1).argmax())


def test_stress_adds_up_to_the_recorded_force(histories: list[xarray.Dataset]) -> None:
    for history in histories:
        step = largest(history)
        surface = pressed(history, step)
        force = -RESISTANCE * np.sum((surface.stress * surface.area)[..., None] * surface.normal, axis=(0, 1))
        recorded = history["force"].values[step]
        size = np.linalg.norm(recorded)
        assert force @ recorded / (size * np.linalg.norm(force)) > 0.995
        assert np.linalg.norm(force) == pytest.approx(size, rel=0.3)


def test_nothing_presses_outside_the_slab_or_in_holes(histories: list[xarray.Dataset]) -> None:
    for history in histories:
        surface = pressed(history, largest(history))
        x = surface.point[surface.stress > 0.0][:, 0]
        assert ((x >= 0.0) & (x <= 4e-3)).all()
        assert surface.stress.max() <= 1.0
    last = pressed(history, history.sizes["time"] - 1)
    assert not last.stress.any()
