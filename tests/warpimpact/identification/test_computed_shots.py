"""A result by finite elements as measured shots."""

import re
from pathlib import Path

import numpy as np
import pytest

from warpimpact import Campaign, run
from warpimpact.campaign.catalogued import with_materials
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Material
from warpimpact.cli import main
from warpimpact.identification.computed_shots import PRIORS, fit_of_result
from warpimpact.identification.hit_places import HitPlace
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.posterior_file import POSTERIOR

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
    assert {str(parameter.path[-1]) for parameter in fit.parameters} >= PRIORS.keys()


def test_a_map_of_the_fast_law_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write(run(Campaign.from_toml(CAMPAIGN, count=2), device="cpu"), tmp_path / "map.nc")
    assert main(["identify", "map.nc"]) == 2
    assert "is a map of hits of the fast law" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]


def test_what_was_found_is_a_material_that_a_campaign_takes(
    posterior: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Y and η are the medians of the draws, the interval is theirs, and the entry says of which shots it is."""
    own = tmp_path / "own.toml"
    assert main(["export", str(posterior), "-o", str(own)]) == 0
    draws = files.read_tree(posterior, POSTERIOR)["posterior"].to_dataset()
    name = "Two shots at a thin plate with round holes"
    entry = Catalogue.of(own).named(Material, name)
    low, middle, high = np.quantile(draws["resistance"].values, [0.05, 0.5, 0.95])
    assert (entry.resistance_low, entry.resistance, entry.resistance_high) == pytest.approx((low, middle, high))
    assert entry.shear_coefficient == pytest.approx(np.median(draws["shear_coefficient"].values))
    assert entry.thickness_high == 3e-3
    assert re.match(r"2 shots; 90 %: Y .* GPa, η .*; missed \(rms\): residual velocity \[m/s\]: ", entry.found[name])
    assert entry.weakening is None
    weaker = own.read_text(encoding="utf-8") + "[material.weakening]\ndegradation = 0.7\n"
    own.write_text(weaker, encoding="utf-8")
    plate = with_materials({"plate": {"thickness": 3e-3, "material": name}}, Catalogue.of(own), "test")["plate"]
    assert (plate["resistance"], plate["degradation"]) == (pytest.approx(middle), 0.7)
    assert main(["catalogue", "--file", str(own), name]) == 0
    assert "degradation 0.7" in capsys.readouterr().out
