"""Simulated firing tests at targets that are known: exact enumeration, and what is known by hand."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from warpimpact.firing.simulate import FiredShots, Langlie, MilStd662F, Procedure, fire, reports

Array = NDArray[np.float64]

MEAN, DEVIATION = 800.0, 25.0
NORMAL = MEAN + DEVIATION * special.ndtri((np.arange(4000) + 0.5) / 4000)
PROCEDURES: dict[str, Procedure] = {
    "mil_std_662f": MilStd662F(start=815.0, most_shots=10, pairs=2),
    "langlie": Langlie(lowest=700.0, highest=900.0, shots=10),
}


def simulated(procedure: Procedure, limits: Array, tests: int, seed: int = 0) -> FiredShots:
    places = np.random.default_rng(seed).integers(0, len(limits), (tests, procedure.most_shots))
    return fire(procedure, limits[places], np.zeros(places.shape))


def every_path(procedure: Procedure) -> tuple[FiredShots, Array]:
    """A test for every sequence of answers, and its probability for a normal response."""
    shots = procedure.most_shots
    answers = np.arange(2**shots)[:, None] >> np.arange(shots) & 1
    firings = fire(procedure, np.where(answers, 0.0, np.inf), np.zeros(answers.shape))
    z = np.where(firings.perforated, 1.0, -1.0) * (firings.velocity - MEAN) / DEVIATION
    unused = (~firings.used).sum(axis=1)  # a path that ends early occurs 2^unused times
    return firings, np.where(firings.used, special.ndtr(z), 1.0).prod(axis=1) / 2.0**unused


@pytest.mark.parametrize("name", PROCEDURES)
def test_ten_shots_report_what_all_1024_sequences_of_answers_give(name: str) -> None:
    """Mean and standard deviation of the reported V50 and its spread, exact, beside 4000 tests: within 4 standard
    errors."""
    procedure = PROCEDURES[name]
    firings, probability = every_path(procedure)
    assert probability.sum() == pytest.approx(1.0, abs=1e-9)
    drawn = reports(simulated(procedure, NORMAL, 4000), procedure)
    exact = reports(firings, procedure)
    for one, other in (
        (exact[name], drawn[name]) for name in ("reported_v50", "reported_spread") if np.isfinite(exact[name]).any()
    ):
        known, reported = np.isfinite(one), other[np.isfinite(other)]
        share = probability[known].sum()
        mean = (probability[known] * one[known]).sum() / share
        deviation = np.sqrt((probability[known] * (one[known] - mean) ** 2).sum() / share)
        assert reported.mean() == pytest.approx(mean, abs=4.0 * deviation / np.sqrt(len(reported)))
        fourth = (probability[known] * (one[known] - mean) ** 4).sum() / share
        error = np.sqrt((fourth - deviation**4) / len(reported)) / (2.0 * deviation)
        assert reported.std() == pytest.approx(deviation, abs=4.0 * error)
        assert len(reported) / 4000 == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 4000) + 1e-9)


@pytest.mark.parametrize("name", PROCEDURES)
def test_a_target_of_one_limit_is_enclosed(name: str) -> None:
    """No perforation below the limit, no stop above it; V50 lies between the last of both, no spread is determined."""
    procedure = PROCEDURES[name].model_copy(update={"shots": 16} if name == "langlie" else {"pairs": 1})
    firings = simulated(procedure, np.array([787.0]), 5)
    assert (firings.perforated == (firings.velocity > 787.0))[firings.used].all()
    reported = reports(firings, procedure)
    below = np.where(firings.used & ~firings.perforated, firings.velocity, -np.inf).max(axis=1)
    above = np.where(firings.used & firings.perforated, firings.velocity, np.inf).min(axis=1)
    assert (below < 787.0).all()
    assert (above >= 787.0).all()
    assert reported["reported_v50"] == pytest.approx(0.5 * (below + above))
    assert np.isnan(reported["reported_spread"]).all()
    if name == "langlie":  # it halves the range
        assert above[0] - below[0] <= 200.0 / 2**7
        assert ((reported["reported_v50_low"] <= 787.0) & (reported["reported_v50_high"] >= 787.0)).all()
