"""Probit of many tests against statsmodels, its intervals, and plans of n shots with at most k perforations."""

import numpy as np
import pytest
import statsmodels.api as sm
from numpy.typing import NDArray
from scipy import optimize, stats

from warpimpact.statistics.quantal import (
    acceptance,
    fewest_shots,
    fit_quantal,
    likelihood_interval,
    scale_interval,
    shown_stop_probability,
)

Array = NDArray[np.float64]


def shots(tests: int, count: int, seed: int = 0) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    rng = np.random.default_rng(seed)
    levels = rng.normal(800.0, 30.0, (tests, count))
    answers = levels > rng.normal(800.0, 25.0, (tests, count))
    return levels, answers, rng.random((tests, count)) < 0.9


@pytest.mark.parametrize("count", [12, 40])
def test_the_fit_is_that_of_statsmodels(count: int) -> None:
    levels, answers, used = shots(60, count)
    fit = fit_quantal(levels, answers, used)
    assert fit.overlap.sum() > 30
    for row in np.flatnonzero(fit.overlap):
        x, y = levels[row, used[row]], answers[row, used[row]].astype(float)
        actual = sm.Probit(y, sm.add_constant(x - 800.0)).fit(disp=0, method="newton", maxiter=200)
        at, slope = actual.params
        assert fit.location[row] == pytest.approx(800.0 - at / slope, abs=1e-4)
        assert fit.scale[row] == pytest.approx(1.0 / slope, rel=1e-5)
        assert fit.log_likelihood[row] == pytest.approx(actual.llf, rel=1e-8)


def test_ends_of_the_likelihood_interval_lie_where_the_profile_has_fallen_by_half_of_chi_square() -> None:
    levels, answers, used = shots(40, 20, seed=1)
    fit = fit_quantal(levels, answers, used)
    drop, checked = 0.5 * stats.chi2.ppf(0.95, 1), 0
    for end in likelihood_interval(levels, answers, used, fit):
        for row in np.flatnonzero(np.isfinite(end) & fit.overlap):
            z = np.where(answers[row], 1.0, -1.0) * (levels[row] - end[row])

            def lost(log_slope: float, z: Array = z, row: int = row) -> float:
                return -float(stats.norm.logcdf(np.exp(log_slope) * z)[used[row]].sum())

            least = min(
                optimize.minimize_scalar(lost, bounds=ends, method="bounded").fun for ends in ((-9, -3), (-3, 3))
            )
            assert fit.log_likelihood[row] + least == pytest.approx(drop, abs=2e-4)
            checked += 1
    assert checked > 50


def test_ends_of_the_interval_of_the_scale_lie_where_the_profile_has_fallen() -> None:
    """The likelihood at the ends is 1.92 below the maximum; without overlap the interval begins at 0."""
    levels, answers, _ = shots(40, 20, seed=1)
    drop, checked = 0.5 * stats.chi2.ppf(0.95, 1), 0
    for x, y in zip(levels, answers, strict=True):
        fit = fit_quantal(x[None], y[None], np.ones((1, len(x)), dtype=bool))
        low, high = scale_interval(x, y, fit)
        assert (low > 0.0) == fit.overlap[0]
        for end in (low, high):
            if 0.0 < end < np.inf:
                grid = np.linspace(x.min() - 4.0 * end, x.max() + 4.0 * end, 20001)[:, None]
                best = stats.norm.logcdf(np.where(y, 1.0, -1.0) * (x - grid) / end).sum(axis=1).max()
                assert fit.log_likelihood[0] - best == pytest.approx(drop, abs=1e-3)
                checked += 1
    assert checked > 50


@pytest.mark.parametrize(
    ("answers", "location", "scale"),
    [([0, 0, 1, 1], 825.0, np.nan), ([0, 0, 0, 0], np.nan, np.nan), ([1, 1, 0, 0], np.nan, np.nan)],
    ids=["apart", "all alike", "falling"],
)
def test_answers_without_a_rising_curve(answers: list[int], location: float, scale: float) -> None:
    levels = np.array([[790.0, 810.0, 840.0, 860.0]])
    y = np.array([answers], dtype=bool)
    fit = fit_quantal(levels, y, np.ones_like(y))
    assert (fit.location[0], fit.scale[0]) == pytest.approx((location, scale), nan_ok=True)
    low, high = likelihood_interval(levels, y, np.ones_like(y), fit)
    assert np.isfinite(location) == bool(low[0] < location < high[0])


def test_a_likelihood_interval_holds_as_often_as_it_says_with_many_shots() -> None:
    levels, answers, used = shots(1000, 60, seed=2)
    fit = fit_quantal(levels, answers, used)
    low, high = likelihood_interval(levels, answers, used, fit)
    held = int(((low < 800.0) & (high > 800.0)).sum())
    assert 930 <= held <= 968  # 950 of 1000, ± 2.6 standard deviations


@pytest.mark.parametrize(("allowed", "shots"), [(0, 22), (1, 38), (2, 52), (3, 65)])
def test_the_fewest_shots_at_90_percent_are_the_published_ones(allowed: int, shots: int) -> None:
    assert fewest_shots(allowed, 0.9, 0.9) == shots
    assert acceptance(shots, allowed, 0.1) <= 0.1 < acceptance(shots - 1, allowed, 0.1)
    assert shown_stop_probability(shots, allowed, 0.9) >= 0.9 > shown_stop_probability(shots - 1, allowed, 0.9)


@pytest.mark.parametrize("perforations", [0, 1, 5, 22])
def test_the_bound_is_that_of_clopper_and_pearson(perforations: int) -> None:
    if perforations < 22:
        actual = stats.binomtest(22 - perforations, 22, alternative="greater").proportion_ci(0.9, method="exact").low
    else:
        actual = 0.0
    assert shown_stop_probability(22, perforations, 0.9) == pytest.approx(actual)


def test_shots_at_the_same_place_show_less() -> None:
    """A tenth of the places always perforates: 22 shots there accept 90 % of the time, at any places 0.9²²."""
    by_place = np.repeat([1.0, 0.0], [1, 9])
    assert acceptance(22, 0, by_place).mean(axis=-1) == pytest.approx(0.9)
    assert acceptance(22, 0, by_place.mean()) == pytest.approx(0.9**22)
