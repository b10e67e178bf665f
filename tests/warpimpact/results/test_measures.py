"""Measures of a Dataset: which shots count, and intervals that contain the answer as often as they claim."""

import numpy as np
import pytest
import xarray

from warpimpact.kernels.status import Status
from warpimpact.results.measures import Measure
from warpimpact.results.tallies import Tally

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


@pytest.mark.parametrize("text", TRUTHS)
def test_intervals_of_independent_shots_hold_as_often_as_they_say(text: str) -> None:
    held, numbers = 0, np.random.default_rng(7)
    for _ in range(TRIALS):
        tally = Tally(Measure.parse(text))
        for _ in range(2):
            tally.add(shard_of(numbers.random((200, 2)).sum(axis=1)))
        estimate = tally.estimate()
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
        tally = Tally(Measure.parse(text))
        tally.add(mixed)
        assert (tally.estimate().value, tally.estimate().count) == (pytest.approx(value), count), text


def test_a_standoff_that_a_result_lacks_is_refused() -> None:
    with pytest.raises(ValueError, match="got 100 mm, but the stand-offs are 130 mm"):
        Measure.parse("P(tilt@100mm > 30 deg)").values(shard_of(np.zeros(3)))
