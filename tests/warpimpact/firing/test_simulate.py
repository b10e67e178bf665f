"""A simulated firing test: its file, its target, and what it says of a target that is known."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy import stats

from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.text import CampaignError
from warpimpact.cli import main
from warpimpact.firing.plan import Gun, Langlie, MilStd662F, Procedure, read_test
from warpimpact.firing.simulate import Response, firing_view, response_of_limits, simulate_test
from warpimpact.kernels.status import Status
from warpimpact.plotting.studies import firing_figure
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import firing as f
from warpimpact.results.kinds import FIRING

NORMAL = Response(stats.norm.ppf((np.arange(4000) + 0.5) / 4000, 800.0, 25.0))
TARGET = f'title = "a"\ntests = 200\n[target]\nlimits = "{Path(__file__).as_posix()}"\n'
LANGLIE = '[procedure]\nname = "langlie"\nlowest = "650 m/s"\nhighest = "950 m/s"\n'
TEXT = TARGET + LANGLIE + '[gun]\ndeviation = "5 m/s"\n[proof]\nvelocity = "0.76 km/s"\nallowed = 1\n'


def reported(text: str) -> xarray.Dataset:
    """What the test of this file reports, in the working directory."""
    Path("a.toml").write_text(text, encoding="utf-8")
    return simulate_test(read_test("a.toml"), NORMAL)


@pytest.fixture
def dataset(in_tmp_path: Path) -> xarray.Dataset:
    return reported(TEXT)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('title = "a"\n[target]\n', "got both or neither of campaign and limits"),
        (TARGET + LANGLIE.replace("650", "2000"), "lowest = 2000 m/s and highest = 950 m/s, but lowest must be less"),
        (TARGET + LANGLIE.replace("langlie", "langley"), 'got "langley", but it must be one of'),
        (TARGET + LANGLIE.replace("langlie", "3pod"), "procedure.name = 3pod was removed: use langlie"),
        (TARGET + LANGLIE + 'shots = "10"\n', "procedure.shots: got"),
        (TARGET + LANGLIE + "shots = 1\n", "procedure.shots: got 1, but it must be greater than or equal to 2"),
        (TARGET + "[proof]\nvelocity = 1\nshots = 3\nallowed = 3\n", "allowed = 3, but it must be less than shots = 3"),
        (TARGET + "[proof]\nallowed = 0\n", "proof.velocity: is missing"),
        (TARGET + "[guns]\nwindow = 1\n", 'got the unknown key "guns"; did you mean "gun"?'),
        ('title = "a"\n[target]\nlimits = "no.nc"\n', 'target.limits: got "no.nc", but there is no file'),
        (TARGET + "[gun]\ndeviation = -1\n", "gun.deviation: got -1"),
    ],
)
@pytest.mark.usefixtures("in_tmp_path")
def test_a_mistake_becomes_one_sentence(text: str, message: str) -> None:
    with pytest.raises(CampaignError, match=r"^a\.toml: ") as error:
        reported(text)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("procedure", "answers", "velocities"),
    [
        # alternate, then one more stop: back to the shot from which on both are equal in number, else an end
        (Langlie(lowest=600.0, highest=1000.0), [1, 0, 0, 1, 1], [800, 700, 750, 875, 812.5, 756.25]),
        (Langlie(lowest=600.0, highest=1000.0), [0, 0, 1], [800, 900, 950, 925]),
        # 30 m/s until there are both answers, then 15 m/s, until three and three lie within 27 m/s
        (MilStd662F(start=800.0), [1, 1, 0, 1, 0, 1, 0, 1], [800, 770, 740, 755, 740, 755, 740, 755]),
    ],
)
def test_the_velocities_follow_the_published_rules(
    procedure: Procedure, answers: Sequence[int], velocities: Sequence[float]
) -> None:
    aims = list[float]()
    for shot in range(len(answers) + 1):
        if (aim := procedure.aim(np.array(aims), np.array(answers[:shot], dtype=bool))) is not None:
            aims.append(aim)
    assert aims == pytest.approx(velocities)


def test_a_gun_scatters_normally_within_its_window() -> None:
    drawn = (np.arange(2000) + 0.5) / 2000
    assert Gun(deviation=8.0).errors(drawn).std() == pytest.approx(8.0, rel=0.005)
    errors = Gun(deviation=8.0, window=12.0).errors(drawn)
    assert np.abs(errors).max() <= 12.0
    assert errors.std() == pytest.approx(stats.truncnorm.std(-1.5, 1.5, scale=8.0), rel=0.005)


def test_limits_answer_as_a_map() -> None:
    limits = np.array([800.0, 0.0, np.nan, np.inf])
    status = np.where(np.isnan(limits), Status.UNFINISHED, Status.PERFORATED)
    data = {"limit_velocity": (("hit",), limits), "status": (("hit",), status)}
    response = response_of_limits(xarray.Dataset(data, attrs={attr.LIMIT: "velocity"}))
    shares = [response.estimate(speed).value for speed in (1.0, 799.0, 801.0, 5000.0)]
    assert shares == pytest.approx([1 / 3, 1 / 3, 2 / 3, 2 / 3])
    assert response.estimate(801.0).low < 2 / 3 < response.estimate(801.0).high
    assert [response.quantile(share).value for share in (0.01, 0.5, 0.99)] == [0.0, 800.0, np.inf]


@pytest.mark.parametrize("share", [0.01, 0.05, 0.5, 0.9])
def test_quantiles_of_a_normal_response(share: float) -> None:
    result = NORMAL.quantile(share)
    assert result.value == pytest.approx(stats.norm.ppf(share, 800.0, 25.0), abs=0.05)
    assert result.low < result.value < result.high


def test_shot_k_of_test_t_does_not_depend_on_their_numbers(dataset: xarray.Dataset) -> None:
    text = TEXT.replace("tests = 200", "tests = 50").replace('highest = "950 m/s"', 'highest = "950 m/s"\nshots = 7')
    assert np.array_equal(reported(text)[f.SHOT_VELOCITY].values, dataset[f.SHOT_VELOCITY].values[:50, :7])


def test_numbers_of_a_known_target(dataset: xarray.Dataset) -> None:
    """At 760 m/s a shot perforates with Φ(−40 / √(25² + 5²)); 38 shots are needed for one perforation."""
    row = list(dataset[f.VELOCITY].values).index(760.0)
    p = stats.norm.cdf(-40.0 / np.hypot(25.0, 5.0))
    assert dataset.attrs[f.PROOF_SHOTS] == 38
    assert float(dataset[f.PROOF_PERFORATION][row]) == pytest.approx(p, abs=5e-4)
    assert float(dataset[f.PASS][row]) == pytest.approx(stats.binom.cdf(1, 38, p), abs=5e-3)
    assert (dataset[f.PASS_SAME_PLACE] >= dataset[f.PASS] - 0.2).all()
    assert dataset.attrs[f.TRUE_V50] == pytest.approx(800.0)
    assert dataset.attrs[f.TRUE_SPREAD] == pytest.approx(25.0, rel=1e-3)
    v50 = dataset[f.V50].values
    assert abs(np.nanmean(v50) - 800.0) < 4.0 * np.nanstd(v50) / np.sqrt(200)


def test_the_text_and_the_figure_say_what_it_is(dataset: xarray.Dataset) -> None:
    lines = text_of(firing_view(dataset)).splitlines()
    assert lines[1] == f.SENTENCE
    assert any(line.startswith("proof: 38 shots at 760 m/s, at most 1 complete penetration") for line in lines)
    undetermined = np.isnan(dataset[f.SPREAD].values).mean()
    assert any(f"not determined in {100 * undetermined:.3g} %" in line for line in lines)
    figure = firing_figure(dataset)
    assert len(figure.axes) == 3
    assert f.SENTENCE in " ".join(figure.legends[0].get_title().get_text().split())
    standard = TARGET + '[procedure]\nname = "mil_std_662f"\nstart = 815\n'
    text = text_of(firing_view(reported(standard)))
    assert "reports a V50 in " in text
    assert "interval of V50" not in text


def test_a_campaign_is_searched_and_its_limits_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A solid plate has one limit: every test of 16 shots finds it, however they hit."""
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
    assert f.SENTENCE in capsys.readouterr().out
    assert (tmp_path / "a.png").exists()
    result, limit = files.read(output, FIRING), float(files.read(tmp_path / "a_limits.nc").limit_velocity[0])
    assert result.attrs[f.TRUE_V50] == pytest.approx(limit, abs=1.0)
    assert result[f.V50].values == pytest.approx(np.full(20, limit), abs=20.0)
    assert result.attrs["Conventions"] == "CF-1.11"
    assert json.loads(result.attrs[f.SETTINGS])["target"]["count"] == 8
    assert all({"units", "long_name"} <= set(result[name].attrs) for name in result.variables)
    assert main(["test", str(tmp_path / "a.toml"), "-o", str(output)]) == 2
    (tmp_path / "b.toml").write_text(test.replace('campaign = "solid.toml"\ncount = 8', 'limits = "a_limits.nc"'))
    assert main(["test", str(tmp_path / "b.toml"), "-o", str(tmp_path / "b.nc"), "-q"]) == 0
    assert np.array_equal(files.read(tmp_path / "b.nc", FIRING)[f.V50].values, result[f.V50].values)
