"""A front under what nobody measured: which designs stay on it, and a search over assumptions."""

import re

import numpy as np
import pytest

from warpimpact.campaign.text import CampaignError
from warpimpact.optimisation.evaluate import campaign_of, hits_of
from warpimpact.optimisation.front_view import front_view, stays_on_front
from warpimpact.optimisation.optimise import optimise
from warpimpact.plotting.front import front_figure
from warpimpact.results import front as f
from warpimpact.view.view import text_of

from .conftest import HOLES, SEARCH, WEIGHT_AND_ENERGY, design

THICKNESS = '[variables]\nthickness = ["2 mm", "4 mm", "6 mm"]\n'
REFERENCE = """
[[references]]
name = "soft"
[references.plate]
thickness = "4 mm"
resistance = "1300 MPa"
"""
FEW = SEARCH.replace("assumed_hits = 0", "assumed_hits = 32")


def fraction(found: object, name: str, thickness: float, reference: bool = False) -> float:
    """The mean residual energy fraction of a plate [mm] under an assumption."""
    number = [str(name) for name in found[f.ASSUMPTION].values].index(name)
    if reference:
        return float(found[f.REFERENCE_UNDER].values[0, number, 1])
    place = int(np.argmin(np.abs(found[f.FRESH].values[:, 0] - 7.85 * thickness)))
    return float(found[f.UNDER].values[place, number, 1])


def test_a_front_of_solid_plates_moves_as_the_work_does() -> None:
    """docs/model.md §6.1: without friction and weakening the lost energy goes with Y."""
    found = optimise(design(THICKNESS, WEIGHT_AND_ENERGY, FEW, REFERENCE))
    assert found.sizes["front"] == 3
    given = found[f.FRESH].values[:, 1]
    for name, share in (("Y at its low end", 0.7), ("Y at its high end", 1.3)):
        moved = [fraction(found, name, thickness) for thickness in (2.0, 4.0, 6.0)]
        assert 1.0 - np.array(moved) == pytest.approx(share * (1.0 - given), rel=2e-3)
    soft = float(found[f.REFERENCE_FOUND].values[0, 1])
    assert 1.0 - fraction(found, "Y at its low end", 0.0, reference=True) == pytest.approx(0.7 * (1.0 - soft), rel=2e-3)
    assert stays_on_front(found).all()  # heavier plates stop more under every assumption
    text = text_of(front_view(found))
    count = found.sizes["assumption"]
    assert f"{count} of {count}" in text  # the plate of 4 mm of twice the resistance beats the soft one under all
    labels = {str(one.get_label()) for axes in front_figure(found).axes for one in axes.collections}
    assert "under other assumptions" in labels


def test_a_design_that_only_one_assumption_beats_loses_its_place_there() -> None:
    found = optimise(design(THICKNESS, WEIGHT_AND_ENERGY, FEW, REFERENCE))
    under = found[f.UNDER].values.copy()
    lightest = int(np.argmin(found[f.FRESH].values[:, 0]))
    under[lightest, 0, 0] = 1e3  # heaviest there, and worst
    beaten = stays_on_front(found.assign({f.UNDER: (found[f.UNDER].dims, under)}))
    assert not beaten[lightest, 0]
    assert beaten[lightest, 1:].all()


def test_a_search_over_assumptions_takes_the_worst_or_the_mean_of_them() -> None:
    over = {
        kind: optimise(design(THICKNESS, WEIGHT_AND_ENERGY + f'assumptions = "{kind}"\n', FEW, REFERENCE))
        for kind in ("given", "worst", "mean")
    }
    given, worst, mean = (found[f.FRESH].values[:, 1] for found in over.values())
    under = over["given"][f.UNDER].values[:, :, 1]
    assert worst == pytest.approx(np.maximum(under.max(axis=1), given), abs=3e-3)
    every = np.concatenate([given[:, None], under], axis=1)
    assert mean == pytest.approx(every.mean(axis=1), abs=3e-3)
    assert (worst > given).all()


def test_hits_under_assumptions_can_be_left_out() -> None:
    found = optimise(design(THICKNESS, WEIGHT_AND_ENERGY, SEARCH, REFERENCE))
    assert f.ASSUMPTION not in found
    assert "other assumptions" not in text_of(front_view(found))


def test_an_unknown_choice_is_refused() -> None:
    with pytest.raises(CampaignError, match=r"objectives\[1\].assumptions.*given.*worst.*mean"):
        design(THICKNESS, WEIGHT_AND_ENERGY + 'assumptions = "best"\n', FEW)


def test_turned_shots_take_every_image_of_a_hit_in_turn() -> None:
    holed = design(HOLES, "[variables]\n", WEIGHT_AND_ENERGY, FEW)
    campaign = campaign_of(holed, holed.tables(np.zeros(0)), holed.threats[0])
    straight, turned = (hits_of(campaign, 0, 256, turned=turn) for turn in (False, True))
    assert campaign.sampler().images == 4
    distance = [np.sort(np.abs(np.stack([shots.hit_y, shots.hit_z])), axis=0) for shots in (straight, turned)]
    assert distance[0] == pytest.approx(distance[1], abs=1e-12)  # images of the same hits
    assert len({(bool(y > 0.0), bool(z > 0.0)) for y, z in zip(turned.hit_y, turned.hit_z, strict=True)}) == 4


def test_a_search_stays_within_what_was_tested_unless_told() -> None:
    strict = FEW.replace("allow_untested = true", "allow_untested = false")
    thin = '[variables]\nthickness = ["0.2 mm", "4 mm"]\n'
    found = optimise(design(thin, WEIGHT_AND_ENERGY, strict))
    assert found[f.VALUE].values[:, 0].tolist() == [1.0]  # the second of the list
    assert found[f.UNTESTED].values.tolist() == [""]
    lifted = optimise(design(thin, WEIGHT_AND_ENERGY, FEW))
    assert sorted(lifted[f.UNTESTED].values.tolist()) == ["", "thickness"]
    assert "untested: thickness" in text_of(front_view(lifted))
    assert re.search(r"\nevidence: .*thickness \(1 of 2 designs\)", text_of(front_view(lifted)))
    with pytest.raises(CampaignError, match=r"search\.allow_untested is not true; the nearest has thickness"):
        optimise(design('[variables]\nthickness = ["0.1 mm", "0.2 mm"]\n', WEIGHT_AND_ENERGY, strict))
