"""Effectiveness against values computed by hand, and intervals that contain the answer as often as they claim."""

import math
import re
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.analysis.effectiveness import effectiveness, effectiveness_view
from warpimpact.analysis.numbers import text_of
from warpimpact.kernels.status import Status
from warpimpact.results.files import ResultError

from .references import with_solid

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


def test_the_table_says_what_a_result_carries(mixed, make_result) -> None:
    text = text_of(effectiveness_view(make_result(8).drop_vars("presented_area")))
    assert "residual energy fraction, mean" in text
    assert "solid plate" not in text  # no reference
    assert "proxy" not in text  # no silhouette
    _, _, first, *_ = text_of(effectiveness_view(with_solid(mixed, np.array([800.0])))).splitlines()
    assert first.split()[:5] == ["residual", "energy", "fraction,", "mean", "40.00%"]
    assert first.split()[-5:] == ["64.00%", "0.6250", "(0.000", "to", "1.459)"]
