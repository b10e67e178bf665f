"""What earlier hits change, of results whose answer is known."""

import math

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

from warpimpact.analysis.bursts import bursts, bursts_view
from warpimpact.analysis.inspect import inspect_text
from warpimpact.kernels.status import Status
from warpimpact.plotting import bursts_figure
from warpimpact.view.view import text_of

SAMPLES, MEMBERS, REACH = 800, 4, 6e-3


def made(make_plate_result: object, gain: float = 30.0, **told: object) -> xarray.Dataset:
    """Bursts whose hits gain 30 m/s at distance 0 from the nearest earlier one, less farther away, nothing from 6 mm
    on; the place of the aim matters more than that, and all hits of a burst share it."""
    rng = np.random.default_rng(4)
    nearest = rng.uniform(0.0, 12e-3, (SAMPLES, MEMBERS))
    nearest[:, 0] = np.nan
    noise = rng.normal(0.0, 20.0, (SAMPLES, 1)) + rng.normal(0.0, 5.0, (SAMPLES, MEMBERS))
    velocity = 700.0 + gain * np.nan_to_num(np.maximum(0.0, 1.0 - nearest / REACH)) + noise
    status = np.where(nearest < 1e-3, Status.MISSED, Status.PERFORATED)
    result = make_plate_result(velocity.ravel(), status=status.ravel(), **{"shots_at_a_plate": MEMBERS} | told)
    for name in ("impact_velocity", "obliquity"):
        result[name].attrs["units"] = "degree" if name == "obliquity" else "m s-1"
    return result.assign(
        sample=("hit", np.repeat(np.arange(SAMPLES), MEMBERS)),
        burst_order=("hit", np.tile(np.arange(MEMBERS), SAMPLES)),
        nearest_earlier_hit=("hit", nearest.ravel()),
    )


@pytest.fixture
def result(make_plate_result: object) -> xarray.Dataset:
    return made(make_plate_result)


def test_groups_have_their_means(result: xarray.Dataset) -> None:
    found, velocity = bursts(result), result["residual_velocity"].values.reshape(SAMPLES, MEMBERS)
    measure = found.measures[0]
    for order, group in enumerate(found.orders):
        assert group.estimates[measure].value == pytest.approx(velocity[:, order].mean())
        assert group.count == SAMPLES
    gained = 30.0 * REACH / 2.0 / 12e-3  # of later hits, on average
    later = [group.differences[measure] for group in found.orders[1:]]
    for difference in later:
        assert difference.low < gained < difference.high
        # The place of the aim is common to a burst and drops out of the difference.
        assert difference.half_width < 1.5
    assert sum(group.count for group in found.distances) == SAMPLES * (MEMBERS - 1)
    assert np.ptp([group.count for group in found.distances]) <= 1
    for group in found.distances:
        expected = 30.0 * max(0.0, 1.0 - group.distance[1] / REACH)
        assert group.differences[measure].low - 1.0 < expected < group.differences[measure].high + 1.0


def test_the_distance_from_which_nothing_is_noticed(result: xarray.Dataset, make_plate_result: object) -> None:
    found = bursts(result)
    assert 4e-3 < found.noticed_within(found.measures[0]) <= 6.1e-3
    assert found.noticed_within(found.measures[1]) == 0.0  # the tilt is the same for all
    without = bursts(made(make_plate_result, gain=0.0))
    assert without.noticed_within(without.measures[0]) == 0.0
    faster = result["residual_velocity"] + 40.0 * (result["burst_order"] > 0)
    everywhere = bursts(result.assign(residual_velocity=faster))
    assert math.isinf(everywhere.noticed_within(everywhere.measures[0]))


def test_few_distances_have_a_bin_each(result: xarray.Dataset) -> None:
    nearest = np.tile([np.nan, 5e-3, 5e-3, 2e-3], SAMPLES)
    found = bursts(result.assign(nearest_earlier_hit=("hit", nearest)))
    assert [group.name for group in found.distances] == ["2.0", "5.0"]
    assert [group.count for group in found.distances] == [SAMPLES, 2 * SAMPLES]


def test_replicates_give_the_intervals(make_plate_result: object) -> None:
    found = bursts(made(make_plate_result, sampling="sobol", seed=1, replicates=16))
    assert 0.2 < found.orders[0].estimates[found.measures[0]].half_width < 4.0


def test_tables_and_figure(result: xarray.Dataset) -> None:
    text = text_of(bursts_view(bursts(result)))
    assert "from the nearest earlier hit" in text
    assert "P(perforated): differs from that of first hits up to 1.0 mm" in text
    assert text in inspect_text(result)
    figure = bursts_figure(result)
    assert isinstance(figure, Figure)
    shown = {axes.get_ylabel() for axes in figure.axes} - {""}
    assert shown == {"residual velocity [m/s]", "P(perforated)"}  # the tilt does not vary
    figure.canvas.draw()
