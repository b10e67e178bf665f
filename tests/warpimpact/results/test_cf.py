"""Result files follow the CF conventions, as the IOOS compliance checker reads them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.firing.plan import read_test
from warpimpact.firing.simulate import Response, simulate_test
from warpimpact.results import files
from warpimpact.runs.run import run

pytest.importorskip("compliance_checker")
CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
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
    message = report(tmp_path / "a.nc")
    assert "All tests passed!" in message, message


def test_a_firing_test_complies(tmp_path: Path) -> None:
    (tmp_path / "limits.nc").touch()
    text = (CAMPAIGNS / "firing" / "v50_test.toml").read_text(encoding="utf-8").replace("tests = 1000", "tests = 20")
    text = text.replace('campaign = "plate_and_base.toml"', 'limits = "limits.nc"')
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    test = read_test(tmp_path / "a.toml")
    files.write(simulate_test(test, Response(np.linspace(800.0, 1100.0, 20))), tmp_path / "a.nc")
    message = report(tmp_path / "a.nc")
    assert "All tests passed!" in message, message
