"""Distributions of a map: quantiles at the right places, correct intervals, and no values without hits."""

import numpy as np
import pytest

from warpimpact.analysis.hit_map import NEIGHBOURS, plane_fit
from warpimpact.kernels.status import Status
from warpimpact.plotting import dispersion, marginals, measure_map, uncertainty

MIXED = [Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED]


def test_intervals_hold_the_plane_as_often_as_they_say():
    random, points = np.random.default_rng(2), 4000
    offsets = random.uniform(-1.0, 1.0, (points, NEIGHBOURS, 2))
    value, half_width = plane_fit(offsets, 5.0 + offsets @ [2.0, 1.0] + random.normal(0.0, 3.0, (points, NEIGHBOURS)))
    share = np.mean(np.abs(value - 5.0) <= half_width)
    assert share == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / points))


def scattered(dataset):
    """Shots that arrive at different velocities."""
    velocity = dataset["impact_velocity"]
    return dataset.assign(impact_velocity=velocity + np.random.default_rng(6).normal(0.0, 5.0, velocity.size))


def test_where_nothing_scatters_nothing_is_uncertain(make_result):
    """A smooth map that bends is not uncertain for that."""
    with pytest.raises(ValueError, match="shots that all arrive alike"):
        uncertainty(make_result(512), "residual_velocity")


def test_uncertainty_shows_local_mean_and_interval_across_the_edges(make_result):
    dataset = make_result(2048)
    period = dataset.attrs["plate_period"][0]
    wave = np.cos(2.0 * np.pi * dataset["hit_y"] / period)  # continues across the edges
    noise = np.random.default_rng(4).normal(0.0, 2.0, 2048)
    dataset["residual_velocity"].values[:] = 700.0 + 50.0 * wave + noise
    figure = uncertainty(scattered(dataset), "residual_velocity")
    value, half_width = (np.asarray(axes.images[0].get_array()) for axes in figure.axes[:2])
    truth = 700.0 + 50.0 * np.cos(2.0 * np.pi * ((np.arange(100) + 0.5) / 100 - 0.5))
    held = np.mean(np.abs(value - truth) <= half_width)
    assert 0.9 < held < 0.99
    assert np.abs(value - truth)[:, [0, -1]].max() < 4.0
    assert np.median(half_width) == pytest.approx(2.08 * 2.0 / np.sqrt(NEIGHBOURS), rel=0.1)


def test_probability_map_holds_the_share_at_every_place(make_result):
    dataset = make_result(4096)
    chance = 0.5 + 0.3 * np.sin(2.0 * np.pi * dataset["hit_y"].values / dataset.attrs["plate_period"][0])
    beyond = np.random.default_rng(5).random(4096) < chance
    dataset["residual_velocity"].values[:] = np.where(beyond, 800.0, 600.0)
    figure = measure_map(scattered(dataset), "P(residual_velocity > 700 m/s)")
    share, half_width = (np.asarray(axes.images[0].get_array()) for axes in figure.axes[:2])
    truth = 0.5 + 0.3 * np.sin(2.0 * np.pi * ((np.arange(share.shape[1]) + 0.5) / share.shape[1] - 0.5))
    assert 0.9 < np.mean(np.abs(share - truth) <= half_width) < 0.99
    # Wilson's of one half among 24 hits: 1.96 · √(1/(4·24) + 1.96²/(4·24²)) / (1 + 1.96²/24) = 0.186.
    assert half_width.max() == pytest.approx(0.186, abs=5e-4)


def test_marginals_are_the_quantiles_of_strips(make_result):
    dataset = make_result(1000)
    dataset["residual_velocity"].values[:] = 700.0 + 1e3 * dataset["hit_y"]
    above, centre, neighbour, histogram, _ = marginals(dataset, "residual_velocity").axes
    (median,) = above.lines
    np.testing.assert_allclose(median.get_ydata(), 700.0 + median.get_xdata(), atol=0.2)
    assert len(median.get_xdata()) == 20
    (median,) = neighbour.lines
    np.testing.assert_allclose(median.get_xdata(), 700.0, atol=4.0)
    assert sum(patch.get_width() for patch in histogram.patches) == 1000
    assert (above.get_xlim(), neighbour.get_ylim()) == (centre.get_xlim(), centre.get_ylim())


def test_dispersion_shows_each_core_behind_the_plate(make_result):
    dataset = make_result(np.tile(MIXED, 100))
    above, centre, *_ = dispersion(dataset, 0.05).axes
    assert centre.get_xlabel() == "tilt, 50 mm behind the plate [°]"
    assert centre.get_ylabel() == "residual velocity [m/s]"
    behind = dataset.isel(hit=np.isin(dataset["status"], [Status.PERFORATED, Status.UNTOUCHED]))
    expected = np.stack([behind["tilt"][:, 0], behind["residual_velocity"]], axis=-1)
    np.testing.assert_allclose(centre.collections[0].get_offsets(), expected)
    assert sum(patch.get_height() for patch in above.patches) == 200
