"""A test as a Dataset: reproducible, and what it says of a target that is known."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.cli import main
from warpimpact.firing.firing_view import firing_view, verdict
from warpimpact.firing.plan_file import firing_test
from warpimpact.firing.repeated import simulate_test
from warpimpact.firing.response import normal_response
from warpimpact.plotting.firing import firing_figure
from warpimpact.results import files
from warpimpact.results import firing as f
from warpimpact.view.view import text_of

TEXT = """
title = "known"
tests = 200
[target]
mean = 800
deviation = 25
[procedure]
name = "langlie"
lowest = "650 m/s"
highest = "950 m/s"
[gun]
deviation = "5 m/s"
[precision]
within = "10 m/s"
sizes = [8, 40, 80]
[required]
v50 = "790 m/s"
[proof]
velocity = "760 m/s"
allowed = 1
"""


@pytest.fixture(scope="module")
def dataset() -> xarray.Dataset:
    return simulate_test(firing_test(TEXT, "a.toml", Path()), normal_response(800.0, 25.0))


def test_shot_k_of_test_t_does_not_depend_on_their_numbers(dataset: xarray.Dataset) -> None:
    text = TEXT.replace("tests = 200", "tests = 50") + "\n"
    fewer = simulate_test(
        firing_test(text.replace('highest = "950 m/s"', 'highest = "950 m/s"\nshots = 7'), "a.toml", Path()),
        normal_response(800.0, 25.0),
    )
    assert np.array_equal(fewer[f.SHOT_VELOCITY].values, dataset[f.SHOT_VELOCITY].values[:50, :7])


def test_numbers_of_a_known_target(dataset: xarray.Dataset) -> None:
    """At 760 m/s a shot perforates with Φ(−40 / √(25² + 5²)); 38 shots are needed for one perforation."""
    from scipy import stats

    row = list(dataset[f.VELOCITY].values).index(760.0)
    p = stats.norm.cdf(-40.0 / np.hypot(25.0, 5.0))
    assert dataset.attrs[f.PROOF_SHOTS] == 38
    assert float(dataset[f.PROOF_PERFORATION][row]) == pytest.approx(p, abs=5e-4)
    assert float(dataset[f.PASS][row]) == pytest.approx(stats.binom.cdf(1, 38, p), abs=5e-3)
    assert (dataset[f.PASS_SAME_PLACE] >= dataset[f.PASS] - 0.2).all()
    within = dataset[f.SIZE_WITHIN].values
    assert within[0] < within[1] < within[2]
    found = verdict(dataset, 790.0)
    assert found is not None
    assert found.passed is not None
    assert found.passed.value == np.mean(dataset[f.V50].values >= 790.0)
    assert abs(found.bias) < 4.0 * found.deviation / np.sqrt(200)


def test_the_text_and_the_figure_say_what_it_is(dataset: xarray.Dataset) -> None:
    lines = text_of(firing_view(dataset)).splitlines()
    assert lines[1] == f.SENTENCE
    assert any(line.startswith("proof: 38 shots at 760 m/s, at most 1 perforate") for line in lines)
    assert any("within ± 10 m/s in 90 % of the tests" in line for line in lines)
    figure = firing_figure(dataset)
    assert len([axes for axes in figure.axes if axes.axison]) == 4
    assert f.SENTENCE in " ".join(figure.get_supxlabel().split())


def test_the_command_writes_a_file_with_cf_attributes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.toml").write_text(TEXT, encoding="utf-8")
    output = tmp_path / "out.nc"
    assert main(["test", str(tmp_path / "a.toml"), "-o", str(output)]) == 0
    assert f.SENTENCE in capsys.readouterr().out
    assert (tmp_path / "out.png").exists()
    read = files.read(output, f.FIRING)
    assert read.attrs["Conventions"] == "CF-1.11"
    assert json.loads(read.attrs[f.SETTINGS])["proof"]["velocity"] == 760.0
    assert all({"units", "long_name"} <= set(read[name].attrs) for name in read.variables)
    assert main(["test", str(tmp_path / "a.toml"), "-o", str(output)]) == 2


def test_a_campaign_is_searched_and_its_limits_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A solid plate has one limit: every test of 16 shots finds it, however they hit. The same tests
    follow from the file of limits."""
    campaign = """title = "solid"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "4 g" }
plate = { thickness = "4 mm", resistance = "2 GPa", shear_coefficient = 0.05 }
impact = { velocity = "600 m/s" }
hits = { count = 8 }
numerics = { level = 0 }
output = { standoffs = ["50 mm"], solid_reference = false }
"""
    (tmp_path / "solid.toml").write_text(campaign, encoding="utf-8")
    procedure = '[procedure]\nname = "langlie"\nlowest = 100\nhighest = 1500\nshots = 16\n'
    test = f'title = "a"\ntests = 20\n[target]\ncampaign = "solid.toml"\ncount = 8\n{procedure}'
    (tmp_path / "a.toml").write_text(test, encoding="utf-8")
    output = tmp_path / "a.nc"
    assert main(["test", str(tmp_path / "a.toml"), "-o", str(output), "-q", "--device", "cpu"]) == 0
    found, limits = files.read(output, f.FIRING), files.read(tmp_path / "a_limits.nc")
    limit = float(limits.limit_velocity[0])
    assert found.attrs[f.TRUE_V50] == pytest.approx(limit, abs=1.0)
    assert found[f.V50].values == pytest.approx(np.full(20, limit), abs=20.0)
    assert "runs of a hit" in capsys.readouterr().out
    again = test.replace('campaign = "solid.toml"\ncount = 8', 'limits = "a_limits.nc"')
    (tmp_path / "b.toml").write_text(again, encoding="utf-8")
    assert main(["test", str(tmp_path / "b.toml"), "-o", str(tmp_path / "b.nc"), "-q"]) == 0
    of_limits = files.read(tmp_path / "b.nc", f.FIRING)
    assert np.array_equal(of_limits[f.V50].values, found[f.V50].values)
    assert "\nevidence: limit velocities; beyond them: " in text_of(firing_view(of_limits))
