"""Names of the catalogue in a campaign: what they stand for, what overrides it, and what is said of it."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from warpimpact import Campaign
from warpimpact.campaign.evidence import evidence_of, limit_velocity_factors
from warpimpact.campaign.schema import campaign_schema
from warpimpact.campaign.text import CampaignError
from warpimpact.identification.reading import fit_from

OWN = """
[[material]]
name = "plate A"
density = "7800 kg/m^3"
resistance = "2 GPa"
thickness_exponent = 0.5
shear_coefficient = 0.1
quadratic = 0.5
rows = { ".30 AP M2" = 12 }
thickness_low = "3 mm"
thickness_high = "12 mm"
calibres_low = 0.5
calibres_high = 2.0
obliquity_high = "30 deg"

[[material]]
name = "plate B"
density = "2700 kg/m^3"
resistance = "1 GPa"
"""
TABLES: dict[str, Any] = {
    "title": "named",
    "catalogue": "own.toml",
    "core": {"threat": ".30 AP M2"},
    "plate": {"material": "plate A", "thickness": "6.248 mm"},
    "hits": {"count": 4},
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "own.toml").write_text(OWN, encoding="utf-8")
    return tmp_path


def read(folder: Path, **changes: Any) -> Campaign:
    return Campaign.from_text(json.dumps(TABLES | changes), name="named.toml", folder=folder)


def test_names_stand_for_their_values(folder: Path) -> None:
    campaign = read(folder)
    assert campaign.core.max_radius == pytest.approx(3.124e-3)
    assert campaign.core.mass == pytest.approx(5.3e-3)
    assert campaign.impact.velocity == 878.0
    assert (campaign.plate.resistance, campaign.plate.density) == (2e9, 7800.0)
    assert (campaign.plate.shear_coefficient, campaign.interaction.quadratic) == (0.1, 0.5)
    again = Campaign.from_text(campaign.model_dump_json(), name="again", folder=folder)
    assert again == campaign


@pytest.mark.parametrize(
    ("changes", "place", "value"),
    [
        ({"core": {"threat": ".30 AP M2", "mass": "5 g"}}, "core.mass", 5e-3),
        ({"core": {"threat": ".30 AP M2", "density": 8000.0}}, "core.mass", None),
        ({"core": {"threat": ".30 AP M2", "shape": "cone", "diameter": 6e-3, "length": 0.02}}, "core.length", 0.02),
        ({"impact": {"velocity": 700.0}}, "impact.velocity", 700.0),
        ({"core": {"threat": "7.62x39 API BZ", "shape": "cone", "diameter": 6e-3, "length": 0.02, "mass": 2e-3}},
         "impact.velocity", 695.0),
        ({"core": {"threat": "7.62x54R B32 API", "shape": "cone", "diameter": 6e-3, "length": 0.02, "mass": 2e-3,
                   "standard": "VPAM 10"}}, "impact.velocity", 860.0),
        ({"interaction": {"quadratic": 0.0}}, "interaction.quadratic", 0.0),
        ({"plate": TABLES["plate"] | {"resistance": "3 GPa"}}, "plate.resistance", 3e9),
        ({"plate": TABLES["plate"] | {"thickness": "24.992 mm"}}, "plate.resistance", 4e9),  # four calibres
        ({"plate": {"material": "plate A", "areal_density": 7800.0 * 24.992e-3}}, "plate.resistance", 4e9),
    ],
)  # fmt: skip
def test_a_key_beside_a_name_overrides_it(folder: Path, changes: dict[str, Any], place: str, value: Any) -> None:
    table, key = place.split(".")
    found = getattr(getattr(read(folder, **changes), table), key)
    assert found == (None if value is None else pytest.approx(value))


def test_layers_have_materials(folder: Path) -> None:
    law = {"interaction": {"quadratic": 0.5}}
    layer = {"material": "plate B", "thickness": "10 mm", "gap": "5 mm"}
    campaign = read(folder, layer=[layer], **law)
    assert (campaign.layer[0].resistance, campaign.layer[0].density) == (1e9, 2700.0)
    with pytest.raises(CampaignError, match=r"interaction.quadratic: the materials were found with 0.5 \(plate\)"):
        read(folder, layer=[layer])


def test_the_tolerance_of_a_standard_scatters(folder: Path) -> None:
    campaign = read(folder, core={"threat": ".30 AP M2", "velocity_tolerance": True})
    ((name, distribution),) = campaign.scatter.given.items()
    assert name == ("velocity", 0)
    assert (distribution.low, distribution.high) == pytest.approx((868.9, 887.1))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"core": {"threat": "30 AP M2"}}, r'core.threat: got "30 AP M2".* did you mean "\.30 AP M2"'),
        ({"core": {"threat": "7.62x39 API BZ"}}, "core.threat: the catalogue does not know the core"),
        ({"core": {"threat": ".50 AP M2"}}, 'has no velocity of "\\.50 AP M2"; give impact.velocity'),
        ({"core": {"threat": ".30 AP M2", "standard": "VPAM 9"}}, "core.standard: .*must be one of NIJ RF3"),
        ({"plate": {"material": "plate C", "thickness": 5e-3}}, r'plate.material: got "plate C".*did you mean "plate'),
        ({"plate": {"material": "plate A"}}, "plate.thickness: is missing"),
        ({"catalogue": "other.toml"}, "catalogue: .*there is no file|not in the catalogue"),
    ],
)
def test_what_the_catalogue_does_not_know(folder: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(CampaignError, match=said):
        read(folder, **changes)


def test_evidence_is_told_with_what_leaves_it(folder: Path) -> None:
    lines = evidence_of(read(folder))
    assert lines[0].startswith("core: .30 AP M2 (assumed: nose, length")
    assert lines[1].startswith("plate: plate A, Y 2 GPa (12 limit velocities")
    assert not any("not tested: plate" in line for line in lines)
    beyond = evidence_of(
        read(
            folder,
            core={"threat": "7.62x51 P80 AP", "mass": "5 g"},
            plate=TABLES["plate"] | {"thickness": "13 mm", "resistance": "1 GPa"},
            impact={"obliquity": "45 deg"},
        )
    )
    assert beyond[0].startswith("core: 7.62x51 P80 AP with another mass (")
    assert beyond[1].startswith("plate: plate A with another resistance, Y 1 GPa (")
    doubts = "\n".join(beyond[2:])
    for said in ("13 mm thick", "2.15 calibres", "hit at 45°", "no limit velocity of plate A is of the 7.62x51 P80"):
        assert said in doubts


STEEL = {"thickness": "5 mm", "resistance": "4 GPa"}
BLUNT = {"shape": "ogive", "crh": 0.5, "diameter": "6 mm", "length": "20 mm", "mass": "4 g"}


# What validation has shown to fail is said with its figure; beside each the same without what makes it fail.
@pytest.mark.parametrize(
    ("changes", "other", "said"),
    [
        (
            {"plate": STEEL},
            {"plate": STEEL | {"thickness": "7 mm"}},
            "plate is steel that may be hard and 0.8 calibres",
        ),
        ({"plate": STEEL}, {"plate": STEEL | {"resistance": "1 GPa"}}, "of its Y at one calibre"),
        ({"plate": STEEL}, {"plate": STEEL | {"density": 2700}}, "may be hard"),
        (
            {"core": {"threat": "14.5 mm BS41"}},
            {"core": {"threat": "14.5 mm B32"}},
            "carbide core in steel 15% too high",
        ),
        (
            {"core": {"threat": "14.5 mm BS41"}, "plate": STEEL | {"density": 2700}},
            {"core": {"threat": ".50 AP M2"}},
            "carbide core in aluminium 9% too low (median of 11)",
        ),
        ({"core": BLUNT}, {"core": BLUNT | {"crh": 3.0}}, "the nose of the core is 0.35 diameters long"),
    ],
)
def test_where_it_fails_the_program_says_so(
    folder: Path, changes: dict[str, Any], other: dict[str, Any], said: str
) -> None:
    impact = {"impact": {"velocity": 800.0}}
    assert any(said in line for line in evidence_of(read(folder, **impact | changes)))
    assert not any(said in line for line in evidence_of(read(folder, **impact | other)))


def test_the_schema_knows_the_names(folder: Path) -> None:
    schema = campaign_schema()
    jsonschema.validate(TABLES, schema)
    for without in ({"core": {"mass": 5e-3}}, {"plate": {"thickness": 5e-3}}, {"core": {"shape": "ogive"}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(TABLES | without, schema)


def test_a_fit_takes_names(folder: Path) -> None:
    uniform = {"distribution": "uniform", "low": 1e9, "high": 5e9}
    shot = {"measured": {"limit_velocity": {"value": 700, "std": 10}}, "plate": {"thickness": 12.496e-3}}
    data = {
        "title": "fit",
        "catalogue": "own.toml",
        "core": {"threat": ".30 AP M2"},
        "plate": {"material": "plate A", "thickness": 6.248e-3},
        "prior": {"plate": {"shear_coefficient": {"distribution": "uniform", "low": 0, "high": 0.2}}},
        "shot": [shot],
    }
    scene = (fit := fit_from(json.dumps(data), "fit", folder)).scene_of(fit.shots[0])
    assert scene.core.max_radius == pytest.approx(3.124e-3)
    assert scene.target.layers[0].resistance == pytest.approx(2e9 * 2**0.5)
    data["prior"] = {"plate": {"resistance": uniform}}
    fit = fit_from(json.dumps(data), "fit", folder)
    assert fit.scene_of(fit.shots[0]).target.layers[0].resistance == pytest.approx(3e9)  # the prior's median


def test_resistance_is_of_material_threat_thickness_and_angle(folder: Path) -> None:
    def resistance(threat: str = ".30 AP M2", thickness: str = "6 mm", obliquity: str = "0 deg") -> float:
        plate, impact = {"material": "HHA Class 1", "thickness": thickness}, {"obliquity": obliquity, "velocity": 800}
        return read(folder, core={"threat": threat}, plate=plate, impact=impact).plate.resistance

    usual = resistance()
    assert usual != pytest.approx(resistance(obliquity="30 deg"), rel=1e-3)
    assert resistance(thickness="4.3 mm") < usual
    assert resistance(threat=".50 AP M2") != pytest.approx(usual, rel=1e-3)


@pytest.mark.parametrize(
    "changes",
    [
        {"plate": {"material": "HHA Class 1", "thickness": "6 mm", "resistance": "4 GPa"}},
        {"plate": {"material": "HHA Class 1", "thickness": "6 mm", "degradation": 0.9}},
        {"layer": [{"material": "HHA Class 1", "thickness": "6 mm"}]},
        {"interaction": {"quadratic": 0.5}},
        {"plate": {"thickness": "6 mm", "resistance": "4 GPa"}},
        {"plate": {"material": "plate B", "thickness": "6 mm"}},  # whose interval is not known
    ],
)
def test_an_interval_of_the_limit_is_told_only_where_it_follows_from_the_resistance(
    folder: Path, changes: dict[str, Any]
) -> None:
    plate = {"material": "HHA Class 1", "thickness": "6 mm"}
    known = limit_velocity_factors(read(folder, plate=plate))
    assert known is not None
    assert known[0] * known[1] == pytest.approx(1.0)
    wider = limit_velocity_factors(read(folder, plate=plate, core={"threat": "7.62x51 P80 AP"}))
    assert wider is not None
    assert wider[1] > known[1] > 1.02
    assert limit_velocity_factors(read(folder, **{"plate": plate} | changes)) is None
