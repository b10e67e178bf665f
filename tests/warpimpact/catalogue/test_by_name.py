"""The catalogue in Python: a plate by its material has the resistance that a campaign gives it."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from warpimpact import Campaign, Layer, Plate, material, threat

CIRCLES = {"shape": "circle", "diameter": "9 mm", "spacing": ["12 mm", "12 mm"]}


@pytest.mark.parametrize("size", [{"thickness": "6 mm"}, {"areal_density": "20 kg/m^2", "pattern": CIRCLES}])
def test_a_plate_of_a_material_is_that_of_a_campaign(size: dict[str, Any]) -> None:
    base = {"material": "aa6061-t651", "thickness": "20 mm", "gap": "100 mm"}
    tables = {
        "title": "by name",
        "core": {"threat": "7.62 AP M2"},
        "plate": {"material": "hha class 1"} | size,
        "layer": [base],
        "impact": {"obliquity": "30 deg"},
        "hits": {"count": 4},
    }
    campaign = Campaign.from_text(json.dumps(tables), name="by name", folder=Path())
    shot: dict[str, Any] = {"threat": threat(".30 AP M2"), "obliquity": "30 deg"}
    assert campaign.plate == Plate(material="HHA Class 1", **size, **shot)
    assert campaign.layer == (Layer(**base, **shot),)
    assert (campaign.plate.material, campaign.core.threat) == ("HHA Class 1", ".30 AP M2")
    assert campaign.core == threat(".30 AP M2").core
    assert campaign.impact.velocity == threat(".30 AP M2").velocity


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (
            {},
            "threat and obliquity must be given: the resistance of HHA Class 1 depends on threat, thickness and angle",
        ),
        ({"threat": "7.62x39 BZ", "obliquity": 0}, "does not know the core"),
    ],
)
def test_a_plate_of_a_material_says_what_it_needs(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        Plate(material="HHA Class 1", thickness="6 mm", **given)


def test_entries_are_listed() -> None:
    assert ".30 AP M2" in list(threat)
    assert len(material) == len([*material])
    assert "HHA Class 1: 145 limit velocities" in repr(material)
    assert "HHA" not in material  # which several entries are
    with pytest.raises(ValueError, match=r'no velocity of "\.50 AP M2"'):
        _ = threat(".50 AP M2").velocity
