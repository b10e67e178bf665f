"""Campaign files: what is read, one sentence for each mistake, warnings of slips, and the JSON schema."""

import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from scipy.integrate import quad
from scipy.optimize import brentq

from warpimpact import Campaign, CampaignError
from warpimpact.campaign.campaign import read_plates
from warpimpact.campaign.evidence import outside_tested_range
from warpimpact.campaign.plausible import effective_thickness
from warpimpact.campaign.schema import campaign_schema
from warpimpact.errors import Implausible
from warpimpact.studies.sweep import read_sweep

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"

UNCOMMENTED = (line.partition("#")[0].rstrip() for line in SLOTTED_PLATE.read_text(encoding="utf-8").splitlines())
CAMPAIGN = "".join(f"{line}\n" for line in UNCOMMENTED if line)
SLOT = CAMPAIGN[CAMPAIGN.index("[plate.pattern]") : CAMPAIGN.index("[impact]")]
SAMPLING = 'sampling = "sobol"\ncount = 4096'

MISTAKES = {
    "missing key": ('thickness = "4 mm"\n', "", "plate.thickness: is missing, but must be given"),
    "misspelt table": ("[numerics]", "[numeric]", 'got the unknown key "numeric"; did you mean "numerics"?'),
    "unknown shape": (
        'shape = "slot"',
        'shape = "slit"',
        "plate.pattern.shape: got \"slit\", but it must be one of 'slot', 'circle', 'triangle', "
        "'square', 'hexagon', 'ellipse', 'none', 'polygons'",
    ),
    "wrong unit": (
        '"4 mm"\nres',
        '"4 kg"\nres',
        'plate.thickness: got "4 kg", which is not a length; give a number in m or a string such as "4 mm"',
    ),
    "hit list with a bad row": (
        SAMPLING,
        'sampling = "list"\nfile = "bad_hits.csv"',
        'hits: bad_hits.csv, line 3: hit_z: got "oops", which does not begin with a number',
    ),
}


@pytest.mark.parametrize(("right", "wrong", "sentence"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_shown_in_one_sentence(tmp_path: Path, right: str, wrong: str, sentence: str) -> None:
    assert CAMPAIGN.count(right) == 1
    (tmp_path / "bad_hits.csv").write_text("hit_y,hit_z\n0,0\n0,oops\n")
    path = tmp_path / "wrong.toml"
    path.write_text(CAMPAIGN.replace(right, wrong))
    with pytest.raises(CampaignError) as caught:
        Campaign.from_toml(path)
    assert str(caught.value) == f"{path}: {sentence.format(folder=tmp_path)}"


def test_hits_too_far_to_be_exact_are_refused(tmp_path: Path) -> None:
    """Cells of 0.02 mm have 32-bit numbers up to 43 km from the origin; a million metres were off by 55 m/s."""
    text = CAMPAIGN.replace(SAMPLING, 'sampling = "list"\nfile = "hits.csv"')
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0,0\n99,-99\n", encoding="utf-8")
    assert len(Campaign.from_text(text, name="a", folder=tmp_path).sampler()) == 2
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0,0\n0,-101\n", encoding="utf-8")
    with pytest.raises(CampaignError, match="but they are exact up to 100 m; a pattern repeats"):
        Campaign.from_text(text, name="a", folder=tmp_path)


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
TEXT = """\
title = "a test"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "1.5 g" }
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
    assert text.startswith("# ")  # its question


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
            'plate.thickness: read as 0.4 m, but 0.1 to 60 mm is usual; "0.4 mm" was probably meant, which needs its '
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
        (('"5 mm"', '"7.99 mm"'), "text: plate.pattern: smallest ligament: read as 1e-05 m, but 0.05 to 2000 mm is"),
        (('"circle",', '"circle", rotation = 500,'), "text: plate.pattern.rotation: read as 500°, but up to 360° is"),
    ],
)
def test_what_nothing_has_is_refused_unless_it_is_allowed(change: tuple[str, str], sentence: str, folder: Path) -> None:
    with pytest.raises(CampaignError) as refused:
        warned(TEXT.replace(*change), folder)
    assert str(refused.value).startswith(sentence)
    assert warned("allow_implausible = true\n" + TEXT.replace(*change), folder)


@pytest.mark.parametrize(
    "change",
    [
        ('thickness = "4 mm"', 'thickness = "600 mm"'),
        ("[impact]", '[[layer]]\nthickness = "600 mm"\nresistance = "2 GPa"\n[impact]'),
        ('velocity = "825 m/s"', 'velocity = "2.5 m/s"'),
        ('"5 mm", spacing = ["8 mm", "8 mm"]', '"600 mm", spacing = ["800 mm", "800 mm"]'),
    ],
)
def test_a_value_with_a_unit_does_not_lack_one(change: tuple[str, str], folder: Path) -> None:
    assert change[0] in TEXT
    sentences = warned(TEXT.replace(*change), folder)
    assert sentences
    assert not [one for one in sentences if "probably meant" in one or "is usual" not in one]


def test_a_plate_that_no_small_arm_passes_is_doubted(folder: Path) -> None:
    thick = TEXT.replace('"4 mm"', '"85 mm"')
    assert warned(thick, folder) == ["plate.thickness: read as 0.085 m, but 0.1 to 60 mm is usual"]
    light = thick.replace("[plate]", '[plate]\ndensity = "2700 kg/m^3"')
    assert not warned(light, folder)
    (sentence,) = warned(light.replace('"85 mm"', '"110 mm"'), folder)
    assert sentence == "plate.thickness: read as 0.11 m, but 0.1 to 100 mm is usual"
    with pytest.warns(Implausible):
        outside = outside_tested_range(Campaign.from_text(thick, name="text", folder=folder))
    assert any(one.startswith("thickness (plate): 14.2 calibres") for one in outside)


def test_a_core_is_as_heavy_as_its_material(folder: Path) -> None:
    mass, core = 'mass = "1.5 g"', TEXT.splitlines()[1]
    with pytest.raises(CampaignError) as refused:
        warned(TEXT.replace(mass, 'mass = "3 g"'), folder)  # of the bullet
    assert str(refused.value) == (
        "text: core.mass: got 3 g for a core of 188.5 mm³, which is 15915 kg/m³, but 5495 to 10205 kg/m³ is allowed: "
        "steel has 7850; give the mass of the core, without jacket and filler, or for another material core.density in "
        "place of core.mass; allow_implausible = true has it computed as it is"
    )
    assert not warned("allow_implausible = true\n" + TEXT.replace(mass, 'mass = "3 g"'), folder)
    assert not warned(TEXT.replace(mass, 'density = "18 g/cm^3"'), folder)
    carbide = TEXT.replace(core, 'core = { threat = "14.5 mm BS41" }')
    assert not warned(carbide, folder)
    with pytest.raises(CampaignError, match=r"10395 to 19305 kg/m³ is allowed: the core of 14.5 mm BS41 has 14850"):
        warned(carbide.replace("BS41", 'BS41", mass = "64 g'), folder)
    (folder / "hits.csv").write_text("hit_y,hit_z,mass\n0,0,0.0015\n0,0,0.003\n")
    with pytest.raises(CampaignError, match=r"hits.file, column mass: got 3 g for a core of"):
        warned(TEXT, folder)


EXAMPLES = sorted((Path(__file__).parents[3] / "campaigns").glob("*.toml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return campaign_schema()


@pytest.fixture
def campaign() -> dict[str, Any]:
    text = (EXAMPLES[0].parent / "slotted_plate.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def complaints(schema: dict[str, Any], campaign: dict[str, Any]) -> list[str]:
    return [error.json_path for error in Draft202012Validator(schema).iter_errors(campaign)]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_it_takes_the_campaigns(schema: dict[str, Any], path: Path) -> None:
    assert complaints(schema, tomllib.loads(path.read_text(encoding="utf-8"))) == []


def test_every_key_says_what_it_means(schema: dict[str, Any]) -> None:
    tables = {"campaign": schema, **schema["$defs"]}
    silent = [
        f"{table}.{key}"
        for table, one in tables.items()
        for key, shown in one.get("properties", {}).items()
        if table != "Scatter" and len(shown.get("description", "")) < 5
    ]
    assert not silent, f"say what these keys mean, under Attributes in the docstring of their model: {silent}"
