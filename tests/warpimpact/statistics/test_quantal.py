"""Probit and logit of many tests against statsmodels; their intervals, and D-optimal levels."""

import numpy as np
import pytest
import statsmodels.api as sm
from numpy.typing import NDArray
from scipy import optimize, special, stats

from warpimpact.statistics.quantal import d_optimal, fit_quantal, likelihood_interval, wald_interval, weight

Array = NDArray[np.float64]
MODELS = {"probit": sm.Probit, "logit": sm.Logit}
CURVES = {"probit": stats.norm.logcdf, "logit": stats.logistic.logcdf}


def shots(tests: int, count: int, seed: int = 0) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    rng = np.random.default_rng(seed)
    levels = rng.normal(800.0, 30.0, (tests, count))
    answers = levels > rng.normal(800.0, 25.0, (tests, count))
    return levels, answers, rng.random((tests, count)) < 0.9


@pytest.mark.parametrize("link", MODELS)
@pytest.mark.parametrize("count", [12, 40])
def test_the_fit_and_its_wald_interval_are_those_of_statsmodels(link: str, count: int) -> None:
    levels, answers, used = shots(60, count)
    fit = fit_quantal(levels, answers, used, link)
    low, high = wald_interval(levels, used, fit, link=link)
    assert fit.overlap.sum() > 30
    for row in np.flatnonzero(fit.overlap):
        x, y = levels[row, used[row]], answers[row, used[row]].astype(float)
        found = MODELS[link](y, sm.add_constant(x - 800.0)).fit(disp=0, method="newton", maxiter=200)
        at, slope = found.params
        assert fit.location[row] == pytest.approx(800.0 - at / slope, abs=1e-4)
        assert fit.scale[row] == pytest.approx(1.0 / slope, rel=1e-5)
        assert fit.log_likelihood[row] == pytest.approx(found.llf, rel=1e-8)
        if link == "logit":  # of which the information seen is that expected; delta method
            along = np.array([-1.0 / slope, at / slope**2])
            half = 1.959964 * np.sqrt(along @ found.cov_params() @ along)
            assert (low[row], high[row]) == pytest.approx(
                (fit.location[row] - half, fit.location[row] + half), rel=1e-6
            )


@pytest.mark.parametrize("link", MODELS)
def test_ends_of_the_likelihood_interval_lie_where_the_profile_has_fallen_by_half_of_chi_square(link: str) -> None:
    levels, answers, used = shots(40, 20, seed=1)
    fit = fit_quantal(levels, answers, used, link)
    drop, checked = 0.5 * stats.chi2.ppf(0.95, 1), 0
    for end in likelihood_interval(levels, answers, used, fit, link=link):
        for row in np.flatnonzero(np.isfinite(end) & fit.overlap):
            z = np.where(answers[row], 1.0, -1.0) * (levels[row] - end[row])

            def lost(log_slope: float, z: Array = z, row: int = row) -> float:
                return -float(CURVES[link](np.exp(log_slope) * z)[used[row]].sum())

            least = min(
                optimize.minimize_scalar(lost, bounds=ends, method="bounded").fun for ends in ((-9, -3), (-3, 3))
            )
            assert fit.log_likelihood[row] + least == pytest.approx(drop, abs=2e-4)
            checked += 1
    assert checked > 50


@pytest.mark.parametrize(
    ("answers", "location", "scale"),
    [([0, 0, 1, 1], 825.0, 0.0), ([0, 0, 0, 0], np.nan, np.nan), ([1, 1, 0, 0], np.nan, np.nan)],
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


def test_d_optimal_levels_of_a_balanced_test_lie_at_1_138_scales() -> None:
    """w(z)² z² is greatest at z = 1.138, the two points of the D-optimal design of a probit (Neyer 1994)."""
    best = optimize.minimize_scalar(
        lambda z: -((float(weight(np.array(z))) * z) ** 2), bounds=(0.5, 2.0), method="bounded"
    )
    assert best.x == pytest.approx(1.138, abs=5e-4)
    levels = 800.0 + 20.0 * best.x * np.array([[-1.0, 1.0] * 10 + [-1.0]])
    used = np.ones_like(levels, dtype=bool)
    found = d_optimal(levels, used, np.array([800.0]), np.array([20.0]))
    assert found[0] == pytest.approx(800.0 + 20.0 * best.x, abs=0.5)
    z = np.linspace(-4, 4, 80001)
    w, own = weight(z), weight((levels - 800.0) / 20.0)
    t = (levels - 800.0) / 20.0
    gain = ((own.sum() + w) * ((own * t * t).sum() + w * z * z)) - ((own * t).sum() + w * z) ** 2
    assert found[0] == pytest.approx(800.0 + 20.0 * z[gain.argmax()], abs=0.02)
    assert weight(np.array(0.0)) == pytest.approx(2.0 / np.pi)
    assert weight(np.array(0.0), "logit") == pytest.approx(special.expit(0.0) ** 2)
