"""Plates under several impacts, and plates whose maps finite elements have corrected: known answers and coverage."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import compare, deciding_measure, heading
from warpimpact.analysis.correction import MESH_ERRORS, corrected_estimate, correction_table
from warpimpact.analysis.numbers import text_of
from warpimpact.analysis.plates_by_impact import compare_by_impact, impact_view, verdict_by_impact
from warpimpact.cli import main
from warpimpact.errors import ResultError
from warpimpact.kernels.status import Status
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import with_references
from warpimpact.plotting import impact_figure
from warpimpact.statistics.intervals import Estimate

TILTED, MEAN = "P(inclination@130mm > 30 deg)", "mean(residual_energy_fraction)"


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


def corrected(
    make, law: np.ndarray, second: np.ndarray, elements: np.ndarray, tilt: np.ndarray | float = 0.0
) -> xarray.DataTree:
    """A result of these residual energy fractions, with the first shots by elements."""
    results = (
        make(1000.0 * np.sqrt(numbers), tilt).assign_coords(hit=np.arange(len(numbers))) for numbers in (law, second)
    )
    fast, free_surface = results
    by_elements = fast.isel(hit=slice(len(elements))).assign(residual_velocity=("hit", 1000.0 * np.sqrt(elements)))
    return with_references(fast, {"free_surface": free_surface, "elements": by_elements})


def test_corrected_values_rank(make_plate_result) -> None:
    """By the fast law the first plate is worse; by elements, which the laws explain exactly, it is better by 0.1."""
    numbers = np.random.default_rng(5)
    law, second = numbers.uniform(0.4, 0.6, (2, 400))
    one = corrected(make_plate_result, law + 0.1, second, 0.5 * law[:12] + 0.1)
    other = corrected(make_plate_result, law, second, 0.5 * law[:12] + 0.2)
    comparison = compare({"one": one, "other": other}, [MEAN, "worst_tenth(residual_energy_fraction)"])
    assert comparison.is_corrected
    assert comparison.ranks(MEAN) == {"one": (1, 1), "other": (2, 2)}
    assert comparison.scores[MEAN]["value"].tolist() == pytest.approx([0.1 + 0.5 * law.mean(), 0.2 + 0.5 * law.mean()])
    (pair,) = comparison.differences[MEAN].itertuples()
    assert pair.value == pytest.approx(-0.1)
    moved = 0.002 * MESH_ERRORS["draft"][0] * math.sqrt(0.5 * law[:12].mean() + 0.2)  # of v² / (1000 m/s)²
    assert (pair.low, pair.high) == pytest.approx((-0.1 - moved, -0.1 + moved), rel=0.01)
    assert not comparison.is_ranked("worst_tenth(residual_energy_fraction)")  # nothing sound corrects it
    assert heading(comparison, comparison.measures[MEAN]).endswith("lower is better, corrected by finite elements")
    fast = compare({"one": one, "other": other.to_dataset()}, [MEAN])
    assert fast.ranks(MEAN) == {"other": (1, 1), "one": (2, 2)}
    note = "No trusted correction by finite elements: other. The fast law ranks all plates."
    assert note in fast.notes
    other["elements/status"][:2] = Status.HOURGLASSED
    assert note in compare({"one": one, "other": other}, [MEAN]).notes


def test_pairs_of_elements_narrow_corrected_differences_that_hold(make_plate_result) -> None:
    """What both laws miss is nearly the same at the same places of both plates."""
    numbers, held, ratios, truth = np.random.default_rng(6), 0, [], 0.03
    for _ in range(60):
        law, second = numbers.uniform(0.3, 0.6, (2, 300))
        missed = 0.05 * numbers.standard_normal(300)
        results = []
        for shift in (truth, 0.0):
            exact = 0.6 * law + 0.1 * second + 0.1 + shift + missed + 0.01 * numbers.standard_normal(300)
            results.append(corrected(make_plate_result, law, second, exact[:12]))
        comparison = compare(dict(zip(["a", "b"], results, strict=True)), [MEAN])
        (pair,), scores = comparison.differences[MEAN].itertuples(), comparison.scores[MEAN]
        held += pair.low <= truth <= pair.high
        widths = scores.high - scores.low
        ratios.append((pair.high - pair.low) / math.hypot(*widths))
    assert held >= 52  # 95 % of 60: 57 ± 1.7; three standard deviations below
    assert np.median(ratios) < 0.4


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


def test_a_corrected_difference_is_that_of_the_corrected_values(make_plate_result) -> None:
    """Elements of one plate follow the first law, those of the other plate the second."""
    numbers = np.random.default_rng(8)
    law, second, missed = numbers.uniform(0.3, 0.6, (3, 300))
    missed = 0.2 * (missed - 0.45)
    one = corrected(make_plate_result, law, second, (0.6 * law + missed)[:12])
    other = corrected(make_plate_result, law, second, (0.2 + 0.5 * second + missed)[:12])
    comparison = compare({"a": one, "b": other}, [MEAN])
    (pair,), (a, b) = comparison.differences[MEAN].itertuples(), comparison.scores[MEAN].itertuples()
    assert pair.value == pytest.approx(a.value - b.value, abs=1e-12)
    assert pair.low < pair.value < pair.high
    assert comparison.hits_used == ("300 hits of each plate, corrected by 12 by finite elements, the same shots",)


def test_equal_corrected_hits_are_as_sure_as_their_mesh(make_plate_result) -> None:
    """A solid plate: every hit is the same shot, and its elements err by those of their mesh."""
    result = corrected(make_plate_result, np.full(64, 0.5), np.full(64, 0.45), np.full(6, 0.48 + 1e-16))
    table, *_ = correction_table(result, [Measure.parse("mean(residual_velocity)"), Measure.parse("mean(deflection)")])
    assert table.loc["residual velocity, mean [m/s]"].tolist() == ["707.1", "692.8 ± 3.9", "692.8 ± 3.9"]
    stopped = corrected(make_plate_result, np.zeros(64), np.zeros(64), np.zeros(6))
    energy, share = (corrected_estimate(stopped, Measure.parse(text)) for text in (MEAN, "P(residual_energy > 1 J)"))
    assert energy is not None
    assert share is not None
    assert (energy.value, energy.low, energy.high) == pytest.approx((0.0, 0.0, share.high), rel=0.2)
    assert 0.3 < energy.high < 0.7


def test_a_core_that_passes_the_base_has_pierced_it(make_plate_result) -> None:
    """A rising trend by chance explains the event that implies the other one, but not the other one."""
    law = np.linspace(0.0, 0.9, 64)
    result = corrected(make_plate_result, law, law, law[:8])
    ends = {"base_perforated": 0.9, "base_pierced": 0.8}

    def own(_: object, measure: Measure, __: float) -> Estimate:
        value = ends[measure.name]
        return Estimate(value, value - 0.3, value + 0.05)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("warpimpact.analysis.correction._own_estimate", own)
        events = [corrected_estimate(result, Measure.parse(f"P({name})")) for name in ends]
    assert [(one.value, one.low, one.high) for one in events if one] == [pytest.approx((0.9, 0.6, 0.95))] * 2
