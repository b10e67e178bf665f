"""Records: a new one is a group and a line, and outcomes are columns with what is done to all of them alike."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpimpact import Campaign, FastLaw, Hits, Impact, Plate, Scene, make_shots, simulate
from warpimpact.analysis.hit_map import mirrored
from warpimpact.records import variables
from warpimpact.records.outcomes import Outcomes, columns_of
from warpimpact.records.variables import HITS, Variable
from warpimpact.results import files
from warpimpact.runs.run import run_to_file
from warpimpact.scene import ConeCore, SquarePattern
from warpimpact.solver import memory

from ...options import CPU

SIDEWAYS = Variable("sideways", HITS, "m s-1", "velocity along y at the end of contact", mirror="along_y")


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A record of the variables, and the line that fills it."""

    def columns(*of: Any) -> dict[Variable, Any]:
        usual = columns_of(*of)
        return usual | {SIDEWAYS: usual[variables.EXIT_VELOCITY][:, 1]}

    monkeypatch.setitem(variables.RECORDS, "With the toy", (SIDEWAYS,))
    monkeypatch.setattr(memory, "columns_of", columns)


CORE = ConeCore(diameter="6 mm", length="20 mm", cone_length="6 mm", mass="4 g")
PLATE = Plate(thickness="4 mm", resistance="2 GPa", pattern=SquarePattern(side="4 mm", spacing=("8 mm", "8 mm")))
CAMPAIGN = """
title = "a toy"
[core]
shape = "cone"
diameter = "6 mm"
length = "20 mm"
cone_length = "6 mm"
mass = "4 g"
[plate]
thickness = "4 mm"
resistance = "2 GPa"
pattern = { shape = "square", side = "4 mm", spacing = ["8 mm", "8 mm"] }
[impact]
velocity = "825 m/s"
[hits]
count = 16
irreducible = true
[numerics]
fidelity = "draft"
patches_axial = 14
"""


@pytest.mark.usefixtures("toy")
def test_a_new_record_is_computed_mirrored_and_in_the_file(tmp_path: Path) -> None:
    shots = make_shots(Impact(velocity=825.0), Hits(count=4), PLATE)
    outcomes = simulate(Scene(core=CORE, target=PLATE), shots, method=FastLaw(fidelity="draft"), device="cpu")
    np.testing.assert_array_equal(outcomes.sideways, outcomes.exit_velocity[:, 1])
    assert np.ptp(outcomes.sideways) > 1.0

    campaign = Campaign.from_text(CAMPAIGN, name="toy", folder=tmp_path)
    group = campaign.symmetries
    assert len(group) == 4
    run_to_file(campaign, tmp_path / "toy.nc", options=CPU)
    result = files.read(tmp_path / "toy.nc")
    stored = result["sideways"]
    assert (stored.dims, stored.dtype, stored.attrs["units"]) == (("hit",), np.float32, "m s-1")
    signs = [symmetry.along_y for symmetry in group]
    np.testing.assert_array_equal(mirrored(result)["sideways"], np.concatenate([sign * stored for sign in signs]))
    np.testing.assert_array_equal(stored, result["law/exit_velocity"][:, 1])


def some(count: int = 3) -> Outcomes:
    """Outcomes of a few columns."""
    rng = np.random.default_rng(1)
    vectors = {name: rng.random((count, 3)) for name in ("exit_velocity", "angular_velocity")}
    angles = {name: rng.random((count, 2)) for name in ("tilt", "pitch", "yaw")}
    return Outcomes(status=np.arange(count, dtype=np.int8), **vectors, **angles)


def test_outcomes_are_immutable_and_say_what_they_lack() -> None:
    one = some()
    with pytest.raises(AttributeError, match=r"outcomes are immutable; assign\(tilt=\.\.\.\) gives a changed copy"):
        one.tilt = one.yaw
    with pytest.raises(AttributeError, match=r'no "bending_stress"; it is there with `output.bending`'):
        _ = one.bending_stress
    with pytest.raises(AttributeError, match='no "tild"; there are status, exit_velocity'):
        _ = one.tild
    assert "tilt" in one
    assert "tild" not in one
    again = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(again.tilt, one.tilt)
