"""Measures of a Dataset: which shots count, and intervals that contain the answer as often as they claim."""

import re

import numpy as np
import pytest
import xarray

from warpimpact.kernels.status import Status
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.statistics.intervals import Estimate

TRIALS, LEAST = 150, 134
"""95 % of 150 trials: 142.5 ± 2.7; three standard deviations below."""
TRUTHS = {
    # Of U(0, 1) + U(0, 1): the triangular distribution on 0 to 2.
    "mean(residual_velocity)": 1.0,
    "quantile(residual_velocity, 0.125)": 0.5,
    "P(residual_velocity > 1.5 m/s)": 0.125,
    "P(tilt@130mm < 0.2 deg)": 0.02,
}


def shard_of(values: np.ndarray, status: int = Status.PERFORATED) -> xarray.Dataset:
    """A shard with these residual velocities [m/s], and as much tilt [degree] at its only stand-off."""
    variables = dict.fromkeys(("residual_velocity", "deflection"), ("hit", values))
    variables |= dict.fromkeys(("energy_loss", "contact_duration"), ("hit", values))
    variables |= dict.fromkeys(("tilt", "pitch", "yaw", "total_yaw"), (("hit", "standoff"), values[:, None]))
    variables["status"] = ("hit", np.full(len(values), status, dtype=np.int8))
    return xarray.Dataset(variables, {"standoff": [0.13]}, {"compute_time": 1.0})


def estimate_in(dataset: xarray.Dataset, text: str) -> Estimate:
    measure = Measure.parse(text)
    return estimate_from(measure, measure.values(dataset))


@pytest.mark.parametrize("text", TRUTHS)
def test_intervals_of_independent_shots_hold_as_often_as_they_say(text: str) -> None:
    held, numbers = 0, np.random.default_rng(7)
    for _ in range(TRIALS):
        estimate = estimate_in(shard_of(numbers.random((400, 2)).sum(axis=1)), text)
        held += estimate.low <= TRUTHS[text] <= estimate.high
    assert held >= LEAST


def test_what_failed_or_stayed_counts_where_it_says() -> None:
    mixed = xarray.concat(
        [
            shard_of(np.array([700.0, 720.0])),
            shard_of(np.array([0.0]), Status.ARRESTED),
            *(shard_of(np.array([5.0]), status) for status in Status if status.failed),
        ],
        dim="hit",
    )
    expected = {
        "mean(residual_velocity)": (710.0, 2),
        "P(residual_velocity < 705 m/s)": (0.5, 2),
        "P(perforated)": (2 / 3, 3),
        "P(arrested)": (1 / 3, 3),
        "quantile(residual_velocity, 0.5)": (710.0, 2),
    }
    for text, (value, count) in expected.items():
        estimate = estimate_in(mixed, text)
        assert (estimate.value, estimate.count) == (pytest.approx(value), count), text


def test_residual_energy_is_that_of_the_core_that_came_through(make_plate_result) -> None:
    ends = np.array([Status.PERFORATED, Status.UNTOUCHED, Status.RICOCHETED, Status.UNFINISHED, Status.PERFORATED])
    result = make_plate_result(np.array([150.0, 250.0, 300.0, np.nan, 200.0]), status=ends)
    energy = [0.5 * 0.004 * velocity**2 for velocity in (150.0, 250.0, 0.0, np.nan, 200.0)]  # [J], a core of 4 g
    assert Measure.parse("mean(residual_energy)").values(result) == pytest.approx(energy, nan_ok=True)
    estimate = estimate_in(result, "P(residual_energy > 80 J)")
    assert (estimate.value, estimate.count) == (1 / 4, 4)  # 125 J; 80 J are not beyond 80 J


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("mean(residual_velcity)", "did you mean mean(residual_velocity)?"),
        ("P(tilt)", 'got "tilt", which takes the form mean(tilt) or P(tilt > …)'),
        ("median(tilt)", "but it must be of the form mean("),
        ("quantile(tilt)", "but quantile(…) takes a share"),
        ("worst_tenth(tilt)", "neither a high nor a low tilt is worse"),
        ("mean(base_depth@130mm)", "base_depth has no stand-off"),
        ("P(residual_energy_density > 5 mm)", 'got "5 mm", which is not an energy per area'),
    ],
)
def test_a_text_that_is_no_measure_is_reported_in_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        Measure.parse(text)


@pytest.mark.parametrize(
    ("text", "title", "better"),
    [
        ("V50", "limit velocity, 50 % quantile [m/s]", "higher is better"),
        ("P(inclination@130mm > 30 deg)", "P(inclination at 130 mm > 30°, or stopped)", "higher is better"),
        (
            "worst_tenth(residual_energy_density@50mm)",
            "proxy: energy per presented area at 50 mm, worst tenth [J/mm²]",
            "",
        ),
        ("mean(limit_thickness@layer 1)", "limit thickness of layer 1, mean [mm]", "lower is better"),
        ("mean(yaw@50mm)", "yaw at 50 mm, mean [°]", "neither is better"),
    ],
)
def test_words_and_direction_of_a_measure(text: str, title: str, better: str | None) -> None:
    measure = Measure.parse(text)
    assert measure.title == title
    assert measure.better == (better or "lower is better")


def test_a_standoff_that_a_result_lacks_is_refused() -> None:
    with pytest.raises(ValueError, match="got 100 mm, but the stand-offs are 130 mm"):
        Measure.parse("P(tilt@100mm > 30 deg)").values(shard_of(np.zeros(3)))
