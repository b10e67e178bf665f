"""Copies with changes are values like any other: validated, computed anew, and with a text of their own."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from warpimpact import Campaign, CirclePattern, Interaction, Plate, SlotPattern
from warpimpact.campaign.campaign import CampaignError
from warpimpact.scene import Hits, PolynomialCore, ProfileCore

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
MM = 1e-3
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
ROUND = CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3))
PLATE = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, pattern=ROUND)

HEAD = """\
title = "a test"
[core]
shape = "profile"
file = "profile.csv"
mass = "4 g"
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
degradation = 0.8
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[numerics]
fidelity = "draft"
[output]
standoffs = ["50 mm", "130 mm"]
solid_reference = false
"""
STRAIGHT = '[impact]\nvelocity = "825 m/s"\n'
LISTED = STRAIGHT + '[hits]\nsampling = "list"\nfile = "hits.csv"\n'
SCATTERED = """\
[impact]
velocity = { distribution = "normal", mean = "820 m/s", std = "10 m/s" }
yaw = { distribution = "uniform", low = "0 deg", high = "2 deg" }
[hits]
seed = 7
[stop]
quantity = "P(tilt@130mm > 30 deg)"
half_width = 0.01
max_count = 64
"""
PLAIN = STRAIGHT + "[hits]\ncount = 6\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that HEAD and LISTED name; its path is relative, as users write it."""
    place = tmp_path / "campaigns"
    place.mkdir()
    (place / "profile.csv").write_text("s,r\n0,0\n0.012,0.003\n0.02,0.003\n")
    (place / "hits.csv").write_text("hit_y,hit_z,velocity\n0.001,0.002,820\n0.002,0.001,810\n0.0,0.0,800\n")
    monkeypatch.chdir(tmp_path)
    return Path("campaigns")


def read(folder: Path, text: str, **options: Any) -> Campaign:
    (folder / "a.toml").write_text(HEAD + text)
    return Campaign.from_toml(folder / "a.toml", **options)


def thinner(campaign: Campaign) -> Campaign:
    return campaign.model_copy(update={"plate": campaign.plate.model_copy(update={"thickness": "3 mm"})})


def test_nothing_computed_goes_along() -> None:
    assert CORE.mass_properties.mass == 4e-3
    assert CORE.model_copy(update={"mass": 8e-3}).mass_properties.mass == 8e-3
    slots = SlotPattern(length=12 * MM, width=4 * MM, spacing=(8 * MM, 16 * MM))
    assert slots.ligament() == pytest.approx(4 * MM)
    assert slots.model_copy(update={"spacing": (10 * MM, 18 * MM)}).ligament() == pytest.approx(6 * MM)


@pytest.mark.parametrize("text", [LISTED, SCATTERED, PLAIN], ids=["listed", "scattered", "plain"])
def test_the_text_of_a_changed_campaign_gives_it_again(
    folder: Path, text: str, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = read(folder, text)
    changed = thinner(campaign).model_copy(update={"interaction": Interaction(quadratic=1.0)})
    assert campaign.text == HEAD + text
    assert changed != campaign
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.chdir(elsewhere)
    again = Campaign.from_text(changed.text, name="text", folder=elsewhere)
    assert again == changed
    assert again.plate.thickness == 3e-3
    assert isinstance(again.core, ProfileCore)
    for name in ("hit_y", "hit_z", "velocity", "yaw"):
        expected = getattr(changed.sampler().shots(0, 6), name)
        np.testing.assert_array_equal(getattr(again.sampler().shots(0, 6), name), expected)


def test_a_campaign_changed_to_what_cannot_be_is_refused(folder: Path) -> None:
    campaign = read(folder, SCATTERED)
    with pytest.raises(ValidationError, match=r"\[stop\] cannot be combined with hits.sampling"):
        campaign.model_copy(update={"hits": Hits(sampling="grid", count=64)})
    with pytest.raises(ValidationError, match=r"got output.standoffs of 0.001 m"):
        read(folder, PLAIN).model_copy(update={"output": {"standoffs": ["1 mm"]}})
    changed = thinner(read(folder, LISTED))
    (folder / "hits.csv").unlink()
    with pytest.raises(CampaignError, match=r"text: hits.file: got .*hits.csv\", but there is no file"):
        Campaign.from_text(changed.text, name="text", folder=folder)


ANGLES = """\
title = "angles"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "4 g" }
stop = { quantity = "mean(tilt@130mm)", half_width = 2, max_count = 64 }
hits = { seed = 1 }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
[plate.pattern]
shape = "square"
side = "2 mm"
spacing = ["8 mm", "8 mm"]
rotation = 20
holes = [[0, 0, 10], ["3 mm", "3 mm", "0.2 rad"]]
[impact]
velocity = 825
obliquity = 30
azimuth = "0.5 rad"
pitch = { distribution = "normal", mean = 1, std = 0.5 }
yaw = { distribution = "uniform", low = 0, high = 4 }
"""


def test_numbers_of_angles_are_degrees_and_their_text_gives_them_again() -> None:
    campaign = Campaign.from_text(ANGLES, name="angles", folder=Path())
    assert campaign.impact.obliquity == pytest.approx(np.radians(30))
    assert campaign.impact.azimuth == 0.5
    assert campaign.plate.pattern.rotation == pytest.approx(np.radians(20))
    assert [hole.rotation for hole in campaign.plate.pattern.holes] == pytest.approx([np.radians(10), 0.2])
    assert campaign.stop.half_width == pytest.approx(np.radians(2))
    assert campaign.scatter.pitch.std == pytest.approx(np.radians(0.5))
    assert campaign.scatter.yaw.high == pytest.approx(np.radians(4))
    assert (campaign.impact.pitch, campaign.impact.yaw) == pytest.approx((np.radians(1), np.radians(2)))  # the medians
    changed = campaign.model_copy(update={"plate": campaign.plate.model_copy(update={"thickness": 3e-3})})
    again = Campaign.from_text(changed.text, name="text", folder=Path())
    assert again == changed
    assert again.plate.pattern == campaign.plate.pattern
    assert again.stop == campaign.stop
    for model in (campaign.impact, campaign.plate.pattern, campaign.scatter, campaign.stop, campaign.numerics):
        assert model.model_copy() == model
        assert type(model).model_validate(model.model_dump()) == model
