"""Campaigns whose shots take their material from the rows of a file, all columns of a row together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from warpimpact.campaign.campaign import Campaign
from warpimpact.errors import CampaignError
from warpimpact.measures.references import law_of
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.scene import Scene
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.simulate import simulate

from ...options import CPU

ROWS = 50
SHARE = np.random.default_rng(0).random(ROWS)
CAMPAIGN = """
title = "material of a file"
[core]
shape = "ogive"
diameter = "6 mm"
crh = 3
length = "20 mm"
mass = "4 g"
[plate]
thickness = "2 mm"
resistance = "1 GPa"
degradation = 0.8
[plate.pattern]
shape = "circle"
diameter = "8 mm"
spacing = ["12 mm", "12 mm"]
[impact]
velocity = "700 m/s"
[hits]
count = 256
seed = 4
replicates = 8
file = "material.csv"
[numerics]
level = 0
time_step = "2 us"
"""


def campaign(folder: Path, *changes: tuple[str, str], **more: float) -> Campaign:
    """A campaign with a file of resistance and friction, which follow from each other; `more` scatters others, too."""
    columns = {"resistance": 2e9 + 1e9 * SHARE, "shear_coefficient": 0.1 * SHARE}
    columns |= {name: size * (1.0 + SHARE) for name, size in more.items()}
    rows = [",".join(map(repr, row)) for row in np.stack(list(columns.values()), axis=1).tolist()]
    (folder / "material.csv").write_text("\n".join([",".join(columns), *rows]), encoding="utf-8")
    text = CAMPAIGN
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return Campaign.from_text(text, name="c.toml", folder=folder)


@pytest.mark.parametrize("sampling", ["sobol", "random", "grid"])
def test_columns_of_a_row_stay_together(tmp_path: Path, sampling: str) -> None:
    change = ("replicates = 8", f'sampling = "{sampling}"')
    shots = campaign(tmp_path, change).sampler().shots(0, 256)
    share = (shots.resistance[:, 0] - 2e9) / 1e9
    assert len(np.unique(share)) > 40
    assert shots.shear_coefficient[:, 0] == pytest.approx(0.1 * share)
    assert shots.thickness is None
    assert abs(np.corrcoef(share, shots.hit_y)[0, 1]) < 0.2  # of 256 independent pairs: ± 0.06


def with_own(scene: Scene, name: str, value: float) -> Scene:
    """A scene with the value of a row."""
    if QUANTITIES[name].table == "plate":
        plate = scene.target.layers[0].model_copy(update={name: value})
        return scene.model_copy(update={"target": scene.target.model_copy(update={"layers": (plate,)})})
    return scene.model_copy(update={"interaction": scene.interaction.model_copy(update={name: value})})


@pytest.mark.parametrize(
    ("name", "size", "distance"),
    [
        ("quadratic", 0.2, 1e-3),
    ],
)
def test_shots_of_all_rows_are_computed_together(tmp_path: Path, name: str, size: float, distance: float) -> None:
    listed = campaign(tmp_path, ("count = 256", "count = 16"), **{name: size})
    shots, result = listed.sampler().shots(0, 16), law_of(run(listed, options=CPU))
    for place in (0, 9):
        shot, numerics = shots[place : place + 1], listed.numerics
        alone = simulate(listed.scene, shot, method=numerics, device="cpu").residual_velocity
        assert float(result["residual_velocity"][place]) == float(np.float32(alone[0]))
        without = replace(shot, **{name: None})
        scene = with_own(listed.scene, name, float(result[name][place]))
        own = simulate(scene, without, method=numerics, device="cpu").residual_velocity
        assert alone == pytest.approx(own, abs=distance)
        of_campaign = simulate(listed.scene, without, method=numerics, device="cpu").residual_velocity
        assert alone != pytest.approx(of_campaign, abs=1e-2)
    assert replay(result, 9, folder=tmp_path).attrs["agreement"] == "bit-identical"


@pytest.mark.parametrize(
    ("change", "more", "sentence"),
    [
        (("seed = 4", "seed = 4"), {"hit_y": 1e-3}, 'has hit points. Give sampling = "list"'),
        (("seed = 4", "seed = 4"), {"degradation": 0.9}, "a column degradation that reaches 1.7"),
    ],
)
def test_what_cannot_be_is_refused(
    tmp_path: Path, change: tuple[str, str], more: dict[str, float], sentence: str
) -> None:
    with pytest.raises(CampaignError) as caught:
        campaign(tmp_path, change, **more)
    assert sentence in str(caught.value)
