"""The solid plate of equal areal density, computed into the same file."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, Numerics, open_result
from warpimpact.kernels.status import Status
from warpimpact.results import files
from warpimpact.results.references import references_of
from warpimpact.runs.run import run, run_to_file

SLOTTED_PLATE = (Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
SMALL = SLOTTED_PLATE.replace('"standard"', '"draft"').replace("count = 4096", "count = 600")
PATTERN = SMALL[SMALL.index("[plate.pattern]") : SMALL.index("[impact]")]
pytestmark = pytest.mark.usefixtures("small_chunks")


def computed(tmp_path: Path, *changes: tuple[str, str]) -> xarray.Dataset:
    text = SMALL
    for change in changes:
        assert change[0] in text
        text = text.replace(*change)
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    run_to_file(Campaign.from_toml(tmp_path / "a.toml"), tmp_path / "a.nc", device="cpu")
    return files.read(tmp_path / "a.nc")


def test_a_shot_that_does_not_scatter_is_fired_once_and_meets_the_closed_form(tmp_path: Path) -> None:
    """Without friction and degradation the work is Y·h·π R²."""
    no_loss = [("shear_coefficient = 0.05", "shear_coefficient = 0.0"), ("degradation = 0.8 ", "degradation = 1.0 ")]
    dataset = computed(tmp_path, *no_loss, ('fidelity = "draft"', 'fidelity = "reference"'), ("= 600", "= 4"))
    solid = references_of(dataset)["solid"]
    assert solid.sizes["hit"] == 1
    campaign = Campaign.from_toml(tmp_path / "a.toml")
    thickness = 4e-3 * (1.0 - dataset.attrs["open_area"])
    work = 2.6e9 * thickness * math.pi * campaign.core.max_radius**2
    exact = math.sqrt(825.0**2 - 2.0 * work / 4e-3)
    assert float(solid["residual_velocity"][0]) == pytest.approx(exact, abs=0.5)
    assert float(solid["tilt"][0, 1]) == pytest.approx(0.0, abs=0.01)
    assert int(solid["status"][0]) == Status.PERFORATED


@pytest.mark.parametrize(
    ("change", "shots"),
    [
        (('"825 m/s" ', '{ distribution = "uniform", low = 800, high = 850 } '), 256),
        (("[plate.pattern]", 'size = ["80 mm", "80 mm"]\n\n[plate.pattern]'), 256),
        (('["50 mm", "130 mm"]', '["50 mm", "130 mm"]\nsolid_reference = false'), 0),
        ((PATTERN, ""), 0),
    ],
    ids=["scatter", "rim", "off", "solid already"],
)
def test_it_takes_the_shots_of_the_first_shard_if_they_differ_and_none_if_not_requested(
    tmp_path: Path, change: tuple[str, str], shots: int
) -> None:
    references = references_of(computed(tmp_path, change))
    assert {name: one.sizes["hit"] for name, one in references.items() if name != "finer"} == (
        {"solid": shots} if shots else {}
    )


def test_it_is_a_campaign_of_its_own(tmp_path: Path) -> None:
    dataset = computed(
        tmp_path, ('"825 m/s" ', '{ distribution = "uniform", low = 700, high = 850 } '), ("= 600", "= 32")
    )
    campaign = Campaign.from_toml(tmp_path / "a.toml")
    level = Numerics.model_validate_json(dataset.attrs["resolution"])
    alone = run(campaign.model_copy(update={"numerics": level}).solid(), device="cpu")
    np.testing.assert_array_equal(references_of(dataset)["solid"]["residual_velocity"], alone["residual_velocity"])
    neighbour = references_of(run(campaign, references=True, device="cpu"))
    np.testing.assert_array_equal(neighbour["solid"]["residual_velocity"], alone["residual_velocity"])
    with pytest.raises(files.ResultError, match="group"):
        open_result(tmp_path / "a.nc", group="base_alone")
