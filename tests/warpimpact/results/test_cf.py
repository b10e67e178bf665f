"""Result files follow the CF conventions, as the IOOS compliance checker reads them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.firing.directions import Directions, Sector
from warpimpact.firing.plan_file import firing_test
from warpimpact.firing.repeated import simulate_test
from warpimpact.firing.response import normal_response
from warpimpact.results import files
from warpimpact.runs.run import run
from warpimpact.statistics.intervals import Estimate

pytest.importorskip("compliance_checker")
CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
KNOWN_TARGET = (CAMPAIGNS / "firing" / "known_target.toml").read_text(encoding="utf-8")
SLOTTED_PLATE = (CAMPAIGNS / "slotted_plate.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    text = SLOTTED_PLATE.replace('"standard"', '"draft"').replace("[output]", "[output]\nbending = true")
    return run(Campaign.from_text(text, name="a", folder=Path(), count=16), device="cpu")


def report(path: Path) -> str:
    checker = Path(sys.executable).with_name("compliance-checker")
    command = [str(checker), "--test", "cf:1.11", "--criteria", "strict", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def test_a_hit_map_complies(result: xarray.Dataset, tmp_path: Path) -> None:
    files.write(result, tmp_path / "a.nc")
    told = report(tmp_path / "a.nc")
    assert "All tests passed!" in told, told


def test_a_firing_test_with_directions_complies(tmp_path: Path) -> None:
    directions = Directions(azimuth=(0.0, 0.5), elevation=(0.0,))
    cells = np.full((2, 1), 0.5)
    sector = Sector(
        cells,
        cells,
        cells,
        cells.astype(int),
        cells.astype(int),
        Estimate(0.5, 0.4, 0.6, 64, 0.5),
        "evidence: none",
    )
    test = firing_test(KNOWN_TARGET.replace("tests = 1000", "tests = 20"), "a", tmp_path)
    target = {"campaign": Path(__file__)}
    asked = test.model_copy(update={"directions": directions, "target": target})
    files.write(simulate_test(asked, normal_response(800.0, 25.0), None, sector), tmp_path / "a.nc")
    told = report(tmp_path / "a.nc")
    assert "All tests passed!" in told, told


def test_the_checker_finds_what_does_not_comply(result: xarray.Dataset, tmp_path: Path) -> None:
    wrong = result.copy()
    wrong["tilt"].attrs["units"] = "slopes"
    files.write(wrong, tmp_path / "a.nc")
    told = report(tmp_path / "a.nc")
    assert "tilt" in told
    assert "All tests passed!" not in told
