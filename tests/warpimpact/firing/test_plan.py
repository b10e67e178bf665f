"""Test files: what is allowed, and what a mistake is told as."""

from pathlib import Path

import pytest

from warpimpact.campaign.text import CampaignError
from warpimpact.firing.plan_file import firing_test, read_test

TESTS = Path(__file__).parents[3] / "campaigns" / "firing"
TARGET = 'title = "a"\n[target]\nmean = 800\ndeviation = 25\n'
LANGLIE = '[procedure]\nname = "langlie"\nlowest = "600 m/s"\nhighest = "1 km/s"\n'


def test_quantities_are_read_with_their_units() -> None:
    test = firing_test(TARGET + LANGLIE + '[fair_hit]\nyaw = "3 deg"\n[proof]\nvelocity = "0.8 km/s"\n', "a", Path())
    assert test.procedure is not None
    assert (test.procedure.name, test.procedure.most) == ("langlie", 12)
    assert test.fair_hit.yaw == pytest.approx(0.0523599)
    assert test.proof is not None
    assert (test.proof.velocity, test.proof.allowed) == (800.0, 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('title = "a"\n[target]\n', "target: got nothing, but it must be one of campaign, limits, sweep"),
        (TARGET + "velocities = [800]\n", "got mean and velocities, but it must be one of"),
        ('title = "a"\n[target]\nmean = 800\n', "mean and deviation must be given together"),
        ('title = "a"\n[target]\nvelocities = [1, 2]\nshares = [1]\n', "got 2 velocities and 1 shares"),
        (TARGET + "layer = 1\n", "layer needs campaign or sweep"),
        (TARGET + LANGLIE.replace("600", "2000"), "lowest = 2000 m/s and highest = 1000 m/s, but lowest must be less"),
        (TARGET + LANGLIE.replace("langlie", "langley"), 'got "langley", but it must be one of'),
        (TARGET + LANGLIE + 'shots = "10"\n', "procedure.shots: got"),
        (TARGET + LANGLIE + "shots = 1\n", "procedure.shots: got 1, but it must be greater than or equal to 2"),
        (TARGET + '[estimator]\nname = "dixon_mood"\n', 'needs procedure.name = "up_and_down"'),
        (TARGET + "[precision]\nwithin = 10\n", "precision needs procedure"),
        (TARGET + "[proof]\nshots = 3\nallowed = 3\n", "got allowed = 3, but it must be less than shots = 3"),
        (TARGET + "[proof]\nallowed = 0\n", "proof.velocity: is missing"),
        (TARGET + "[fair_hit]\nedge = 0.1\n", "edge needs panel"),
        (TARGET + "[fair_hits]\nyaw = 1\n", 'got the unknown key "fair_hits"; did you mean "fair_hit"?'),
        ('title = "a"\n[target]\nlimits = "no.nc"\n', 'target.limits: got "no.nc", but there is no file'),
        (TARGET + "[gun]\ndeviation = -1\n", "gun.deviation: got -1"),
    ],
)
def test_a_mistake_becomes_one_sentence(text: str, message: str) -> None:
    with pytest.raises(CampaignError, match=r"^a\.toml: ") as error:
        firing_test(text, "a.toml", Path())
    assert message in str(error.value)


@pytest.mark.parametrize("path", sorted(TESTS.glob("*.toml")), ids=lambda path: path.stem)
def test_the_examples_are_valid(path: Path) -> None:
    if "[target]" in path.read_text(encoding="utf-8"):
        assert read_test(path).title
