"""A result by finite elements as measured shots."""

from pathlib import Path

import numpy as np
import pytest

from warpimpact import Campaign, run
from warpimpact.cli import main
from warpimpact.identification.fit import PRIORS, fit_of_result
from warpimpact.identification.fit_file import HitPlace
from warpimpact.results import attributes as attr
from warpimpact.results import files

CAMPAIGN = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


@pytest.fixture
def result(tmp_path: Path) -> Path:
    """A map of the fast law with the attribute of one by finite elements; one of its hits has failed."""
    dataset = run(Campaign.from_toml(CAMPAIGN, count=6), device="cpu")
    dataset.attrs[attr.CONTINUUM] = "{}"
    dataset["residual_velocity"][2] = np.nan
    dataset["tilt"][2] = np.nan
    files.write(dataset, tmp_path / "c.nc")
    return tmp_path / "c.nc"


def test_its_sound_hits_are_shots_at_known_places(result: Path) -> None:
    dataset, fit = files.read(result), fit_of_result(result)
    assert [shot.name for shot in fit.shots] == ["hit 0", "hit 1", "hit 3", "hit 4", "hit 5"]
    for shot, hit in zip(fit.shots, (0, 1, 3, 4, 5), strict=True):
        assert shot.hit == HitPlace(y=float(dataset["hit_y"][hit]), z=float(dataset["hit_z"][hit]))
        values = [one.value for one in shot.observations]
        assert values[0] == pytest.approx(float(dataset["residual_velocity"][hit]))
        assert np.degrees(values[1:]) == pytest.approx(dataset["tilt"].values[hit], rel=1e-6)
    assert {parameter.name for parameter in fit.parameters} >= PRIORS.keys()


def test_a_map_of_the_fast_law_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write(run(Campaign.from_toml(CAMPAIGN, count=2), device="cpu"), tmp_path / "map.nc")
    assert main(["identify", "map.nc"]) == 2
    assert "is a map of hits of the fast law" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]
