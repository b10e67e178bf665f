"""V50 of fired shots: its numbers, what shots do not determine, and the files that people have."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm

from warpimpact import CampaignError, v50
from warpimpact.cli import main
from warpimpact.firing.v50 import FOOT, STANDARD_SPANS, read_shots

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
        ([800, 820, 790], [1, 1, 1], math.nan, "All 3 cores passed. V50 lies below about 790 m/s"),
        ([800, 820, 790], [0, 0, 0], math.nan, "None of 3 cores passed. V50 lies above about 820 m/s"),
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
        ("velocity,result\n-3,yes\n", 'line 2: velocity: got "-3", but it must be greater than 0'),
        ("velocity,result\n800\n", "line 2: has 1 columns"),
        ("velocity [mm],result\n800,yes\n", "line 2: velocity: got"),
    ],
)
def test_a_mistake_in_a_file_is_one_sentence(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(CampaignError, match=r"a\.csv") as error:
        read_shots(tmp_path / "a.csv")
    assert message in str(error.value)


def test_arrays_that_are_no_shots_are_refused() -> None:
    for velocity, perforated, message in (
        ([800.0], [1, 0], "Give one answer for each shot"),
        ([], [], "Give one answer for each shot"),
        ([math.nan], [1], "finite number above 0"),
        ([800.0], [2], "neither true nor false"),
    ):
        with pytest.raises(ValueError, match=message):
            v50(velocity, perforated)


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
