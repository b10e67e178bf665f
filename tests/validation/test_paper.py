"""The paper's two model rows (its Tables 1 and 2) from its own parameters, at hit points that a search found."""

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, run
from warpimpact.analysis.paper import PUBLISHED, check_scene, closest_table, computed_row
from warpimpact.campaign.campaign import CampaignError


@pytest.fixture(scope="module")
def paper_shots() -> xarray.Dataset:
    return run(Campaign.from_toml(Path(str(files("warpimpact.campaigns") / "paper_shots.toml"))), device="cpu")


@pytest.mark.parametrize(("hit", "shot"), list(enumerate(PUBLISHED)))
def test_the_papers_model_rows_are_met(paper_shots: xarray.Dataset, hit: int, shot: str) -> None:
    computed, published = computed_row(paper_shots, hit), PUBLISHED[shot]["paper's model"]
    assert computed.residual_velocity == pytest.approx(published.residual_velocity, abs=3.0)
    assert computed[1:] == pytest.approx(published[1:], abs=3.0)


CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PAPER = (CAMPAIGNS / "paper_shots.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (('thickness = "4 mm"', 'thickness = "6 mm"'), "plate.thickness is 0.006 here and 0.004 there"),
        (("825 m/s", "820 m/s"), "impact.velocity is 820.0 here and 825.0 there"),
        (
            ('sampling = "list"\nfile = "paper_shots.csv"', "count = 2"),
            'hits.sampling is "sobol" here and "list" there',
        ),
        (('"130 mm"]', '"140 mm"]'), "output.standoffs is [0.05, 0.14] here and [0.05, 0.13] there"),
    ],
)
def test_only_the_papers_scene_is_compared_with_the_paper(change: tuple[str, str], difference: str) -> None:
    assert change[0] in PAPER
    other = Campaign.from_text(PAPER.replace(*change), name="other", folder=CAMPAIGNS)
    with pytest.raises(CampaignError) as caught:
        check_scene(other, "other.toml")
    assert str(caught.value).startswith("other.toml: is not the paper's scene")
    assert difference in str(caught.value)


def test_what_the_paper_does_not_publish_may_differ() -> None:
    text = PAPER.replace('"7.1 mm"', '"8 mm"').replace("staggered = false", "staggered = true").replace("1 us", "2 us")
    check_scene(Campaign.from_text(text, name="lattice", folder=CAMPAIGNS), "lattice")


def test_the_closest_hits_of_a_map_are_where_the_paper_says() -> None:
    dataset = run(Campaign.from_toml(CAMPAIGNS / "fitted_plate.toml", count=1024), device="cpu")
    text = closest_table(dataset)
    assert re.search(r"through a hole +experiment +714.0 +24.3 +83.2", text)  # tan² tilt = tan² pitch + tan² yaw
    for place, in_hole in (("in the hole", True), ("in the web", False)):
        (hit,) = re.findall(rf"hit (\d+), {place}", text)
        y, z = (1e3 * abs(float(dataset[name][int(hit)])) for name in ("hit_y", "hit_z"))
        assert _in_a_slot(y, z) is in_hole


def _in_a_slot(y: float, z: float) -> bool:
    """Whether a point of the cell [mm] is in a slot of 4 by 12 mm: at its middle, or at a corner of (8, 16) mm."""
    return any(np.hypot(y - at_y, max(abs(z - at_z) - 4.0, 0.0)) < 2.0 for at_y, at_z in ((0.0, 0.0), (8.0, 8.0)))
