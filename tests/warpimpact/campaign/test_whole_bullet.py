"""The table [bullet], and `continuum.bullet`."""

from pathlib import Path

import pytest

from warpimpact import Campaign, CampaignError
from warpimpact.campaign.elements import continuum_table
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
continuum = { bullet = "whole", spacing = "1 mm" }
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
    assert manifest(whole) == manifest(core) == manifest(read(OWN.replace('bullet = "whole", ', "")))
    assert seed_of(whole) == seed_of(read(OWN.replace('bullet = "whole", ', "")))
    assert "whole bullet" in tables[0].words(1)
    assert "whole bullet" not in tables[1].words(1)
    shots = whole.sampler().shots(0, 2)
    costs = [table.method.estimate_cost(whole.scene, shots) for table in tables]
    assert costs[0].elements > costs[1].elements + 5000
    assert costs[0].work > 2.0 * costs[1].work


def test_a_core_deforms_where_the_campaign_says_so() -> None:
    rigid, deformable = (
        continuum_table(read(THREAT.replace("spacing", f'core = "{of}", spacing'))) for of in ("rigid", "deformable")
    )
    assert rigid.as_text == continuum_table(read(THREAT)).as_text
    assert rigid.method.core is None
    assert deformable.method.core == flow_entry("core steel").flow
    assert "core that deforms" in deformable.words(1)
    assert deformable.as_text != rigid.as_text


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
