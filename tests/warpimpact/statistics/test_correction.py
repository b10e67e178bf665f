"""Corrections by an accurate model: coverage on synthetic models and on stored hits, and what they gain."""

import csv
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from warpimpact.statistics.correction import (
    correct,
    corrected_event,
    corrected_mean,
    corrected_quantile,
    corrected_share,
)
from warpimpact.statistics.intervals import Array, Estimate

STORED = Path(__file__).parents[2] / "benchmarks" / "results" / "continuum_trade.csv"
PLATES = ("slotted", "thin", "thick", "oblique", "based", "aluminium")
POPULATION, SHOTS, TRIALS = 20_000, 512, 120
LEAST = 107
"""95 % of 120 trials: 114 ± 2.4; three standard deviations below."""


def holds(estimate: Estimate, truth: float) -> bool:
    return not estimate.low > truth and not estimate.high < truth


def models(kind: str, numbers: np.random.Generator) -> tuple[Array, Array]:
    """An accurate model and two fast ones: biased, curved, with heavy tails; or fast ones that know nothing."""
    u, w = numbers.random((2, POPULATION))
    truth = {"waves": 30.0 * np.sin(6.0 * u) * w + 40.0, "skewed": 40.0 * u**4 * (1.0 + w)}.get(kind, 50.0 + 10.0 * u)
    fast = np.column_stack(
        [
            0.8 * truth + 10.0 + numbers.normal(0.0, 5.0, POPULATION),
            5.0 * np.sqrt(truth) + numbers.standard_t(3, POPULATION),
        ]
    )
    if kind == "useless":
        fast = numbers.normal(0.0, 1.0, fast.shape)
    return truth + 2.0 * numbers.standard_t(4, POPULATION), fast


@pytest.mark.parametrize("kind", ["waves", "skewed", "useless"])
@pytest.mark.parametrize("count", [12, 24])
def test_intervals_hold_and_corrections_gain(kind: str, count: int) -> None:
    numbers = np.random.default_rng(3)
    accurate, fast = models(kind, numbers)
    limits = {share: float(np.quantile(accurate, 1.0 - share)) for share in (0.03, 0.3, 0.8)}
    held, errors, alone = dict.fromkeys(["mean", "event", *limits], 0), [], []
    for _ in range(TRIALS):
        chosen = numbers.choice(POPULATION, SHOTS, replace=False)
        shots = chosen[:count]
        correction = correct(accurate[shots], fast[shots], fast[chosen])
        mean = corrected_mean(correction)
        held["mean"] += holds(mean, float(accurate.mean()))
        for share, limit in limits.items():
            held[share] += holds(corrected_share(correction, limit), share)
        by_both = [np.asarray(model > limits[0.3], dtype=float) for model in (accurate, fast[:, 0])]
        event = correct(by_both[0][shots], by_both[1][shots, None], by_both[1][chosen, None])
        held["event"] += holds(corrected_event(event), 0.3)
        errors.append(mean.value - accurate.mean())
        alone.append(accurate[shots].mean() - accurate.mean())
    assert min(held.values()) >= LEAST, held
    ratio = np.std(errors) / np.std(alone)
    assert ratio < (1.3 if kind == "useless" else 0.7)


def test_quantiles_are_open_where_the_shots_exclude_nothing() -> None:
    numbers = np.random.default_rng(4)
    accurate, fast = models("waves", numbers)
    correction = correct(accurate[:12], fast[:12], fast[:SHOTS])
    median, extreme = (corrected_quantile(correction, share) for share in (0.5, 0.02))
    assert median.low < np.median(accurate) < median.high
    assert np.isnan(extreme.low)


def test_a_quantile_of_many_shots_takes_little_memory() -> None:
    """A matrix of all corrected numbers and all residuals would take 128 MB; the quantile is the same."""
    numbers = np.random.default_rng(8)
    fast = numbers.normal(size=(10**6, 1))
    few, many = (correct(3.0 * fast[:16, 0] + fast[16:32, 0], fast[:16], fast[:count]) for count in (4000, 10**6))
    tracemalloc.start()
    estimate = corrected_quantile(many, 0.9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 32e6
    assert estimate.count == 10**6
    assert estimate.value == pytest.approx(corrected_quantile(few, 0.9).value, rel=0.05)


def test_a_fast_model_that_is_the_accurate_one_gives_its_map() -> None:
    numbers = np.random.default_rng(5)
    fast = numbers.normal(size=(200, 2))
    exact = correct(3.0 + 2.0 * fast[:8, 0], fast[:8], fast)
    assert exact.values == pytest.approx(3.0 + 2.0 * fast[:, 0])
    assert exact.coefficients == pytest.approx([3.0, 2.0, *[0.0] * (len(exact.controls) - 1)])
    assert exact.errors.max() < 1e-9
    assert exact.determination == pytest.approx(1.0)
    constant = correct(numbers.normal(size=8), np.ones((8, 1)), np.ones((200, 1)))
    assert constant.controls == ()


def test_a_share_that_no_shot_contradicts_is_no_certainty() -> None:
    """Of 16 shots that all stay below a limit, the rule of three leaves some 20 %."""
    fast = np.random.default_rng(6).normal(size=(400, 1))
    correction = correct(fast[:16, 0], fast[:16], fast)
    share = corrected_share(correction, 10.0)
    assert share.value == 0.0
    assert 0.05 < share.high < 0.25
    none = corrected_event(correct(np.zeros(16), np.zeros((16, 1)), np.zeros((400, 1))))
    assert (none.value, none.low) == (0.0, 0.0)
    assert 0.05 < none.high < 0.25


def stored(plate: str) -> tuple[Array, Array]:
    """Stored hits of a plate that perforate by all: velocity and tilts by finite elements, and by two fast laws."""
    columns = ("velocity", "tilt_50", "tilt_130")
    by_model: dict[str, dict[int, list[float]]] = {}
    with STORED.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["plate"] == plate and row["status"] == "0":
                by_model.setdefault(row["model"], {})[int(row["hit"])] = [float(row[name]) for name in columns]
    hits = sorted({*by_model["continuum"]} & {*by_model["fast"]} & {*by_model["free_surface"]})
    accurate, *fast = (
        np.array([by_model[name][hit] for hit in hits]) for name in ("continuum", "fast", "free_surface")
    )
    return accurate, np.stack(fast, axis=-1)


@pytest.mark.parametrize("plate", PLATES)
def test_a_dozen_stored_hits_of_elements_correct_the_map(plate: str) -> None:
    """Of each measure, the corrected hits that were left out err less than the fast law, and the means hold."""
    accurate, fast = stored(plate)
    numbers = np.random.default_rng(7)
    for of_accurate, of_fast in zip(accurate.T, fast.transpose(1, 0, 2), strict=True):
        held, squares = 0, []
        for _ in range(30):
            order = numbers.permutation(len(of_accurate))
            some, others = order[:12], order[12:]
            correction = correct(of_accurate[some], of_fast[some], of_fast)
            held += holds(corrected_mean(correction), float(of_accurate.mean()))
            squares.append(float(np.mean((correction.values[others] - of_accurate[others]) ** 2)))
        assert held >= 24  # 95 % of 30: 28.5 ± 1.2; four standard deviations below
        assert np.mean(squares) < np.mean((of_fast[:, 0] - of_accurate) ** 2)
