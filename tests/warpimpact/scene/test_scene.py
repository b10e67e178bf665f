"""Scenes, plates and copies of them: what they take, what they refuse, and that copies are validated anew."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

import warpimpact
from warpimpact import Campaign, FastLaw, Interaction, Layer, Record, Scene, run, simulate
from warpimpact.campaign.campaign import CampaignError
from warpimpact.scene import (
    CirclePattern,
    Hits,
    Impact,
    Plate,
    PolynomialCore,
    ProfileCore,
    SlotPattern,
    Target,
    make_shots,
)

from ...options import CPU

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
PLATE = Plate(thickness=4e-3, resistance=2.6e9)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"plate": PLATE}, 'got the unknown key "plate"; allowed are core, target, interaction, record'),
        ({"record": {"standoffs": ["130 mm", "50 mm"]}}, "got 0.05 m after 0.13 m, but stand-offs must increase"),
        (
            {"record": {"standoffs": ["10 mm"]}},
            "got record.standoffs of 0.01 m, but a core of this size is certain to be out of the target only from 0.01",
        ),
        (
            {"core": CORE.model_copy(update={"centre_of_mass": 15e-3}), "record": {"bending": True}},
            "output.bending = true cannot be combined with core.centre_of_mass: it needs the mass of every slice",
        ),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Scene(**{"core": CORE, "target": PLATE} | changes)
    assert complaint in str(caught.value)


def test_simulate_gives_what_a_campaign_of_the_same_scene_gives() -> None:
    assert warpimpact.simulate is simulate
    standoffs, numerics = (0.05, 0.13), FastLaw(level=0)
    impact, hits = Impact(velocity=825.0, obliquity=12), Hits(count=4)
    campaign = Campaign(title="", core=CORE, plate=PLATE, impact=impact, hits=hits, numerics=numerics)
    scene = Scene(core=CORE, target=PLATE, record=Record(standoffs=standoffs))
    outcomes = simulate(scene, make_shots(impact, hits, PLATE), method=numerics, device="cpu")
    dataset = run(campaign, options=CPU)
    np.testing.assert_array_equal(np.degrees(outcomes.tilt).astype(np.float32), dataset["tilt"])
    np.testing.assert_array_equal(outcomes.residual_velocity, dataset["residual_velocity"])
    assert campaign.scene.core == CORE
    assert campaign.scene.target == scene.target
    assert campaign.scene.record.standoffs == standoffs
    bare = simulate(Scene(core=CORE, target=PLATE), make_shots(impact, hits, PLATE), method=numerics, device="cpu")
    assert bare.tilt.shape == (4, 0)


def test_the_plate_is_layer_0() -> None:
    behind = Layer(thickness="8 mm", resistance="1 GPa", gap="1 cm")
    target = Scene(core=CORE, target=(PLATE, PLATE, behind)).target
    assert target.gaps == (0.0, 0.0, 0.01)
    assert [place for place, _ in target.named] == ["plate", "layer 1", "layer 2"]
    with pytest.raises(ValueError, match=r"gap = 0.01 m .* of the first layer"):
        Target(layers=(behind,))


STEEL = {"thickness": "4 mm", "resistance": "2600 MPa"}


def test_a_weight_gives_a_plate_its_thickness() -> None:
    holes = CirclePattern(diameter="5 mm", spacing="10 mm")
    plate = Plate(areal_density="25 kg/m^2", resistance=1e9, pattern=holes)
    assert plate.areal_density == pytest.approx(25.0, rel=1e-14)
    assert plate == Plate(thickness=plate.thickness, resistance=1e9, pattern=holes)
    assert Plate.model_validate_json(plate.model_dump_json()) == plate
    for given, complaint in (({"areal_density": 0}, "greater than 0"), (STEEL, "thickness cannot be combined with")):
        with pytest.raises(ValidationError, match=complaint):
            Plate(**{"areal_density": 25, "resistance": 1e9, **given})


SLOTS = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
RIMMED = {"size": ["50 mm", "44 mm"]}


def test_a_rim_is_as_far_as_the_whole_holes_next_to_it() -> None:
    assert Plate(**STEEL, pattern=SLOTS, size=["43 mm", "40 mm"]).ligament == pytest.approx(3.5e-3, rel=1e-9)
    assert Plate(**STEEL, **RIMMED).ligament == math.inf


def test_the_rim_of_a_finite_plate_is_an_edge() -> None:
    y, z = np.array([[0.0, 24e-3, 26e-3, 28e-3], [0.0, 20e-3, 0.0, 26e-3]])
    solid = Plate(**STEEL, size=["50 mm", "44 mm"])
    assert solid.edge_distance(y, z) == pytest.approx([22e-3, 1e-3, -1e-3, -5e-3])
    holed = Plate(**STEEL, pattern=SLOTS, **RIMMED).edge_distance(y, z)
    assert holed == pytest.approx([-2e-3, -2e-3, -1e-3, -5e-3], abs=5e-6)  # of chords
    assert np.isnan(Plate(**STEEL).edge_distance(y, z)).all()


def test_hits_cover_the_cell_or_all_of_a_finite_plate() -> None:
    plate, impact = Plate(**STEEL, pattern=SLOTS, size=["48 mm", "32 mm"]), Impact(velocity=825)
    for area, extent in (("cell", (16e-3, 16e-3)), ("plate", (48e-3, 32e-3))):
        shots = make_shots(impact, Hits(count=4096, area=area), plate)
        assert (np.ptp(shots.hit_y), np.ptp(shots.hit_z)) == pytest.approx(extent, rel=2e-3)
    solid = plate.is_solid(shots.hit_y, shots.hit_z)
    assert solid.mean() == pytest.approx(1 - plate.open_area, abs=5e-3)
    with pytest.raises(ValueError, match=r'hits.area = "plate" needs size of the plate: only a'):
        make_shots(impact, Hits(count=4, area="plate"), Plate(**STEEL, pattern=SLOTS))


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
MM = 1e-3
ROUND = CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3))
HOLED = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, pattern=ROUND)

HEAD = """\
title = "a test"
[core]
shape = "profile"
file = "profile.csv"
mass = "2.6 g"
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
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "1.5 g" }
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
