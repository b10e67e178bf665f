"""Bending from a campaign file to its result, its stop rule, its text and its map."""

from pathlib import Path

import pytest

from warpimpact.analysis.numbers import text_of
from warpimpact.cli import main
from warpimpact.results import files
from warpimpact.results.replayed_hit import hit_view
from warpimpact.results.variables import BENDING_VARIABLES
from warpimpact.runs.replay import replay

SLOTTED_PLATE = (Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
STOP = """
bending = true

[stop]
quantity = "P(bending_stress > 1.5 GPa)"
half_width = 0.04
max_count = 1024
"""


def written(tmp_path: Path, tail: str, *changes: tuple[str, str]) -> Path:
    text = SLOTTED_PLATE.replace('"standard"', '"draft"').replace("count = 4096\n", "") + tail
    for change in changes:
        assert change[0] in text
        text = text.replace(*change)
    path = tmp_path / "campaign.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.usefixtures("small_chunks")
def test_from_a_campaign_to_its_result(tmp_path: Path) -> None:
    path, output = written(tmp_path, STOP, ("seed = 1", "seed = 1\nirreducible = true")), tmp_path / "a.nc"
    assert main(["run", str(path), "-o", str(output), "--device", "cpu"]) == 0
    dataset = files.read(output)
    assert {dataset[name].attrs["units"] for name in BENDING_VARIABLES} == {"N m", "m", "Pa"}
    stress = dataset["bending_stress"].values
    assert dataset.attrs["estimate"] == pytest.approx((stress > 1.5e9).mean())
    assert 0.0 < dataset.attrs["estimate"] < 1.0
    assert ((dataset["bending_section"] > 0.0) & (dataset["bending_section"] < 27.86e-3)).all()
    assert replay(dataset, 11, folder=tmp_path).attrs["agreement"] == "bit-identical"


def test_run_and_replay_tell_which_cores_break(tmp_path: Path) -> None:
    weak = 'mass = "4 g"\nstrength = "2 GPa"'
    path, output = written(tmp_path, "bending = true\n", ('mass = "4 g"', weak)), tmp_path / "a.nc"
    assert main(["run", str(path), "-o", str(output), "--device", "cpu", "--count", "64"]) == 0
    dataset = files.read(output)
    broken = dataset["broken"].values
    assert 0 < broken.sum() < 64
    hit = int(broken.argmax())
    time, section = (float(dataset[name][hit]) for name in ("broken_time", "broken_section"))
    shown = text_of(hit_view(replay(dataset, hit)))
    assert f"passed the core's strength after {1e6 * time:.1f} µs, {1e3 * section:.1f} mm behind the nose." in shown
    assert "stayed below the core's strength" in text_of(hit_view(replay(dataset, int(broken.argmin()))))
