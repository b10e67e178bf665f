"""What is told of a campaign that takes long, before it is computed."""

import warnings
from pathlib import Path

import pytest

from warpimpact import Campaign, Numerics, SlotPattern
from warpimpact.runs.run import Costly, cost_warning, estimate_cost
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import MOST_STEPS, TooManySteps

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
LEVEL = Numerics(level=2)


def slow() -> Campaign:
    """A plate that is hit aslant and weakens close to the core."""
    campaign = Campaign.from_toml(SLOTTED_PLATE)
    plate = campaign.plate.model_copy(update={"degradation_length": 0.02e-3})
    impact = campaign.impact.model_copy(update={"obliquity": 65.0})
    return campaign.model_copy(update={"plate": plate, "impact": impact})


def test_hits_that_take_long_are_reported_once_at_each_level() -> None:
    warn = cost_warning(slow(), "cpu", passages=35)
    with pytest.warns(Costly, match=r"^at level 2 a hit takes about \d.* s of a core, and 4096 hits .* h: .* GiB"):
        warn(LEVEL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn(LEVEL)
    assert estimate_cost(Campaign.from_toml(SLOTTED_PLATE), LEVEL) is None


def test_holes_that_take_long_are_reported_before_they_are_built() -> None:
    campaign = Campaign.from_toml(SLOTTED_PLATE)
    pattern = SlotPattern(length="12 mm", width="4 mm", spacing=("0.45 m", "0.45 m"))
    wide = campaign.model_copy(update={"plate": campaign.plate.model_copy(update={"pattern": pattern})})
    assert estimate_cost(wide, LEVEL) == (
        "at level 2 the holes of the plates take about 9.1 s of a core and 1.4 GiB before the first hit; a smaller "
        "period of the pattern, and a longer degradation_length, take less"
    )


def test_a_shot_of_too_many_steps_is_refused() -> None:
    campaign = Campaign.from_toml(SLOTTED_PLATE)
    shots, scene = campaign.sampler().shots(0, 1), campaign.scene
    steps = prepare(scene, shots, Numerics(time_step=1e-7)).steps
    shortest = 1e-7 * steps / MOST_STEPS
    assert prepare(scene, shots, Numerics(time_step=1.1 * shortest)).steps == pytest.approx(MOST_STEPS / 1.1, rel=0.05)
    with pytest.raises(TooManySteps, match=r"takes 1\..*e\+07 steps of .* ns, but at most 1e\+07 are computed"):
        prepare(scene, shots, Numerics(time_step=0.9 * shortest))
