"""Effectiveness of plates, and of bases behind them, by hand; intervals that hold as often as they say."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import compare, comparison_view, deciding_measure, verdict_of
from warpimpact.analysis.effectiveness import effectiveness, effectiveness_view, scores
from warpimpact.analysis.numbers import text_of
from warpimpact.errors import ResultError
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import standard_normals
from warpimpact.measures.hits import shot_variables
from warpimpact.measures.measure import Measure, shift_of
from warpimpact.measures.references import as_dataset, nodes_of, with_nodes, with_references
from warpimpact.measures.vocabulary import piercing_margin
from warpimpact.plotting import comparison_figure
from warpimpact.records import variables as v
from warpimpact.records.variables import LIMITS, STATUS
from warpimpact.results.dataset import stored_columns


def with_solid(dataset: xarray.Dataset, velocity: np.ndarray | float, tilt: np.ndarray | float = 0.0) -> xarray.Dataset:
    """The same with these residual velocities [m/s] and tilts at 130 mm [degree] behind the solid plate, one or one per
    shot."""
    velocity, tilt = np.broadcast_arrays(np.atleast_1d(velocity), tilt)
    shots = dataset[shot_variables(dataset)].isel(hit=slice(len(velocity)))
    solid = shots.assign_coords(dataset[[v.STANDOFF, v.PRESENTED_AREA]].coords).assign(
        status=("hit", np.zeros(len(velocity), dtype=np.int8)),
        residual_velocity=("hit", velocity),
        tilt=(("hit", "standoff"), np.stack([0.0 * tilt, tilt], axis=1)),
    )
    return with_references(dataset, {"solid": solid})


TRIALS = 100
LEAST = 88  # 95 % of 100 trials: 95 ± 2.2, three standard deviations below


def named(dataset: xarray.Dataset, *texts: str) -> dict[str, Any]:
    return {score.Index: score for score in effectiveness(dataset, texts).itertuples()}


@pytest.fixture
def mixed(make_plate_result) -> xarray.Dataset:
    """Shots that end in every way."""
    ends = [
        Status.PERFORATED,
        Status.UNTOUCHED,
        Status.ARRESTED,
        Status.RICOCHETED,
        Status.UNFINISHED,
        Status.PERFORATED,
    ]
    velocity = np.array([800.0, 1000.0, 0.0, 500.0, np.nan, 600.0])
    return make_plate_result(velocity, np.array([20.0, 90.0, np.nan, np.nan, np.nan, 170.0]), np.array(ends))


def test_what_counts_where(mixed) -> None:
    measures = named(mixed)
    assert measures["mean(residual_energy_fraction)"].value == pytest.approx((0.64 + 1.0 + 0.0 + 0.0 + 0.36) / 5)
    assert measures["worst_point(residual_energy_fraction)"].value == pytest.approx(1.0)
    assert measures["worst_point(residual_energy_fraction)"].hit == 1
    assert measures["P(stopped)"].value == pytest.approx(2 / 5)
    tilted = "P(inclination@130mm > {})"
    assert measures[tilted.format("30 deg")].value == pytest.approx(3 / 5)  # broadside and stopped, not base first
    more = named(
        mixed, tilted.format("5 deg"), tilted.format("0.09 rad"), "P(inclination@50mm > 30 deg)", "areal_density"
    )
    assert [score.value for score in more.values()] == pytest.approx([5 / 5, 5 / 5, 2 / 5, 23.55])


def test_energy_per_area_is_that_of_a_cylinder_and_symmetric_about_broadside(make_plate_result) -> None:
    def density(tilt: float) -> float:
        return named(make_plate_result(np.array([700.0]), tilt))["mean(residual_energy_density@130mm)"].value

    energy, end, side = 0.5 * 0.004 * 700.0**2, math.pi * 3.0**2, 6.0 * 20.0  # [J], [mm²]
    assert density(0.0) == pytest.approx(energy / end, rel=1e-5)
    assert density(90.0) == pytest.approx(energy / side, rel=1e-5)
    slope = math.radians(35.0)
    assert density(35.0) == pytest.approx(energy / (end * math.cos(slope) + side * math.sin(slope)), rel=1e-4)
    assert density(145.0) == density(35.0)
    heavier = make_plate_result(np.array([700.0])).assign(mass=("hit", [0.008]))
    assert named(heavier)["mean(residual_energy_density@130mm)"].value == pytest.approx(2 * energy / end, rel=1e-5)


def test_numbers_without_a_valid_interval_have_none(make_plate_result) -> None:
    few, many = (named(make_plate_result(np.linspace(500.0, 900.0, count))) for count in (399, 400))
    name = "worst_tenth(residual_energy_fraction)"
    assert math.isnan(few[name].low)
    assert many[name].low < many[name].value < many[name].high
    assert math.isnan(many["worst_point(residual_energy_fraction)"].low)


def test_failed_computations_alone_tell_nothing(make_plate_result) -> None:
    failed = make_plate_result(np.full(3, np.nan), status=Status.UNFINISHED)
    assert all(math.isnan(measure.value) and measure.hit < 0 for measure in named(failed).values())
    assert "nan" not in text_of(effectiveness_view(failed))


@pytest.mark.parametrize("count", [400, 1600])
def test_intervals_of_the_ratio_hold_as_often_as_they_say(make_plate_result, count: int) -> None:
    """The impact velocities scatter, equally on both plates; the solid plate has only the first 400 shots."""
    held, numbers, widths = 0, np.random.default_rng(5), []
    for _ in range(TRIALS):
        common = numbers.uniform(0.5, 1.0, count)
        fraction = 0.8 * common + numbers.uniform(0.0, 0.2, count)
        dataset = with_solid(make_plate_result(1000.0 * np.sqrt(fraction)), 1000.0 * np.sqrt(common[:400]))
        measure = named(dataset)["mean(residual_energy_fraction)"]
        held += measure.ratio_low <= (0.8 * 0.75 + 0.1) / 0.75 <= measure.ratio_high
        widths.append((measure.ratio_high - measure.ratio_low) / (measure.high - measure.low) * measure.solid)
    assert held >= LEAST
    if count == 400:
        assert np.median(widths) < 0.6  # a change of both plates is no error of the ratio


def test_the_ratio_of_answers_is_that_of_their_values(make_plate_result, make_answer) -> None:
    """Both plates have the same error in each draw; of a solid plate that may stop all there is no largest ratio."""
    error, plain = np.repeat(standard_normals("shared")[:, None], 64, axis=1), make_plate_result(np.full(64, 500.0))
    own = make_answer(plain, 1000.0 * np.sqrt(0.4 + 0.05 * error))
    for solid, is_open in ((0.2 + 0.025 * error, False), (np.where(error > 0.0, 0.2, 1e-6), True)):
        reference = nodes_of(make_answer(plain, 1000.0 * np.sqrt(solid)))
        tree = with_references(as_dataset(own), {"solid": as_dataset(make_answer(plain, 1000.0 * np.sqrt(solid)))})
        nodes = {**nodes_of(tree), **nodes_of(own), "solid/draws": reference["draws"]}
        row = named(with_nodes(as_dataset(own), nodes))["mean(residual_energy_fraction)"]
        assert (row.value, row.solid) == pytest.approx((0.4, solid.mean()), rel=1e-5)
        assert row.ratio == pytest.approx(0.4 / solid.mean(), rel=1e-5)
        assert math.isnan(row.ratio_high) == is_open
        assert is_open or (row.ratio_low, row.ratio_high) == pytest.approx((2.0, 2.0), rel=1e-5)


@pytest.mark.parametrize("confidence", [0.95, 0.999])
def test_a_core_that_passes_a_base_pierces_it_in_every_end(make_plate_result, make_answer, confidence: float) -> None:
    """In each draw a share of the cores passes the base, and some of the others show their nose behind it."""
    numbers, shape = np.random.default_rng(4), (128, 40)
    passes = numbers.random(shape) < numbers.uniform(0.5, 1.0, (128, 1))
    depth = np.where(passes, np.nan, numbers.uniform(0.0, 12e-3, shape))
    plain = layered(make_plate_result(np.full(40, 100.0)), np.full(40, -1), np.full(40, np.nan))
    result = make_answer(plain, 100.0 * passes, stopped_in=np.where(passes, -1, 1), depth=depth)
    measures = [Measure.parse(f"P(base_{event})") for event in ("perforated", "pierced")]
    passed, pierced = (score.estimate for score in scores(result, measures, confidence))
    assert passed.value < pierced.value
    assert passed.low <= pierced.low
    assert passed.high <= pierced.high <= 1.0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("P(inclination@100mm > 30 deg)", "got 100 mm, but the stand-offs are 50 mm, 130 mm"),
        ("V50", 'measure: got "V50", which needs limit velocities (warpimpact limit), but the result has none'),
    ],
)
def test_what_a_result_lacks_is_refused(mixed, text: str, sentence: str) -> None:
    with pytest.raises(ResultError, match=re.escape(sentence)):
        effectiveness(mixed, [text])


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


def layered(
    result: xarray.Dataset, stopped_in: np.ndarray, depth: np.ndarray, base: float = 10e-3, **columns: np.ndarray
) -> xarray.Dataset:
    """The same of a plate of 4 mm, 100 mm of air and a base of this thickness [m]."""
    return result.assign(
        stopped_in=("hit", stopped_in),
        depth=("hit", depth),
        layer_status=(("hit", "layer"), np.zeros((len(depth), 2), dtype=np.int8)),
        layer_front=("layer", [0.0, 0.104]),
        layer_rear=("layer", [0.004, 0.104 + base]),
        **{name: (("hit", "layer"), values) for name, values in columns.items()},
    )


@pytest.fixture
def mixed_behind(make_plate_result) -> xarray.Dataset:
    """Cores that pass, rest in the base with and without the nose behind it, stop in the plate, bounce off, fail."""
    status = [
        Status.PERFORATED,
        Status.ARRESTED,
        Status.ARRESTED,
        Status.ARRESTED,
        Status.RICOCHETED,
        Status.UNFINISHED,
    ]
    velocity, nan = np.array([400.0, 0.0, 0.0, 0.0, 90.0, np.nan]), np.nan
    result = make_plate_result(velocity, 0.0, np.array(status))
    depth = np.array([nan, 6e-3, 17e-3, 25e-3, nan, nan])
    result["status"].attrs, result["deflection"] = STATUS.attributes, result["residual_velocity"]
    return layered(result, np.array([-1, 1, 1, 0, -1, -1]), depth)


@pytest.fixture
def quarter(make_plate_result) -> xarray.Dataset:
    """A base that a quarter of the cores pass; the solid plate is perforated."""
    status = np.where(np.arange(400) % 4 == 0, Status.PERFORATED, Status.ARRESTED)
    result = make_plate_result(np.full(400, 100.0), 0.0, status)
    return with_solid(layered(result, np.ones(400, dtype=int), np.full(400, 5e-3)), 300.0)


def test_the_margin_of_piercing_has_the_sign_of_the_event(mixed_behind) -> None:
    margin, pierced = piercing_margin(mixed_behind), Measure.parse("P(base_pierced)").by_hit(mixed_behind)
    np.testing.assert_allclose(margin, [np.inf, -4e-3, 7e-3, -np.inf, -np.inf, np.nan], atol=1e-7)
    np.testing.assert_array_equal(np.where(np.isnan(margin), np.nan, margin > 0.0), pierced)


def test_the_numerics_of_piercing_follow_from_the_depths_where_no_core_changes_side(make_plate_result) -> None:
    depth = np.linspace(6e-3, 14e-3, 64)  # no core within 0.06 mm of the rear face at 10 mm
    levels = []
    for change in (0.0, 0.02e-3):
        result = make_plate_result(np.zeros(64), 0.0, np.full(64, Status.ARRESTED))
        levels.append(layered(result, np.ones(64, dtype=int), depth + change))
    # Of depths spread over 8 mm 0.02 mm move the share by 0.0025; the finer level leaves as much again. By the cores
    # that change side it would be 0.06.
    shift = shift_of(Measure.parse("P(base_pierced)"), (levels[0], levels[1]))
    assert shift is not None
    assert 0.005 <= shift <= 0.01


def test_the_numerics_of_passing_follow_from_the_energies_where_no_core_changes_side(make_plate_result) -> None:
    # Three of four cores pass, and their residual energies are spread over a fifth of the impact energy.
    energy, status = (np.arange(96) + 0.5) / 96 * 0.2, np.repeat([Status.PERFORATED, Status.ARRESTED], [96, 32])
    levels, layers = [], np.repeat([-1, 1], [96, 32])
    for change in (0.0, 0.001):
        velocity = np.concatenate([825.0 * np.sqrt(energy + change), np.zeros(32)])
        levels.append(layered(make_plate_result(velocity, 0.0, status), layers, np.zeros(128)))
    # 0.001 of 0.2 moves the share by 0.00375, twice that counts. By the cores that change side it would be 0.03.
    for event in ("base_perforated", "perforated", "stopped"):
        assert 0.0075 <= shift_of(Measure.parse(f"P({event})"), (levels[0], levels[1])) <= 0.01


def test_what_counts_in_the_base(mixed_behind) -> None:
    measures = named(mixed_behind)
    assert measures["P(base_perforated)"].value == pytest.approx(1 / 5)
    assert measures["P(base_pierced)"].value == pytest.approx(2 / 5)
    assert measures["mean(base_depth)"].value == pytest.approx((10 + 6 + 10 + 0 + 0) / 5)
    assert (measures["worst_point(base_depth)"].value, measures["mean(base_depth)"].measure.display.shown) == (
        pytest.approx(10.0),
        "mm",
    )
    text = text_of(effectiveness_view(mixed_behind))
    assert text.index("P(base perforated)") < text.index("residual energy fraction")
    assert "40.0% of the cores come out of the rear face of the base" in text


def test_the_thickness_of_the_base_is_that_of_the_shot(mixed_behind) -> None:
    own = np.stack([np.full(6, 4e-3), [8e-3, 9e-3, 12e-3, 5e-3, 5e-3, 5e-3]], axis=1)
    scattered = mixed_behind.assign(layer_thickness=(("hit", "layer"), own))
    assert named(scattered)["mean(base_depth)"].value == pytest.approx((8 + 6 + 12 + 0 + 0) / 5)


def test_the_solid_plate_of_the_whole_target_is_perforated_or_not(quarter) -> None:
    measure = named(quarter)["P(base_perforated)"]
    assert (measure.value, measure.solid, measure.ratio) == (pytest.approx(0.25), 1.0, pytest.approx(0.25))
    assert math.isnan(named(quarter)["mean(base_depth)"].solid)


def test_targets_are_ranked_by_the_depth_in_bases_that_hold(make_plate_result) -> None:
    numbers, held = np.random.default_rng(2), np.ones(400, dtype=int)
    depth = numbers.uniform(2e-3, 6e-3, 400)
    result = make_plate_result(np.zeros(400), 0.0, Status.ARRESTED)
    good, bad = layered(result, held, depth), layered(result, held, depth + 1e-3)
    comparison = compare({"bad": bad, "good": good})
    assert comparison.ranks("mean(base_depth)") == {"good": (1, 1), "bad": (2, 2)}
    # A thinner base that is pierced would win by its bound alone.
    thin = layered(result, held, depth + 1e-3, base=3e-3)
    comparison = compare({"thin": thin, "good": good})
    assert not comparison.is_ranked("mean(base_depth)")
    assert comparison.first("P(base_pierced)") == ["good"]
    assert "depths are not ranked" in text_of(comparison_view(comparison))
    assert "not ranked" in {axes.get_title(loc="left") for axes in comparison_figure(comparison, every=True).axes}


def test_a_plate_without_layers_is_compared_in_what_both_have(make_plate_result, mixed_behind) -> None:
    alone = make_plate_result(np.full(6, 500.0))
    comparison = compare({"layered": mixed_behind, "alone": alone})
    assert list(comparison.measures) == list(effectiveness(alone).index)
    assert "No base, because no table [[layer]]: alone." in text_of(comparison_view(comparison))


def test_a_base_alone_is_the_base_and_takes_no_measure_away(make_plate_result, quarter) -> None:
    """It has one layer, so a share of cores that pass, but no depth in a base."""
    alone = make_plate_result(np.full(400, 500.0))
    names, references = ["plate", "solid, same weight", "base alone"], ["solid, same weight", "base alone"]
    solid = make_plate_result(np.full(400, 100.0), 0.0, Status.ARRESTED)
    solid = layered(solid, np.ones(400, dtype=int), np.full(400, 5e-3))
    comparison = compare(dict(zip(names, [quarter, solid, alone], strict=True)), references=references)
    assert list(comparison.measures) == list(effectiveness(quarter).index)
    assert comparison.scores["P(base_perforated)"]["value"].tolist() == [0.25, 0.0, 1.0]
    assert verdict_of(comparison) == ["Best by P(base perforated): solid, same weight."]
    assert comparison.ranks("mean(base_depth)").keys() == {"plate", "solid, same weight"}
    assert comparison.scores["mean(base_depth)"]["value"].isna().tolist() == [False, False, True]
    text = text_of(comparison_view(comparison))
    assert re.search(r"\nbase alone +- +23\.55 +- +-\n", text)
    assert "Measures of a base are left out" not in text


def limits(result: xarray.Dataset, thickness: np.ndarray, elsewhere: float) -> xarray.Dataset:
    """The result of a search of the limit thickness of a base [m] behind so many kg/m²."""
    ends = (thickness, thickness, np.ones(len(thickness)), np.ones(len(thickness), dtype=bool))
    actual = result.assign(
        stored_columns(LIMITS["thickness"], dict(zip(LIMITS["thickness"], (thickness, *ends), strict=True)))
    )
    message = {"limit": "thickness", "limit_layer": 1, "limit_highest": 20e-3, "limit_density": 8000.0}
    return actual.assign_attrs(message | {"limit_elsewhere": elsewhere})


def test_targets_are_ranked_by_the_weight_that_they_need(make_plate_result) -> None:
    result, numbers = make_plate_result(np.zeros(400)), np.random.default_rng(2)
    thickness = numbers.uniform(4e-3, 6e-3, 400)
    thickness[0] = np.inf  # not stopped by 20 mm
    front, base = limits(result, thickness - 1e-3, 20.0), limits(result, thickness, 0.0)
    measures = named(front)
    expected = np.minimum(thickness - 1e-3, 20e-3)
    assert measures["H50"].value == pytest.approx(1e3 * np.median(expected))
    needed = measures["quantile(limit_areal_density, 0.5)"]
    assert needed.value == pytest.approx(20.0 + 8000.0 * np.median(expected))
    assert "solid plate" not in text_of(effectiveness_view(front))
    comparison = compare({"with a plate": front, "base alone": base.assign_attrs(areal_density=99.0)})
    assert comparison.first("H50") == ["with a plate"]
    assert comparison.first("quantile(limit_areal_density, 0.5)") == ["base alone"]
    with pytest.raises(ResultError, match="limit"):
        compare({"limits": front, "run": result})


def test_limits_are_ranked_by_their_median(make_plate_result) -> None:
    """The mean of the one is lower, but half of its hits need more."""
    result = make_plate_result(np.zeros(400))
    low = limits(result, np.repeat([2e-3, 8e-3, 8.1e-3, 8.2e-3], 100), 0.0)
    high = limits(result, np.repeat([6e-3, 7e-3, 7.1e-3, 9e-3], 100), 0.0)
    comparison = compare({"low mean": low, "low median": high})
    assert deciding_measure(comparison).text == "H50"
    assert comparison.first("H50") == ["low median"]
    assert not any(text.startswith("mean") for text in comparison.measures)
