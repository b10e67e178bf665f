"""Plates under several impacts: their ranks, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import deciding_measure
from warpimpact.analysis.numbers import text_of
from warpimpact.analysis.plates_by_impact import compare_by_impact, impact_view, verdict_by_impact
from warpimpact.cli import main
from warpimpact.errors import ResultError
from warpimpact.plotting import impact_figure

TILTED = "P(inclination@130mm > 30 deg)"


def hit_at(make, obliquity: float, thickness: float, tilted: float, **plate: object) -> xarray.Dataset:
    """The result of a plate of this thickness under this obliquity [degree]; a share of 400 cores is tilted by 60°."""
    tilt = np.where(np.arange(400) < 400 * tilted, 60.0, 0.0)
    layer = {"thickness": thickness, "material": "steel", "resistance": 1e9 * (1.0 + obliquity)} | plate
    return make(np.full(400, 500.0), tilt).assign(obliquity=("hit", np.full(400, obliquity))).assign_coords(layer)


@pytest.fixture
def trade(make_plate_result) -> dict[str, xarray.Dataset]:
    """Slots tilt more cores at 0°, and a solid plate at 30°."""
    shares = {"slots_0": 0.8, "solid_0": 0.2, "slots_30": 0.3, "solid_30": 0.6}
    return {
        name: hit_at(make_plate_result, float(name[6:]), 4e-3 if name[:5] == "slots" else 3e-3, share)
        for name, share in shares.items()
    }


def test_plates_rank_under_each_angle(trade: dict[str, xarray.Dataset]) -> None:
    comparisons = compare_by_impact([*trade.values()], [*trade], [TILTED])
    assert list(comparisons) == ["0°", "30°"]
    assert [one.ranks(TILTED) for one in comparisons.values()] == [
        {"slots": (1, 1), "solid": (2, 2)},
        {"solid": (1, 1), "slots": (2, 2)},
    ]
    measure = deciding_measure(*comparisons.values())
    assert measure is not None
    assert verdict_by_impact(comparisons) == ["slots best at 0°, solid best at 30°; no plate is best at both."]
    text = text_of(impact_view(comparisons))
    assert "\nslots   23.55   80.0% (75.8% to 83.6%)          1   30.0% (25.7% to 34.7%)           2\n" in text
    axes = impact_figure(comparisons).axes[0]
    assert [line[0].get_xdata().tolist() for line in axes.containers] == [[0.0, 30.0], [0.0, 30.0]]
    assert axes.get_xlabel() == "obliquity"
    assert axes.get_ylabel().endswith("higher is better")


def test_threats_are_impacts_too(trade: dict[str, xarray.Dataset]) -> None:
    results = []
    for name, threat in (("slots_0", "M2"), ("solid_0", "M2"), ("slots_0", "P80"), ("solid_0", "P80")):
        results.append(trade[name].assign_coords(core_threat=threat, core_length=0.02 + 0.001 * len(threat)))
    assert list(compare_by_impact(results, ["a", "b", "a", "b"], [TILTED])) == ["M2", "P80"]


def test_a_plate_alone_and_a_plate_twice_are_refused(trade: dict[str, xarray.Dataset]) -> None:
    three = ["slots_0", "solid_0", "solid_30"]
    sentence = (
        r"^solid_30 and slots_0 differ in obliquity \(30° and 0°\)\. Give plates under the same impact, or two or "
    )
    with pytest.raises(ResultError, match=sentence):
        compare_by_impact([trade[name] for name in three], three, [TILTED])
    heavy = trade["solid_0"].assign(mass=trade["solid_0"]["mass"] + 0.001)
    with pytest.raises(ResultError, match=r"^a and b differ in mass \(0\.00\d+ and 0\.00\d+\)\."):
        compare_by_impact([trade["slots_0"], heavy], ["a", "b"], [TILTED])
    twice = ["slots_0", "slots_0", "slots_30", "solid_30"]
    with pytest.raises(ResultError, match=r"two results are of the same plate under the same impact"):
        compare_by_impact([trade[name] for name in twice], [*"abcd"], [TILTED])


def test_a_sweep_of_plates_and_angles_is_one_table(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.toml").write_text(
        'title = "two plates"\n'
        'core = { shape = "cone", diameter = "6 mm", length = "16 mm", cone_length = "8 mm", mass = "3 g" }\n'
        'plate = { thickness = "3 mm", resistance = "2 GPa" }\nimpact = { velocity = "800 m/s" }\n'
        'hits = { count = 32 }\nnumerics = { level = 0 }\noutput = { standoffs = ["50 mm"], solid_reference = false }\n'
        '[sweep]\nobliquity = ["0 deg", "30 deg"]\nthickness = ["2 mm", "5 mm"]\n',
        encoding="utf-8",
    )
    assert main(["sweep", "a.toml", "-o", "s.nc", "-q", "--device", "cpu"]) == 0
    capsys.readouterr()
    assert main(["compare", "s.nc", "--measure", "mean(residual_velocity)"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines[:4]] == [
        "residual velocity, mean [m/s], lower is better",
        "plate",
        "thickness 2 mm",
        "thickness 5 mm",
    ]
    assert lines[4] == "thickness 5 mm best at both."
    next(Path("s_points").glob("*.nc")).unlink()
    assert main(["compare", "s.nc", "--overwrite"]) == 2
    assert "s.nc: has 4 points, but s_points has 3 results; warpimpact sweep with --resume" in capsys.readouterr().err
