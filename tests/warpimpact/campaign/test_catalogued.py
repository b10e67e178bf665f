"""Names of the catalogue in a campaign: what they stand for, what overrides it, and what is said of it."""

import json
from pathlib import Path
from typing import Any

import pytest

from warpimpact import Campaign
from warpimpact.campaign.evidence import catalogue_names, limit_velocity_factors, outside_tested_range, range_line
from warpimpact.campaign.names import SEARCHED_FROM
from warpimpact.campaign.resistance import entry_velocity
from warpimpact.errors import CampaignError
from warpimpact.identification.fit import fit_from

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
        ({"impact": {"velocity": 700.0}}, "impact.velocity", 700.0),
        ({"plate": TABLES["plate"] | {"thickness": "24.992 mm"}}, "plate.resistance", 4e9),
    ],
)
def test_a_key_with_a_name_overrides_it(folder: Path, changes: dict[str, Any], place: str, value: Any) -> None:
    table, key = place.split(".")
    got = getattr(getattr(read(folder, **changes), table), key)
    assert got == (None if value is None else pytest.approx(value))


def test_layers_have_materials(folder: Path) -> None:
    law = {"interaction": {"quadratic": 0.5}}
    layer = {"material": "plate B", "thickness": "10 mm", "gap": "5 mm"}
    campaign = read(folder, layer=[layer], **law)
    assert (campaign.layer[0].density, campaign.plate.resistance) == (2700.0, 2e9)
    assert 0.95e9 < campaign.layer[0].resistance < 1e9  # it was found without a stress of the speed
    with pytest.raises(CampaignError, match=r"interaction.quadratic: the materials were fitted with 0.5 \(plate\)"):
        read(folder, layer=[layer])


@pytest.mark.parametrize(("thickness", "obliquity"), [("4 mm", "0 deg"), ("12 mm", "30 deg")])
def test_under_another_law_a_material_keeps_its_limit_velocity(thickness: str, obliquity: str) -> None:
    plate, impact = {"material": "HHA Class 1", "thickness": thickness}, {"obliquity": obliquity}

    def limits(plate: dict[str, Any], interaction: dict[str, Any]) -> tuple[float, ...]:
        """At the ends of the interval of Y, and at its median."""
        tables = TABLES | {"plate": plate, "interaction": interaction, "impact": impact}
        campaign = Campaign.from_text(json.dumps(tables | {"catalogue": None}), name="named.toml", folder=Path())
        known = campaign.catalogue_resistance(campaign.plate)
        assert known is not None
        stress = campaign.interaction, campaign.plate.shear_coefficient
        given = campaign.core, campaign.plate, campaign.impact.obliquity, stress
        return tuple(float(entry_velocity(*given, value)) for value in (*known.ends, campaign.plate.resistance))

    free = {"quadratic": 1.0, "free_surface": {}}
    assert limits(plate | {"shear_coefficient": 0.0}, free) == pytest.approx(limits(plate, {}), rel=0.01)


def test_the_tolerance_of_a_standard_scatters(folder: Path) -> None:
    campaign = read(folder, core={"threat": ".30 AP M2", "velocity_tolerance": True})
    ((name, distribution),) = campaign.scatter.given.items()
    assert name == ("velocity", 0)
    assert (distribution.low, distribution.high) == pytest.approx((868.9, 887.1))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"core": {"threat": "30 AP M2"}}, r'core.threat: got "30 AP M2".* did you mean "\.30 AP M2"'),
        ({"core": {"threat": ".50 AP M2"}}, 'core.threat: .*has no velocity of "\\.50 AP M2"; give impact.velocity'),
        ({"plate": {"material": "plate C", "thickness": 5e-3}}, r'plate.material: got "plate C".*did you mean "plate'),
    ],
)
def test_what_the_catalogue_does_not_know(folder: Path, changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(CampaignError, match=sentence):
        read(folder, **changes)


def test_a_threat_needs_no_velocity_where_it_is_searched(folder: Path) -> None:
    text = json.dumps(TABLES | {"core": {"threat": ".50 AP M2"}})
    campaign = Campaign.from_text(text, name="named.toml", folder=folder, needs_velocity=False)
    assert campaign.impact.velocity == SEARCHED_FROM
    text = json.dumps(TABLES)
    assert Campaign.from_text(text, name="named.toml", folder=folder, needs_velocity=False) == read(folder)


def test_names_come_with_how_well_they_are_known_and_what_is_outside(folder: Path) -> None:
    core, plate = catalogue_names(read(folder))
    assert outside_tested_range(read(folder)) == []
    assert range_line([]) == "Inside the tested range."
    assert core.startswith("core: .30 AP M2 (assumed: nose, length")
    assert plate.startswith("plate: plate A, resistance 2 GPa (12 limit velocities")
    beyond = read(
        folder,
        core={"threat": "7.62x51 P80 AP", "mass": "5 g"},
        plate=TABLES["plate"] | {"thickness": "13 mm", "resistance": "1 GPa"},
        impact={"obliquity": "45 deg"},
    )
    core, plate = catalogue_names(beyond)
    assert core.startswith("core: 7.62x51 P80 AP (")
    assert plate.startswith("plate: plate A, your resistance 1 GPa (")
    sentences = outside_tested_range(beyond)
    assert range_line(sentences) == "Outside the tested range: thickness, obliquity, the threat."
    assert sentences == [
        "thickness (plate): 13 mm, but limit velocities of plate A were measured at 3 to 12 mm",
        "thickness (plate): 2.15 calibres, but limit velocities of plate A were measured at 0.5 to 2 calibres",
        "obliquity (plate): 45°, but limit velocities of plate A were measured at 0 to 30°; "
        "resistance extrapolated over 15°",
        "the threat (plate): no limit velocity of plate A is of the 7.62x51 P80 AP, but of .30 AP M2",
    ]


STEEL = {"thickness": "7 mm", "resistance": "4 GPa"}
SLOTS = {"shape": "slot", "length": "12 mm", "width": "4 mm", "spacing": ["8 mm", "16 mm"], "staggered": True}
HOLED = STEEL | {"thickness": "4.1 mm", "pattern": SLOTS}
STRONG = {"core": TABLES["core"] | {"strength": "30 GPa"}, "output": {"bending": True}}
RIGID = {"continuum": {"core": "rigid"}}
NARROW = HOLED | {"pattern": SLOTS | {"spacing": ["4.3 mm", "16 mm"], "staggered": False}}


# Beside each the same without what was not measured.
@pytest.mark.parametrize(
    ("changes", "other", "sentence"),
    [
        ({"impact": {"velocity": 200.0}}, {}, "the impact velocity: 200 m/s"),
        ({"plate": STEEL | {"degradation": 0.8}}, {"plate": STEEL}, "weakening: degradation below 1"),
        ({"plate": HOLED} | RIGID, STRONG | {"plate": HOLED}, "fracture of the core: [core] gives no strength"),
        ({"plate": HOLED}, {"plate": HOLED} | RIGID, "fracture of the core: the fast law has none; by finite elements"),
        (STRONG | {"plate": STEEL}, {"plate": STEEL}, "fracture of the core: the strength is assumed"),
        (STRONG | {"plate": HOLED}, {"plate": HOLED}, "fracture of the core: the strength is assumed"),
        ({"plate": NARROW}, {"plate": HOLED}, "size of the holes (plate): 0.66 calibres thick, ligaments of 0.3 mm"),
        ({"plate": STEEL | {"thickness": "5 mm"}}, {"plate": STEEL}, "steel that may be hard, 0.8 calibres thick"),
        (
            {"layer": [STEEL | {"gap": "2 mm"}]},
            {"layer": [STEEL | {"gap": "10 mm"}]},
            "layers that touch, by finite elements: a gap of 2 mm closes",
        ),
        ({"continuum": {"core": "rigid"}}, {}, "a whole bullet, by finite elements: strength factors"),
        (
            {"continuum": {"bullet": "core", "core": "deformable"}},
            {},
            "a core that deforms, by finite elements: strength factors",
        ),
        (
            {"core": {"threat": "14.5 mm BS41"}},
            {"core": {"threat": "14.5 mm BS41"}, "plate": {"material": "HHA Class 1", "thickness": "20 mm"}},
            "carbide core in steel 15%",
        ),
    ],
)
def test_each_property_outside_the_tested_range_has_a_sentence(
    folder: Path, changes: dict[str, Any], other: dict[str, Any], sentence: str
) -> None:
    usual = {"plate": STEEL, "impact": {"velocity": 800.0}}
    assert any(sentence in line for line in outside_tested_range(read(folder, **usual | changes)))
    assert not any(sentence in line for line in outside_tested_range(read(folder, **usual | other)))


def test_a_fit_takes_names(folder: Path) -> None:
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
        {"layer": [{"material": "HHA Class 1", "thickness": "6 mm"}]},
        {"plate": {"material": "plate B", "thickness": "6 mm"}},
        {"plate": {"material": "HHA Class 1", "thickness": "6 mm", "degradation": 0.8}},
    ],
)
def test_an_interval_of_the_limit_is_shown_only_where_it_follows_from_the_resistance(
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
    under_another = read(folder, plate=plate, interaction={"linear": 0.3, "quadratic": 0.5})
    assert limit_velocity_factors(under_another) == pytest.approx(known)
