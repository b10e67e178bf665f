"""Campaigns whose shots differ in more than their place, and bending, from the file to the result."""

from pathlib import Path

import numpy as np
import pytest

from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import CampaignError
from warpimpact.cli import main
from warpimpact.measures.references import law_of
from warpimpact.records.variables import BENDING_VARIABLES
from warpimpact.results import files
from warpimpact.results.history import hit_view
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run_to_file

from ...options import CPU
from ..slotted import slotted, slotted_text

NORMAL = '{ distribution = "normal", mean = "820 m/s", std = "10 m/s" }'
VELOCITY = '"825 m/s"                    # obliquity, azimuth, pitch, yaw, spin default to 0'


OWN = {
    "resistance": '{ distribution = "lognormal", median = "2600 MPa", sigma = 0.1 }',
    "shear_coefficient": '{ distribution = "uniform", low = 0.02, high = 0.08 }',
    "degradation": '{ distribution = "truncated_normal", mean = 0.8, std = 0.05, low = 0.6, high = 0.95 }',
    "thickness": '{ distribution = "uniform", low = "3.6 mm", high = "4.4 mm" }',
    "mass": '{ distribution = "normal", mean = "4 g", std = "50 mg" }',
}


def line_of(name: str) -> str:
    return next(line for line in slotted_text().splitlines() if line.startswith(f"{name} = "))


@pytest.mark.usefixtures("small_chunks")
def test_scatter_in_plate_and_core_from_file_to_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All quantities of plate and core scatter, and the velocity."""
    changes, count = [(line_of(name), f"{name} = {distribution}") for name, distribution in OWN.items()], 1000
    campaign = slotted((VELOCITY, NORMAL), *changes, count=count)
    run_to_file(campaign, tmp_path / "a.nc", options=CPU)
    assert campaign.impact.velocity == 820.0  # the median
    dataset, shots = law_of(files.read(tmp_path / "a.nc")), campaign.sampler().shots(0, count)
    for name in OWN:
        assert np.array_equal(dataset[name], shots.columns[name].ravel())
        assert len(np.unique(dataset[name])) == count
    # The loss of translational energy exceeds the total loss by the rotational energy; each core has its own mass.
    energy = 0.5 * dataset.mass * (dataset.impact_velocity**2 - dataset.residual_velocity**2)
    assert (np.abs(energy - dataset.energy_loss) < 0.15 * dataset.energy_loss).all()
    assert (energy >= dataset.energy_loss * (1.0 - 1e-4)).all()  # the energy of rotation comes from the translation
    for hit in (3, 700):
        history = replay(dataset, hit, folder=tmp_path)
        assert history.attrs["agreement"] == "bit-identical"
        assert history.attrs["plate_thickness"] == shots.thickness[hit]
    assert main(["inspect", str(tmp_path / "a.nc")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"0 of {count} shots failed"


def test_a_mistake_is_shown_in_one_sentence() -> None:
    with pytest.raises(
        CampaignError, match=r'impact.velocity: mean: got "820 kg", which is not a speed; give a number'
    ):
        slotted((VELOCITY, NORMAL.replace("820 m/s", "820 kg")))
    with pytest.raises(CampaignError, match=r"impact.velocity: got a normal .* that reaches -11.2"):
        slotted((VELOCITY, NORMAL.replace("820 m/s", "50 m/s")))


def test_axes_that_would_flip_are_refused() -> None:
    steep = '825\nobliquity = { distribution = "uniform", low = 0, high = "60 deg" }\nyaw = "40 deg"'
    with pytest.raises(CampaignError, match="yaw up to 40 deg and obliquity up to 60 deg, but their sum must"):
        slotted((VELOCITY, steep))


STOP = """
bending = true

[stop]
quantity = "P(bending_stress > 1.5 GPa)"
half_width = 0.04
max_count = 1024
"""


def written(tmp_path: Path, tail: str, *changes: tuple[str, str]) -> Path:
    path = tmp_path / "campaign.toml"
    path.write_text(slotted_text(("count = 4096\n", ""), *changes) + tail, encoding="utf-8")
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
