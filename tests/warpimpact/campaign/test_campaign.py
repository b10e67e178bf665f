"""Campaign files: what is read, and one sentence for each mistake: file, field, value, cure."""

from pathlib import Path

import pytest

from warpimpact import Campaign, Hits, Impact, Plate
from warpimpact.campaign.campaign import CampaignError
from warpimpact.scene import PolynomialCore

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
        'hits: bad_hits.csv, line 3: hit_z: got "oops", but it must be a finite number',
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


def test_file_names_count_from_the_campaign_file(tmp_path: Path) -> None:
    (tmp_path / "profile.csv").write_text("s,r\n0,0\n0.02,0.003\n")
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0.001,0.002\n")
    core = CAMPAIGN[CAMPAIGN.index("[core]") : CAMPAIGN.index("[plate]")]
    text = CAMPAIGN.replace(core, '[core]\nshape = "profile"\nfile = "profile.csv"\ndensity = 7850\n')
    text = text.replace(SAMPLING, 'sampling = "list"\nfile = "hits.csv"')
    (tmp_path / "campaign.toml").write_text(text)
    campaign = Campaign.from_toml(tmp_path / "campaign.toml")
    assert campaign.core.length == 0.02
    assert campaign.hits.listed["hit_z"].tolist() == [0.002]


def test_the_count_can_be_given_instead(tmp_path: Path) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN)
    assert Campaign.from_toml(path, count=3).hits.count == 3
    with pytest.raises(CampaignError, match=r"hits\.count: got 0"):
        Campaign.from_toml(path, count=0)


def test_a_campaign_needs_no_file() -> None:
    campaign = Campaign(
        title="by hand",
        core=PolynomialCore(coefficients=[3e-3], length="20 mm", density="7850 kg/m^3"),
        plate=Plate(thickness="4 mm", resistance="2.6 GPa"),
        impact=Impact(velocity="825 m/s"),
        hits=Hits(count=4),
    )
    assert campaign.output.standoffs == (0.05, 0.13)
    assert Campaign.model_validate_json(campaign.text) == campaign


def test_hits_too_far_to_be_exact_are_refused(tmp_path: Path) -> None:
    """Cells of 0.02 mm have 32-bit numbers up to 43 km from the origin; a million metres were off by 55 m/s."""
    text = CAMPAIGN.replace(SAMPLING, 'sampling = "list"\nfile = "hits.csv"')
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0,0\n99,-99\n", encoding="utf-8")
    assert len(Campaign.from_text(text, name="a", folder=tmp_path).sampler()) == 2
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0,0\n0,-101\n", encoding="utf-8")
    with pytest.raises(CampaignError, match="but they are exact up to 100 m; a pattern repeats"):
        Campaign.from_text(text, name="a", folder=tmp_path)
