"""Values that are possible but probably not meant: a warning that names value, unit and the likely slip."""

import warnings
from pathlib import Path

import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from warpimpact import Campaign
from warpimpact.campaign.campaign import read_plates
from warpimpact.campaign.plausible import effective_thickness
from warpimpact.campaign.text import CampaignError
from warpimpact.scene.quantities import Implausible
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


@pytest.mark.parametrize("unit", ['degradation_interval = "1 us"', 'degradation_distance = "0.825 mm"'])
def test_a_plate_of_which_less_than_half_resists_is_doubted(unit: str, folder: Path) -> None:
    # h_eff = ∫₀^h β^(x/Δs) dx with Δs = v Δt = 0.825 mm is h/2 at 5.9 mm (docs/model.md §4.8).
    weakened = f"degradation = 0.8\n{unit}\n"

    def plate(thickness: float, weakens: str = weakened) -> str:
        return TEXT.replace('thickness = "4 mm"\n', f"thickness = {thickness!r}\n{weakens}")

    def effective(thickness: float) -> float:
        return float(quad(lambda x: 0.8 ** (x / 0.825e-3), 0.0, thickness)[0])

    most = brentq(lambda thickness: effective(thickness) - 0.5 * thickness, 4e-3, 8e-3)
    assert most == pytest.approx(5.9e-3, abs=0.05e-3)
    (paper,) = Campaign.from_text(plate(4e-3), name="text", folder=folder).target.layers
    assert effective_thickness(paper, 825.0) == pytest.approx(effective(4e-3))
    assert warned(plate(0.999 * most), folder) == []
    (sentence,) = warned(plate(1.001 * most), folder)
    assert sentence.startswith("plate: weakens so fast that only 50% of its 5.9")
    assert sentence.endswith("degradation = 1 suits thicker plates and slower cores")
    assert warned(plate(12e-3, ""), folder) == []
    behind = TEXT.replace("[impact]", f'[[layer]]\nthickness = "8 mm"\nresistance = "2 GPa"\n{weakened}[impact]')
    assert warned(behind, folder)[0].startswith("layer 1: weakens so fast that only 41% of its 8 mm")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ('thickness = "4 mm"', "thickness = 0.4"),
            'plate.thickness: read as 0.4 m, but 0.1 to 200 mm is usual; "0.4 mm" was probably meant, which needs its '
            "unit",
        ),
        (
            ('velocity = "825 m/s"', "velocity = 2.5"),
            'impact.velocity: read as 2.5 m/s, but 20 to 3000 m/s is usual; "2.5 km/s" was probably meant, '
            "which needs its unit",
        ),
    ],
)
def test_an_implausible_value_is_shown(change: tuple[str, str], sentence: str, folder: Path) -> None:
    assert not warned(TEXT, folder)
    assert warned(TEXT.replace(*change), folder) == [sentence]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ('thickness = "4 mm"', "thickness = 6"),
            "text: plate.thickness: read as 6 m, but up to 1000 mm is allowed: no bullet goes through a metre of "
            'anything; "6 mm" was probably meant, which needs its unit; allow_implausible = true has it computed as it '
            "is",
        ),
        (('mass = "4 g"', "mass = 4"), "text: core: mass over volume: read as 2.12207e+07 kg/m^3, but"),
        (('"circle",', '"circle", rotation = 500,'), "text: plate.pattern.rotation: read as 500°, but up to 360° is"),
    ],
)
def test_what_nothing_has_is_refused_unless_it_is_allowed(change: tuple[str, str], sentence: str, folder: Path) -> None:
    with pytest.raises(CampaignError) as refused:
        warned(TEXT.replace(*change), folder)
    assert str(refused.value).startswith(sentence)
    assert warned("allow_implausible = true\n" + TEXT.replace(*change), folder)
