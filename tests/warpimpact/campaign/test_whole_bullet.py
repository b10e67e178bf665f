"""The table [bullet], and `continuum.bullet`."""

from pathlib import Path

import pytest

from warpimpact import Campaign, CampaignError
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.evidence import outside_tested_range
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.runs.compute import manifest
from warpimpact.runs.draws import seed_of
from warpimpact.scene.bullet import Bullet

THREAT = """
title = "whole bullets"
core = { threat = "P80" }
plate = { thickness = "4 mm", material = "ARMOX560" }
impact = {}
hits = { count = 4 }
continuum = { bullet = "whole", core = "rigid", spacing = "1 mm" }
"""
OWN = THREAT.replace(
    '{ threat = "P80" }', '{ shape = "ogive", diameter = "6 mm", crh = 3, length = "20 mm", mass = "4 g" }'
)
OWN = OWN.replace("impact = {}", 'impact = { velocity = "800 m/s" }')
BULLET = '[bullet]\nmass = "7.5 g"\ndiameter = "7.82 mm"\ncrh = 7.0\ncore_place = "3 mm"\n'


def read(text: str) -> Campaign:
    return Campaign.from_text(text, name="whole.toml", folder=Path())


def test_a_threat_brings_its_bullet_and_a_table_changes_it() -> None:
    closed = continuum_table(read(THREAT)).method.bullet
    assert closed is not None
    assert closed.mass == 9.7e-3
    heavier = continuum_table(read(THREAT + 'bullet = { mass = "9.8 g" }\n')).method.bullet
    assert heavier is not None
    assert (heavier.diameter, heavier.mass) == pytest.approx((closed.diameter, 9.8e-3))
    assert read(THREAT.replace('"P80"', '"P80", mass = "3.9 g"')).bullet is None  # no core of the catalogue


def test_hits_of_whole_bullets_are_others_than_those_of_bare_cores() -> None:
    """Their settings differ, which a result has and by which stored hits are recognised; the fast law's do not."""
    whole, core = (read(OWN.replace('bullet = "whole"', f'bullet = "{of}"') + BULLET) for of in ("whole", "core"))
    tables = continuum_table(whole), continuum_table(core)
    assert isinstance(tables[0].bullet, Bullet)
    assert tables[0].as_text != tables[1].as_text
    assert manifest(whole) == manifest(core) == manifest(read(OWN.replace('bullet = "whole", core = "rigid", ', "")))
    assert seed_of(whole) == seed_of(read(OWN.replace('bullet = "whole", core = "rigid", ', "")))
    assert "whole bullet" in tables[0].words(1)
    assert "whole bullet" not in tables[1].words(1)
    shots = whole.sampler().shots(0, 2)
    costs = [table.method.estimate_cost(whole.scene, shots) for table in tables]
    assert costs[0].elements > costs[1].elements + 5000
    assert costs[0].work > 2.0 * costs[1].work


def test_bullets_are_whole_where_known_and_their_cores_of_steel_deform() -> None:
    usual, bending = THREAT.replace('bullet = "whole", core = "rigid", ', ""), "output = { bending = true }\n"
    assert read(usual).bodies == ("whole", "deformable")
    assert "whole bullet of 9.7 g, jacket of" in continuum_table(read(usual)).words(1)
    assert read(usual + bending).bodies == ("whole", "rigid")
    assert read(usual.replace('"P80"', '"P80", density = "14.8 g/cm^3"') + BULLET).bodies == ("whole", "rigid")
    own = OWN.replace('bullet = "whole", core = "rigid", ', "")
    assert read(own).bodies == ("core", "rigid")
    assert read(own.replace('"4 g"', '"3.2 g"') + BULLET).bodies == ("whole", "deformable")
    assert read(own.replace("spacing", 'core = "deformable", spacing')).bodies == ("core", "deformable")


def test_a_strength_that_nothing_uses_is_refused() -> None:
    """Without hits by elements a default core does not break; the fast law needs its bending."""
    strong = THREAT.replace('"P80"', '"P80", strength = "3 GPa"')
    by_default = strong.replace('bullet = "whole", core = "rigid", ', "")
    with pytest.raises(CampaignError, match=r"core.strength needs output.bending = true"):
        read(by_default)
    for used in ('core = "deformable", ', "hits = 3, "):
        assert read(by_default.replace("spacing", f"{used}spacing")).has_strength


def test_a_core_deforms_where_the_campaign_says_so() -> None:
    rigid, deformable = (continuum_table(read(THREAT.replace('"rigid"', f'"{of}"'))) for of in ("rigid", "deformable"))
    assert rigid.method.core is None
    assert deformable.method.core == flow_entry("core steel").flow
    assert "core that deforms" in deformable.words(1)
    assert deformable.as_text != rigid.as_text


def test_whole_bullets_whose_cores_deform_meet_plates_with_a_strength_of_their_own() -> None:
    """It is that of the tensile test, times a factor that published limits ask for."""
    fired, whole, deforms = (
        continuum_table(
            read(THREAT.replace('bullet = "whole", core = "rigid"', f'bullet = "{bullet}", core = "{core}"'))
        )
        for bullet, core in (("whole", "deformable"), ("whole", "rigid"), ("core", "deformable"))
    )
    entry = flow_entry("ARMOX560")
    assert whole.entries == deforms.entries == [entry]
    (own,) = fired.entries
    assert own.strength_error == entry.whole_error
    assert own.yield_stress / entry.yield_stress == pytest.approx(entry.whole_factor / entry.strength_factor)
    assert fired.method.flows[0] == own.flow


def test_bodies_that_strength_factors_do_not_know_have_a_sentence() -> None:
    def sentences(bullet: str, core: str, material: str = "ARMOX560") -> str:
        text = THREAT.replace('bullet = "whole", core = "rigid"', f'bullet = "{bullet}", core = "{core}"').replace(
            "ARMOX560", material
        )
        return " ".join(one for one in outside_tested_range(read(text)) if "by finite elements:" in one)

    assert sentences("core", "rigid") == sentences("whole", "deformable") == ""
    assert "rigid bare cores" in sentences("whole", "rigid")
    assert "with rigid cores" in sentences("core", "deformable")
    assert "no strength factor of AA6061-T651" in sentences("whole", "deformable", "AA6061-T651")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (OWN, r'continuum.bullet: got "whole", but the campaign has no bullet; give a table \[bullet\]'),
        (OWN + BULLET + 'filler = "butter"\n', 'bullet.filler: got "butter"'),
        (OWN + BULLET + 'wall = "2 mm"\nbase = "6 mm"\n', "bullet.mass: got 7.5 g, but core, jacket and filler have"),
    ],
)
def test_what_is_no_whole_bullet_is_refused(text: str, sentence: str) -> None:
    campaign = read(text)
    with pytest.raises(CampaignError, match=sentence):
        continuum_table(campaign)


def test_a_flat_wider_than_its_bullet_is_refused() -> None:
    with pytest.raises(CampaignError, match=r"bullet: got flat_radius = 0.005 m, but it must be less than half"):
        read(OWN + BULLET + 'flat_radius = "5 mm"\n')
