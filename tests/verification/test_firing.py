"""Firing tests at targets that are known: exact enumeration, published operating figures, and what is known by hand."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from warpimpact.firing.estimators import Estimator, reported
from warpimpact.firing.fire import Firings, fire
from warpimpact.firing.procedures import Langlie, MilStd662F, Neyer, Procedure, ThreePod, UpAndDown
from warpimpact.firing.response import Response, known_response, normal_response
from warpimpact.statistics.acceptance import acceptance
from warpimpact.statistics.quantal import weight

Array = NDArray[np.float64]

MEAN, DEVIATION = 800.0, 25.0
PROCEDURES: dict[str, Procedure] = {
    "up_and_down": UpAndDown(start=815.0, step=25.0, shots=10),
    "mil_std_662f": MilStd662F(start=815.0, most_shots=10, pairs=2),
    "langlie": Langlie(lowest=700.0, highest=900.0, shots=10),
    "neyer": Neyer(lowest=700.0, highest=900.0, spread=30.0, shots=10),
    "3pod": ThreePod(lowest=700.0, highest=900.0, spread=30.0, shots=10),
}


@dataclass
class Answers:
    """A target whose shots answer what their place says: 0 stop, 1 perforation."""

    def perforates(self, place: NDArray[np.int64], velocity: Array) -> NDArray[np.bool_]:
        return np.asarray(place == 1)


def simulated(procedure: Procedure, response: Response, tests: int, seed: int = 0) -> Firings:
    places = np.random.default_rng(seed).integers(0, len(response), (tests, procedure.most))
    return fire(procedure, response, places, np.zeros((tests, procedure.most)))


def every_path(procedure: Procedure) -> tuple[Firings, Array]:
    """A test for every sequence of answers, and its probability for a normal response."""
    shots = procedure.most
    answers = np.arange(2**shots)[:, None] >> np.arange(shots) & 1
    firings = fire(procedure, Answers(), answers, np.zeros(answers.shape))
    z = np.where(firings.perforated, 1.0, -1.0) * (firings.velocity - MEAN) / DEVIATION
    unused = (~firings.used).sum(axis=1)  # a path that ends early occurs 2^unused times
    return firings, np.where(firings.used, special.ndtr(z), 1.0).prod(axis=1) / 2.0**unused


@pytest.mark.parametrize("name", PROCEDURES)
def test_ten_shots_report_what_all_1024_sequences_of_answers_give(name: str) -> None:
    """Mean and standard deviation of the reported V50 and its spread, exact, beside 4000 tests: within 4 standard
    errors."""
    procedure, estimator = PROCEDURES[name], Estimator(interval="none")
    firings, probability = every_path(procedure)
    assert probability.sum() == pytest.approx(1.0, abs=1e-9)
    drawn = reported(simulated(procedure, normal_response(MEAN, DEVIATION), 4000), procedure, estimator)
    exact = reported(firings, procedure, estimator)
    for one, other in ((exact.v50, drawn.v50), (exact.spread, drawn.spread)):
        known, found = np.isfinite(one), other[np.isfinite(other)]
        share = probability[known].sum()
        mean = (probability[known] * one[known]).sum() / share
        deviation = np.sqrt((probability[known] * (one[known] - mean) ** 2).sum() / share)
        assert found.mean() == pytest.approx(mean, abs=4.0 * deviation / np.sqrt(len(found)))
        fourth = (probability[known] * (one[known] - mean) ** 4).sum() / share
        error = np.sqrt((fourth - deviation**4) / len(found)) / (2.0 * deviation)
        assert found.std() == pytest.approx(deviation, abs=4.0 * error)
        assert len(found) / 4000 == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 4000) + 1e-9)


def test_levels_of_an_up_and_down_test_have_their_stationary_distribution() -> None:
    """π_k p_k = π_{k−1} (1 − p_{k−1}): as many tests go down from a level as go up to it."""
    procedure = UpAndDown(start=MEAN, step=DEVIATION, shots=60)
    aimed = simulated(procedure, normal_response(MEAN, DEVIATION), 2000).aimed[:, 40:]
    levels = MEAN + DEVIATION * np.arange(-5, 6)
    p = special.ndtr((levels - MEAN) / DEVIATION)
    law = np.cumprod([1.0, *((1.0 - p[:-1]) / p[1:])])
    counts = np.array([(np.abs(aimed - level) < 1e-6).sum() for level in levels])
    assert counts.sum() == aimed.size
    for parity in (0, 1):  # odd and even shots are on levels of their own
        own = slice(parity, None, 2)
        assert counts[own] / counts[own].sum() == pytest.approx(law[own] / law[own].sum(), abs=0.012)


def test_dixon_and_mood_find_v50_with_their_published_error() -> None:
    """For steps of one standard deviation the error of V50 is G σ/√N, with G = 1.0 and N the rarer answers, half of the
    shots; the spread is unbiased for many shots (Dixon and Mood 1948, figure 2 and section 4)."""
    procedure = UpAndDown(start=MEAN, step=DEVIATION, shots=100)
    firings = simulated(procedure, normal_response(MEAN, DEVIATION), 4000)
    found = reported(firings, procedure, Estimator(name="dixon_mood"))
    assert found.v50.mean() == pytest.approx(MEAN, abs=0.25)
    assert found.v50.std() / (DEVIATION / np.sqrt(50)) == pytest.approx(1.0, abs=0.06)
    assert found.spread.mean() / DEVIATION == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("name", ["neyer", "3pod"])
def test_d_optimal_tests_reach_the_error_of_the_two_point_design(name: str) -> None:
    """Half of n shots at each of μ ± 1.138 σ: σ(V50) = σ / √(n w(1.138)); the bias of the spread of Neyer's test is
    about −3.5 / n, as published summaries of his paper of 1994 quote it."""
    procedure = PROCEDURES[name].of_size(40)
    firings = simulated(procedure, normal_response(MEAN, DEVIATION), 1000)
    found = reported(firings, procedure, Estimator(interval="none"))
    v50, spread = found.v50[np.isfinite(found.v50)], found.spread[np.isfinite(found.spread)]
    design = DEVIATION / np.sqrt(40.0 * float(weight(np.array(1.138))))
    assert v50.mean() == pytest.approx(MEAN, abs=4.0 * design / np.sqrt(1000))
    assert v50.std() / design == pytest.approx(1.0, abs=0.1)
    assert spread.mean() / DEVIATION - 1.0 == pytest.approx(-3.5 / 40.0, abs=0.03)


@pytest.mark.parametrize("name", PROCEDURES)
def test_a_target_of_one_limit_is_enclosed(name: str) -> None:
    """No perforation below the limit, no stop above it; V50 lies between the last of both, spread is 0."""
    procedure = PROCEDURES[name].of_size(16) if name in ("langlie", "neyer") else PROCEDURES[name]
    firings = simulated(procedure, known_response([787.0], [1.0]), 5)
    assert (firings.perforated == (firings.velocity > 787.0))[firings.used].all()
    found = reported(firings, procedure, Estimator(name="probit"))
    below = np.where(firings.used & ~firings.perforated, firings.velocity, -np.inf).max(axis=1)
    above = np.where(firings.used & firings.perforated, firings.velocity, np.inf).min(axis=1)
    assert (below < 787.0).all()
    assert (above >= 787.0).all()
    assert found.v50 == pytest.approx(0.5 * (below + above))
    assert (found.spread == 0.0).all()
    assert ((found.low <= 787.0) & (found.high >= 787.0)).all()
    if name == "langlie":  # it halves the range
        assert above[0] - below[0] <= 200.0 / 2**7


def test_a_plate_of_two_values_is_known_by_hand() -> None:
    """Three tenths of the hits perforate above 700 m/s, the others above 900 m/s. V50 = 900 m/s, V05 = 700 m/s. At 800
    m/s 22 shots pass with 0.7²², and with 0.7 if they all hit one place. A test between the two values is blind: every
    shot perforates with 0.3, and steps of 10 m/s from 800 m/s on drift upwards to 900 m/s."""
    plate = known_response([700.0, 900.0], [3.0, 7.0])
    assert [plate.quantile(share) for share in (0.05, 0.25, 0.5, 0.99)] == [700.0, 700.0, 900.0, 900.0]
    assert [plate.estimate(speed).value for speed in (650.0, 800.0, 950.0)] == pytest.approx([0.0, 0.3, 1.0])
    by_place = plate.by_place(np.array([800.0]), np.zeros(1))
    assert acceptance(22, 0, by_place.mean(axis=1)) == pytest.approx(0.7**22)
    assert acceptance(22, 0, by_place).mean(axis=-1) == pytest.approx(0.7)
    procedure = UpAndDown(start=800.0, step=10.0, shots=6)
    aimed = simulated(procedure, plate, 4000).aimed[:, 5]
    assert aimed.mean() == pytest.approx(800.0 + 5 * 10.0 * (0.7 - 0.3), abs=4.0 * 20.5 / np.sqrt(4000))


@pytest.mark.parametrize("interval", ["likelihood", "wald"])
@pytest.mark.parametrize("name", ["up_and_down", "langlie", "neyer", "3pod"])
def test_coverage_counted_on_1000_tests_is_that_of_all_sequences(name: str, interval: str) -> None:
    """How often the 95 % interval of ten shots contains V50: short tests claim too much, by Fisher's information more
    than by the likelihood."""
    procedure, estimator = PROCEDURES[name], Estimator(interval=interval)
    firings, probability = every_path(procedure)
    exact = reported(firings, procedure, estimator)
    known, held = np.isfinite(exact.v50) & ~np.isnan(exact.low), (exact.low <= MEAN) & (exact.high >= MEAN)
    coverage = probability[known & held].sum() / probability[known].sum()
    drawn = reported(simulated(procedure, normal_response(MEAN, DEVIATION), 1000), procedure, estimator)
    counted = ((drawn.low <= MEAN) & (drawn.high >= MEAN))[~np.isnan(drawn.low)]
    assert counted.mean() == pytest.approx(coverage, abs=4.0 * np.sqrt(coverage * (1.0 - coverage) / len(counted)))
    assert 0.6 < coverage < 0.94
