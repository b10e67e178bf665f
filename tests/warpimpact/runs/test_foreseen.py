"""What is told of a campaign that takes long, before it is computed."""

import warnings
from pathlib import Path

import pytest

from warpimpact import Campaign, Numerics
from warpimpact.runs.foreseen import Cost, Costly, cost_of
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import MOST_STEPS, TooManySteps

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
LEVEL = Numerics(level=2)


def slow() -> Campaign:
    """A thick plate that is hit aslant and weakens close to the core."""
    campaign = Campaign.from_toml(SLOTTED_PLATE)
    plate = campaign.plate.model_copy(update={"thickness": 60e-3, "degradation_length": 0.1e-3})
    impact = campaign.impact.model_copy(update={"obliquity": 65.0})
    return campaign.model_copy(update={"plate": plate, "impact": impact})


def test_hits_that_take_long_are_told_once_at_each_level() -> None:
    cost = Cost(slow(), "cpu")
    with pytest.warns(Costly, match=r"^at level 2 a hit takes about \d.* s of a core, and 4096 hits .* h: .* GiB"):
        cost.tell(LEVEL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cost.tell(LEVEL)
    assert cost_of(Campaign.from_toml(SLOTTED_PLATE), LEVEL) is None


@pytest.mark.filterwarnings("error")
def test_what_a_gpu_takes_is_not_foreseen() -> None:
    Cost(slow(), "NVIDIA").tell(LEVEL)


def test_a_shot_of_too_many_steps_is_refused() -> None:
    campaign = Campaign.from_toml(SLOTTED_PLATE)
    shots, scene = campaign.sampler().shots(0, 1), campaign.scene
    steps = prepare(scene, shots, Numerics(time_step=1e-7)).steps
    shortest = 1e-7 * steps / MOST_STEPS
    assert prepare(scene, shots, Numerics(time_step=1.1 * shortest)).steps == pytest.approx(MOST_STEPS / 1.1, rel=0.05)
    with pytest.raises(TooManySteps, match=r"takes 1\..*e\+07 steps of .* ns, but at most 1e\+07 are computed"):
        prepare(scene, shots, Numerics(time_step=0.9 * shortest))
