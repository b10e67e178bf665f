"""Values that are possible but probably not meant: a warning that names value, unit and the likely slip."""

import warnings
from pathlib import Path

import pytest

from warpimpact import Campaign
from warpimpact.campaign.plates import read_plates
from warpimpact.cli import main
from warpimpact.scene.plausible import Implausible
from warpimpact.studies.sweep import read_sweep

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
TEXT = """\
title = "a test"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "4 g" }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[impact]
velocity = "825 m/s"
[hits]
sampling = "list"
file = "hits.csv"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "hits.csv").write_text("hit_y,hit_z,velocity\n0.001,0.002,820\n0.03,0,810\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def warned(text: str, folder: Path) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Campaign.from_text(text, name="text", folder=folder)
    return [str(warning.message) for warning in caught if warning.category is Implausible]


@pytest.mark.parametrize("path", sorted(CAMPAIGNS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_campaigns_are_plausible(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if path.stem == "base_armour":  # its cores were turned by a plate before
            warnings.filterwarnings("ignore", "hits.file, column yaw: read as 85°", Implausible)
        text = path.read_text(encoding="utf-8")
        read = read_plates if "[[plate]]" in text else read_sweep if "[sweep]" in text else Campaign.from_toml
        read(path)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ('thickness = "4 mm"', "thickness = 4"),
            'plate.thickness: read as 4 m, but 0.1 to 200 mm is usual; "4 mm" was probably meant, which needs its unit',
        ),
        (
            ('mass = "4 g"', "mass = 4"),
            'core: mass: read as 4 kg, but 0.05 to 1000 g is usual; "4 g" was probably meant, which needs its unit',
        ),
        (
            ('resistance = "2600 MPa"', "resistance = 2600"),
            'plate.resistance: read as 2600 Pa, but 0.01 to 20 GPa is usual; "2600 MPa" was probably meant, '
            "which needs its unit",
        ),
        (
            ('velocity = "825 m/s"', "velocity = 0.825"),
            'impact.velocity: read as 0.825 m/s, but 20 to 3000 m/s is usual; "0.825 km/s" was probably meant, '
            "which needs its unit",
        ),
        (
            ('velocity = "825 m/s"', 'velocity = "825 m/s"\nyaw = "70 deg"'),
            "impact.yaw: read as 70°, but up to 60° is usual",
        ),
    ],
)
def test_an_implausible_value_is_told(change: tuple[str, str], sentence: str, folder: Path) -> None:
    assert not warned(TEXT, folder)
    assert warned(TEXT.replace(*change), folder) == [sentence]


def test_a_hit_list_in_millimetres_is_told(folder: Path) -> None:
    (folder / "hits.csv").write_text("hit_y,hit_z,velocity\n1.51,0,820\n3.49,-4.76,810\n")
    assert warned(TEXT, folder) == [
        'hits.file, column hit_y: read as 3.49 m, but up to 80 mm is usual; "3.49 mm" was probably meant, but a '
        "hit list is in SI",
        'hits.file, column hit_z: read as -4.76 m, but up to 80 mm is usual; "-4.76 mm" was probably meant, but a '
        "hit list is in SI",
    ]
    (folder / "hits.csv").write_text("hit_y,hit_z,velocity\n0.001,0,820\n0.001,0,0.81\n")
    assert [sentence[:50] for sentence in warned(TEXT, folder)] == [
        "hits.file, column velocity: read as 0.81 m/s, but "
    ]


def test_the_command_says_it_once_and_goes_on(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "a.toml").write_text(TEXT.replace('thickness = "4 mm"', "thickness = 4"))
    for _ in range(2):
        assert main(["plate", "a.toml", "--overwrite"]) == 0
        shown = capsys.readouterr()
        assert shown.err == (
            "warpimpact: warning: plate.thickness: read as 4 m, but 0.1 to 200 mm is usual; "
            '"4 mm" was probably meant, which needs its unit\n'
        )
        assert "a test" in shown.out


def test_a_campaign_made_in_python_is_told_too(folder: Path) -> None:
    campaign = Campaign.from_text(TEXT, name="text", folder=folder)
    with pytest.warns(Implausible, match="plate.thickness: read as 4 m"):
        campaign.model_copy(update={"plate": campaign.plate.model_copy(update={"thickness": 4})})
