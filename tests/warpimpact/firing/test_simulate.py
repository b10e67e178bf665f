"""Firing tests: V50 of fired shots and of simulated ones, at targets that are known."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
import xarray
from scipy import stats

from warpimpact import CampaignError, v50
from warpimpact.analysis.numbers import text_of
from warpimpact.cli import main
from warpimpact.firing.simulate import (
    DISCLAIMER,
    Gun,
    Langlie,
    MilStd662F,
    Procedure,
    Response,
    firing_view,
    read_test,
    response_of_limits,
    simulate_test,
)
from warpimpact.firing.v50 import FOOT, STANDARD_SPANS, read_shots
from warpimpact.kernels.status import Status
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import FIRING
from warpimpact.results import files

VELOCITY = [772.0, 780.0, 788.0, 795.0, 801.0, 806.0, 812.0, 818.0, 825.0, 833.0]
PERFORATED = [0, 0, 0, 1, 0, 1, 0, 1, 1, 1]


def test_v50_and_spread_are_those_of_a_probit() -> None:
    result = v50(VELOCITY, PERFORATED)
    at, slope = sm.Probit(PERFORATED, sm.add_constant(np.array(VELOCITY) - 800.0)).fit(disp=0).params
    assert result.value == pytest.approx(800.0 - at / slope, abs=1e-3)
    assert result.spread == pytest.approx(1.0 / slope, rel=1e-4)
    assert result.low < result.value < result.high
    assert result.spread_low < result.spread < result.spread_high


def test_the_standard_takes_the_most_pairs_within_its_span() -> None:
    """Five fastest stops and five slowest perforations span 61 m/s, three 30 m/s, two 17 m/s."""
    assert {pairs: round(span / FOOT) for pairs, span in STANDARD_SPANS.items()} == {2: 60, 3: 90, 5: 125}
    result = v50(VELOCITY, PERFORATED)
    assert (result.pairs, result.span) == (2, 17.0)
    assert result.standard == pytest.approx(np.mean([801.0, 812.0, 795.0, 806.0]))
    assert result.lines[2].endswith("mean of 2 stops and 2 complete penetrations within 17 m/s (allowed 18.3 m/s)")
    none = v50([700.0, 800.0, 900.0], [0, 1, 1])
    assert (none.pairs, math.isnan(none.standard)) == (0, True)
    assert none.lines[2].startswith("V50 by MIL-STD-662F: none, no 2 + 2 shots within 18.3 m/s")


@pytest.mark.parametrize(
    ("velocity", "perforated", "value", "line"),
    [
        # strictly alternating up and down: the sums of Dixon and Mood would give a spread of 0.047 steps
        ([800, 780] * 5, [1, 0] * 5, 790.0, "V50 lies between 780 and 800 m/s, and the spread is not determined"),
        ([800] * 7, [1, 1, 1, 0, 0, 0, 0], math.nan, "Fast cores pass no more often than slow ones"),
        ([800, 820, 790], [1, 1, 1], math.nan, "Every core of 3 shots passed. V50 lies below about 790 m/s"),
        ([800, 820, 790], [0, 0, 0], math.nan, "No core of 3 shots passed. V50 lies above about 820 m/s"),
        ([780, 790, 800, 820], [1, 1, 0, 0], math.nan, "Fast cores pass no more often than slow ones"),
        ([780, 800, 800, 800, 820], [0, 0, 1, 0, 1], 800.0, "V50 lies near 800 m/s, and the spread is not determined"),
        ([780, 790, 800, 820], [1, 0, 1, 1], None, "The interval of V50 is open"),
    ],
)
def test_what_shots_do_not_determine_has_a_sentence(
    velocity: list[float], perforated: list[int], value: float | None, line: str
) -> None:
    result = v50(velocity, perforated)
    if value is not None:
        assert result.value == pytest.approx(value, nan_ok=True)
        assert math.isnan(result.spread)
    assert line in result.lines[3]
    assert str(result).count("\n") == 3


def test_a_published_up_and_down_test_is_within_the_intervals() -> None:
    """Seven survivals, and failures at 280 (two) and 300 (three), in steps of 20: V50 282 and, since the sums are too
    small for the formula of Dixon and Mood, a spread of 0.53 steps."""
    result = v50([280, 280, 300, 300, 300, 260, 260, 260, 260, 280, 280, 280], [1] * 5 + [0] * 7)
    assert result.low < 282.0 < result.high
    assert result.value == pytest.approx(282.0, abs=2.0)
    assert math.isnan(result.spread)
    assert result.spread_low == 0.0 < 10.6 < result.spread_high


@pytest.mark.parametrize(
    "text",
    [
        "velocity [m/s],perforated\n800,yes\n780.5,no\n",
        "\ufeffshot;Velocity [m/s];Result\r\n1;800,0;CP\r\n2;780,5;PP\r\n",
        "sep=;\nImpact velocity (m/s);Complete\n800;TRUE\n780,5;FALSE\n;\n",
        "# panel 3\nstriking_velocity\toutcome\n800\tcomplete\n780,5\tPartial\n",
        "v (ft/s),perforated,note\n2624.67191601,1,a\n2560.69553806,0,\n",
        "velocity, perforated\n800 m/s, y\n0.7805 km/s, n\n",
        "velocity, perforated\n800 m s-1, y\n780.5, n\n",
    ],
)
def test_files_of_people_are_read(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    shots = read_shots(tmp_path / "a.csv")
    assert shots.velocity == pytest.approx([800.0, 780.5])
    assert shots.perforated.tolist() == [True, False]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no shots. Give a header"),
        ("velocity,perforated\n", "has no shots"),
        ("speed;x\n1;2\n", 'got the header "speed,x" with 0 columns of results'),
        ("velocity,v,result\n1,2,yes\n", "with 2 columns of velocities"),
        ('velocity,result\n"2,650",yes\n', 'line 2: velocity: got "2,650 m/s", whose comma may stand'),
        ("velocity,result\n800,yes\n\n810,maybe\n", 'line 4: got the result "maybe". Give yes, y, true, 1, cp'),
        ("velocity;result\n1.025;yes\n", 'got "1.025": read as 1.025 m/s, but 20 to 3000 m/s is usual'),
        ("velocity,result\n-3,yes\n", 'line 2: velocity: got "-3", but it must be greater than 0'),
        ("velocity,result\n800\n", "line 2: has columns: 1"),
        ("velocity,result\n820,1,0\n", "line 2: has columns: 3, the header 2. Decimal commas need semicolons"),
        ("velocity [mm],result\n800,yes\n", "line 2: velocity: got"),
    ],
)
def test_a_mistake_in_a_file_is_one_sentence(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(CampaignError, match=r"a\.csv") as error:
        read_shots(tmp_path / "a.csv")
    assert message in str(error.value)


@pytest.mark.usefixtures("in_tmp_path")
def test_the_command_prints_four_lines_and_draws(capsys: pytest.CaptureFixture[str]) -> None:
    rows = "".join(f"{speed},{answer}\n" for speed, answer in zip(VELOCITY, PERFORATED, strict=True))
    Path("shots.csv").write_text("velocity [m/s],perforated\n" + rows, encoding="utf-8")
    assert main(["test", "shots.csv"]) == 0
    written = "written to shots_v50.csv, figure in shots_v50.png"
    assert capsys.readouterr().out == f"{v50(VELOCITY, PERFORATED)}\n{written}\n"
    assert Path("shots_v50.png").exists()
    numbers = pd.read_csv("shots_v50.csv", index_col="number")["value"]
    assert numbers["value"] == v50(VELOCITY, PERFORATED).value
    assert main(["test", "shots.csv"]) == 2
    for text in ("800,1\n810,1\n", "800,0\n"):
        Path("shots.csv").write_text("velocity,perforated\n" + text, encoding="utf-8")
        assert main(["test", "shots.csv", "-o", "b.csv", "--overwrite"]) == 0


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
        (TARGET + LANGLIE + "shots = 1\n", "procedure.shots: got 1, but it must be greater than or equal to 2"),
        (TARGET + "[proof]\nvelocity = 1\nshots = 3\nallowed = 3\n", "allowed = 3, but it must be less than shots = 3"),
        ('title = "a"\n[target]\nlimits = "no.nc"\n', 'target.limits: got "no.nc", but there is no file'),
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
    assert [response.quantile(share).value for share in (0.01, 0.5, 0.99)] == [16.0, 800.0, np.inf]


def test_an_unknown_material_is_in_every_probability(in_tmp_path: Path) -> None:
    """A solid plate has one limit, which its material leaves 6 % open: at 820 m/s a core passes with
    Φ(ln(820/800)/6 %), and no test of many shots is sure to be passed or failed."""
    solid = Response(np.full(4000, 800.0), deviation=0.06)
    chance, v50 = solid.estimate(820.0), solid.quantile(0.5)
    expected = stats.norm.cdf(np.log(820.0 / 800.0) / 0.06)
    assert chance.value == pytest.approx(expected, abs=0.5 / 41)
    assert (chance.low, chance.high) == pytest.approx((0.0, 1.0), abs=1e-9)
    assert (v50.value, v50.low, v50.high) == pytest.approx((800.0, 800.0 / 1.125, 800.0 * 1.125), rel=0.015)
    Path("a.toml").write_text(TARGET + '[proof]\nvelocity = "0.82 km/s"\nshots = 20\n', encoding="utf-8")
    dataset = simulate_test(read_test("a.toml"), solid)
    row = list(dataset["velocity"].values).index(820.0)
    assert float(dataset["pass_probability"][row]) == pytest.approx(1.0 - expected, abs=0.5 / 41)
    assert "hold the error of the material" in text_of(firing_view(dataset))


@pytest.mark.parametrize("share", [0.01, 0.05, 0.5, 0.9])
def test_quantiles_of_a_normal_response(share: float) -> None:
    result = NORMAL.quantile(share)
    assert result.value == pytest.approx(stats.norm.ppf(share, 800.0, 25.0), abs=0.12)  # half a rank
    assert result.low < result.value < result.high


def test_shot_k_of_test_t_does_not_depend_on_their_numbers(dataset: xarray.Dataset) -> None:
    text = TEXT.replace("tests = 200", "tests = 50").replace('highest = "950 m/s"', 'highest = "950 m/s"\nshots = 7')
    assert np.array_equal(reported(text)["shot_velocity"].values, dataset["shot_velocity"].values[:50, :7])


def test_numbers_of_a_known_target(dataset: xarray.Dataset) -> None:
    """At 760 m/s a shot perforates with Φ(−40 / √(25² + 5²)); 38 shots are needed for one perforation."""
    row = list(dataset["velocity"].values).index(760.0)
    p = stats.norm.cdf(-40.0 / np.hypot(25.0, 5.0))
    assert dataset.attrs["proof_shots"] == 38
    assert float(dataset["proof_perforation_probability"][row]) == pytest.approx(p, abs=5e-4)
    assert float(dataset["pass_probability"][row]) == pytest.approx(stats.binom.cdf(1, 38, p), abs=5e-3)
    assert (dataset["pass_probability_same_place"] >= dataset["pass_probability"] - 0.2).all()
    assert dataset.attrs["true_v50"] == pytest.approx(800.0)
    assert dataset.attrs["true_spread"] == pytest.approx(25.0, rel=1e-3)
    v50 = dataset["reported_v50"].values
    assert abs(np.nanmean(v50) - 800.0) < 4.0 * np.nanstd(v50) / np.sqrt(200)


def test_a_campaign_is_searched_and_its_limits_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A solid plate has one limit: every test of 16 shots finds it, however they hit."""
    campaign = """title = "solid"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", mass = "1.5 g" }
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
    shown = capsys.readouterr().out
    assert DISCLAIMER in shown
    assert "\nBy 8 hits. Half the distance" in shown
    assert (tmp_path / "a.png").exists()
    result, limit = files.read(output, FIRING), float(files.read(tmp_path / "a_limits.nc").limit_velocity[0])
    assert result.attrs["true_v50"] == pytest.approx(limit, abs=1.0)
    assert result["reported_v50"].values == pytest.approx(np.full(20, limit), abs=20.0)
    assert result.attrs["Conventions"] == "CF-1.11"
    assert json.loads(result.attrs["firing_test_settings"])["target"]["count"] == 8
    assert all({"units", "long_name"} <= set(result[name].attrs) for name in result.variables)
    assert main(["test", str(tmp_path / "a.toml"), "-o", str(output)]) == 2
    (tmp_path / "b.toml").write_text(test.replace('campaign = "solid.toml"\ncount = 8', 'limits = "a_limits.nc"'))
    assert main(["test", str(tmp_path / "b.toml"), "-o", str(tmp_path / "b.nc"), "-q"]) == 0
    assert np.array_equal(files.read(tmp_path / "b.nc", FIRING)["reported_v50"].values, result["reported_v50"].values)
