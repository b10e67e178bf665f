"""Rankings under what nobody measured: what each assumption changes, and what is said of the verdicts."""

import json
from pathlib import Path
from typing import Any

import pytest

from warpimpact import Campaign
from warpimpact.campaign.assumptions import AS_GIVEN, alternatives
from warpimpact.cli import main
from warpimpact.studies.assumptions import judged, judged_view
from warpimpact.view.view import text_of

SLOTS = {"shape": "slot", "length": "12 mm", "width": "4 mm", "spacing": ["8 mm", "16 mm"], "staggered": True}
WEAK = {"shear_coefficient": 0.05, "degradation": 0.8}
PLATE: dict[str, Any] = {"thickness": "4 mm", "resistance": "2.6 GPa", "pattern": SLOTS} | WEAK
TABLES: dict[str, Any] = {
    "title": "assumed",
    "core": {"shape": "ogive", "diameter": "6 mm", "crh": 3.0, "length": "27 mm", "mass": "4 g"},
    "plate": PLATE,
    "impact": {"velocity": "825 m/s"},
    "hits": {"count": 32},
    "numerics": {"level": 0},
    "output": {"standoffs": ["130 mm"]},
}


def campaign(**changes: Any) -> Campaign:
    return Campaign.from_text(json.dumps(TABLES | changes), name="assumed", folder=Path())


def changed(one: Campaign, other: Campaign) -> set[str]:
    """Fields of campaign, plate, interaction and impact that differ."""
    parts = {"plate": (one.plate, other.plate), "interaction": (one.interaction, other.interaction)}
    parts["impact"] = (one.impact, other.impact)
    return {
        f"{part}.{name}"
        for part, (before, after) in parts.items()
        for name in type(before).model_fields
        if getattr(before, name) != getattr(after, name)
    }


def test_each_assumption_changes_what_it_says_and_nothing_else() -> None:
    given = campaign()
    found = {name: changed(given, plates["a"]) for name, plates in alternatives({"a": given}).items()}
    reach = {"plate.degradation_length", "plate.degradation_depth"}
    assert found == {
        AS_GIVEN: set(),
        "Y at its low end": {"plate.resistance"},
        "Y at its high end": {"plate.resistance"},
        "no weakening (β = 1)": {"plate.degradation"},
        "weakening reaches half as far": reach,
        "weakening reaches twice as far": reach,
        "friction η = 0": {"plate.shear_coefficient"},
        "friction η = 0.1": {"plate.shear_coefficient"},
        "onset κ = 0": {"interaction.onset"},
        "onset κ = 0.02": {"interaction.onset"},
        "5° more oblique": {"impact.obliquity"},
        "2° of yaw": {"impact.yaw"},
    }


def test_what_a_campaign_does_not_have_is_not_assumed() -> None:
    solid = {"thickness": "4 mm", "resistance": "2.6 GPa"}
    names = alternatives({"a": campaign(plate=solid)})
    assert not any("weakening" in name for name in names)
    holed = alternatives({"a": campaign(plate=PLATE | {"degradation": 1.0})})
    assert holed["weakening (β = 0.8 in 1 µs)"]["a"].plate.degradation == 0.8
    drawn = {"distribution": "normal", "mean": "2.6 GPa", "std": "0.1 GPa"}
    assert "Y at its low end" not in alternatives({"a": campaign(plate=PLATE | {"resistance": drawn})})
    steep = campaign(impact={"velocity": "825 m/s", "obliquity": "88 deg"})
    assert "5° more oblique" not in alternatives({"a": steep})
    assert AS_GIVEN in alternatives({"a": campaign(numerics={"scheme": "nodal"})})
    both = alternatives({"a": campaign(plate=solid), "b": campaign()})["no weakening (β = 1)"]
    assert both["a"] == campaign(plate=solid)  # one that has it already stays


def test_the_catalogue_says_how_far_y_may_be_off() -> None:
    named = campaign(plate={"material": "HHA Class 1", "thickness": "6 mm"}, core={"threat": ".30 AP M2"})
    found = alternatives({"a": named})
    low, high = (found[f"Y at its {end} end"]["a"].plate.resistance for end in ("low", "high"))
    assert low * high == pytest.approx(named.plate.resistance**2)
    assert 1.1 < high / low < 1.3  # less than ± 30 %
    assert found["5° more oblique"]["a"].plate.resistance == named.plate.resistance


def test_verdicts_are_counted_and_what_turns_them_over_is_named() -> None:
    soft = PLATE | {"resistance": "1.2 GPa"}
    plates = {"hard": campaign(), "soft": campaign(plate=soft), "hard again": campaign()}
    told: list[str] = []
    judgement = judged(plates, ["mean(residual_velocity)"], device="cpu", tell=told.append)
    assert told[0] == AS_GIVEN
    assert set(judgement.comparisons) == set(told)
    (measure,) = {pair.measure for pair in judgement.comparisons[AS_GIVEN].differences}
    assert set(judgement.verdicts(measure, "hard", "hard again").values()) == {0}
    assert judgement.verdicts(measure, "hard", "soft") == dict.fromkeys(told, 1)
    assert judgement.verdicts(measure, "soft", "hard again") == dict.fromkeys(told, -1)
    text = text_of(judged_view(judgement))
    assert f"hard is better than soft in {len(told) - 1} of {len(told) - 1} assumptions\n" in text
    assert "hard and hard again cannot be told apart as given\n" in f"{text}\n"


def test_the_command_says_which_verdicts_survive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    thin = PLATE | {"thickness": "2 mm"}
    plates = [{"name": "thick"} | PLATE, {"name": "thin"} | thin]
    Path("plates.json.toml").write_text(json.dumps(TABLES | {"plate": plates}), encoding="utf-8")
    text = ["--measure", "mean(residual_velocity)", "--assumptions"]
    assert main(["compare", "plates.json.toml", "--device", "cpu", *text]) == 0
    first = capsys.readouterr().out
    assert "thick is better than thin in" in first
    assert main(["compare", "thick.nc", "thin.nc", "-o", "again.png", "--device", "cpu", *text]) == 0
    again = capsys.readouterr().out
    assert again[again.index("assumption ") : again.index("again.png")] in first  # from the results alone
