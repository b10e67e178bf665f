"""The level that a pilot chooses keeps its accuracy on hits that were not in the pilot."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact import simulate
from warpimpact.errors import TooLong
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Scene
from warpimpact.solver import accuracy as choice
from warpimpact.solver.accuracy import (
    ERROR_PER_CHANGE,
    NEAR_LIMIT,
    PILOT_SECONDS,
    LevelErrors,
    PilotResult,
    answer_errors,
    choose_level,
    errors_text,
    hit_errors,
    limit_errors,
    upper_digits,
)
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.resolution import LADDER
from warpimpact.solver.settings import BASE_ACCURACY, PRESETS, Accuracy

from ...verification.scenes import PAPER_CORE, paper_plate, shots_at

REQUIRED = Accuracy(residual_velocity=1.0)
FINEST = len(LADDER) - 3
Speeds = Callable[[int], NDArray[np.float64]]


def outcomes_of(speeds: NDArray[np.float64], *, layered: bool = False, arrested: int = 0) -> Outcomes:
    """Cores that leave a plate with these speeds; behind a layer the first ones may be arrested."""
    count = len(speeds)
    columns = {"status": np.zeros(count, np.int8), "residual_velocity": speeds, "tilt": np.zeros((count, 1))}
    if layered:
        columns |= {"layer_residual_velocity": np.stack([speeds, speeds], axis=1), "depth": np.full(count, math.nan)}
        columns |= {"stopped_in": np.full(count, -1)}
        columns["status"][:arrested] = Status.ARRESTED
    return Outcomes(**columns)


def chosen(
    speeds: Speeds,
    accuracy: Accuracy = REQUIRED,
    seconds: Callable[[int], float] = lambda level: 0.0,
    first: int = 0,
) -> tuple[PilotResult, list[int]]:
    """The level chosen for residual velocities that depend on the level, and the levels computed."""
    levels = list[int]()

    def compute(level: int) -> Outcomes:
        levels.append(level)
        return outcomes_of(speeds(level))

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        return hit_errors(coarse, fine, accuracy, (True,))

    return choose_level(first, compute, errors, seconds), levels


@pytest.mark.parametrize("ratio", [0.5, 0.25])
@pytest.mark.parametrize("scale", [0.5, 20.0])
@pytest.mark.parametrize("hits", [1, 64])
def test_the_coarsest_level_that_keeps_the_accuracy_is_chosen(ratio: float, scale: float, hits: int) -> None:
    of_hit = np.random.default_rng(7).uniform(0.2, 1.0, hits)

    def error(level: int) -> NDArray[np.float64]:
        return scale * ratio**level * of_hit

    actual, levels = chosen(lambda level: 500.0 + error(level))
    level = actual.level
    assert actual.kept
    estimate, true = actual.errors["residual_velocity_error"], float(np.quantile(error(level), 0.9, method="lower"))
    assert true <= estimate <= 1.0
    assert max(levels) == level + 2
    change = np.sort(error(level - 1) - error(level + 1))
    assert level == 0 or ERROR_PER_CHANGE * change[math.ceil(0.95 * hits) - 1] > 1.0


def test_an_accuracy_that_no_level_keeps_is_not_promised() -> None:
    actual, _ = chosen(lambda level: np.full(8, 500.0 + 1e4 * 0.5**level))
    assert (actual.kept, actual.level) == (False, FINEST)  # where errors fall, the finest level is best
    change = 1e4 * (0.5**FINEST - 0.5 ** (FINEST + 2))
    assert actual.errors["residual_velocity_error"] == pytest.approx(ERROR_PER_CHANGE * change)
    stalled, _ = chosen(lambda level: np.full(8, 500.0 + 30.0 * 0.5**level + 40.0 * (level // 2 % 2)))
    assert (stalled.kept, stalled.level) == (False, 0)  # where errors stall, the coarsest one is as good


def test_a_pilot_ends_where_hits_take_too_long_or_do_not_fit() -> None:
    def slow(level: int) -> float:
        return PILOT_SECONDS * 2.0 ** (level - 5.2)

    def halved(level: int) -> NDArray[np.float64]:
        return np.full(8, 500.0 + 1e4 * 0.5**level)

    actual, levels = chosen(halved, seconds=slow)
    assert (actual.kept, actual.level, max(levels)) == (False, 2, 4)
    assert chosen(halved, seconds=lambda level: 1e9)[0].level == 0  # the first level is always tried
    for error in (MemoryError, TooLong):

        def speeds(level: int, error: type[Exception] = error) -> NDArray[np.float64]:
            if level > 4:
                raise error
            return halved(level)

        assert chosen(speeds)[0].level == 2
        unknown, _ = chosen(speeds, first=3)
        assert (unknown.kept, unknown.level, unknown.errors) == (False, 3, {})


def test_a_pilot_ends_by_the_time_that_it_takes_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "LONGEST_PILOT", 0.0)
    with pytest.warns(UserWarning, match="resolution ended after 0 s.*give numerics.level"):
        unknown, levels = chosen(lambda level: np.full(8, 500.0))
    assert (unknown.kept, unknown.errors, levels) == (False, {}, [0])


def test_hits_that_end_otherwise_behind_layers_count_in_the_status() -> None:
    speeds = np.full(64, 500.0)
    fine = outcomes_of(speeds, layered=True)
    for arrested, excess in ((0, 0.0), (1, 1.0 / 0.64), (2, 2.0 / 0.64)):
        coarse = outcomes_of(np.where(np.arange(64) < arrested, 0.0, speeds), layered=True, arrested=arrested)
        actual = hit_errors(coarse, fine, PRESETS["standard"], (True, True))
        assert actual.excess == pytest.approx(excess)
        assert actual.errors["status_error"] == arrested / 64
        assert actual.errors["residual_velocity_error"] == 0.0
    alone = hit_errors(outcomes_of(speeds), outcomes_of(np.where(np.arange(64) < 7, 0.0, speeds)), REQUIRED, (True,))
    assert alone.errors["residual_velocity_error"] == ERROR_PER_CHANGE * 500.0  # a core that stops has the speed 0


def test_the_error_of_an_answer_counts_cores_near_the_limit_and_means() -> None:
    velocity, both = np.full(100, 1000.0), (True, True)
    fast = np.full(100, 500.0)
    error, excess = answer_errors(
        outcomes_of(fast, layered=True), outcomes_of(fast + 4.0, layered=True), BASE_ACCURACY, both, velocity
    )
    assert error["base_perforated_error"] == 0.0  # far above the limit every core passes at both levels
    assert error["mean_velocity_error"] == pytest.approx(ERROR_PER_CHANGE * 0.004)
    assert excess == pytest.approx(ERROR_PER_CHANGE * 0.4)
    # Residual energies even from 0 on, of which a coarse level takes 0.02: 2 of 100 cores more stop.
    energy = (np.arange(100) + 0.5) / 100.0
    fine, coarse = (1000.0 * np.sqrt(np.maximum(energies, 0.0)) for energies in (energy, energy - 0.02))
    coarse, fine = outcomes_of(coarse, layered=True, arrested=2), outcomes_of(fine, layered=True)
    error, excess = answer_errors(coarse, fine, BASE_ACCURACY, both, velocity)
    assert error["base_perforated_error"] == pytest.approx(ERROR_PER_CHANGE * 0.02, rel=0.5 * 0.02 / NEAR_LIMIT)
    assert excess > 1.0
    failed = fine.assign(status=np.where(np.arange(100) < 50, Status.UNFINISHED, fine.status))
    assert answer_errors(failed, fine, BASE_ACCURACY, both, velocity).excess == pytest.approx(50.0)
    none = fine.assign(status=np.full(100, Status.UNFINISHED))
    assert math.isinf(answer_errors(none, fine, BASE_ACCURACY, both, velocity).excess)


def test_the_default_behind_a_base_is_the_accuracy_of_the_answer() -> None:
    assert FastLaw().required_at(2) == BASE_ACCURACY
    assert FastLaw().required_at(1) == FastLaw(fidelity="standard").required_at(2) == PRESETS["standard"]
    given = Accuracy(tilt="1 deg")
    assert FastLaw(accuracy=given).required_at(2) == given
    with pytest.raises(ValueError, match="base_perforated and mean_velocity need layers behind the plate"):
        simulate(
            Scene(core=PAPER_CORE, target=(paper_plate(),)),
            shots_at(),
            method=FastLaw(accuracy=Accuracy(base_perforated=0.01)),
            device="cpu",
        )


def test_a_computation_that_fails_has_no_bound_and_what_is_not_required_none() -> None:
    coarse = outcomes_of(np.full(2, 500.0))
    failed = coarse.assign(status=np.array([Status.UNFINISHED, 0], dtype=np.int8))
    assert math.isinf(hit_errors(coarse, failed, REQUIRED, (True,)).excess)
    turned = coarse.assign(tilt=np.full((2, 1), 2.0))
    assert hit_errors(coarse, turned, REQUIRED, (True,)).excess == 0.0
    assert hit_errors(coarse, turned, Accuracy(tilt="1 rad"), (True,)).excess == 2.0 * ERROR_PER_CHANGE


@pytest.mark.parametrize(("quantity", "factor"), [("velocity", 1.0), ("thickness", 2.0)])
def test_errors_of_limits_are_relative_to_their_median(quantity: str, factor: float) -> None:
    coarse, fine = np.array([408.0, 408.0, np.inf, np.nan]), np.array([400.0, 400.0, np.inf, np.nan])
    error, excess = limit_errors(coarse, fine, Accuracy(limit=0.02), quantity)
    assert error == {f"limit_{quantity}_error": ERROR_PER_CHANGE * 8.0}
    assert excess == pytest.approx(ERROR_PER_CHANGE / factor)
    assert math.isinf(limit_errors(coarse, np.full(4, 400.0), Accuracy(limit=0.02), quantity).excess)
    assert limit_errors(np.zeros(4), np.zeros(4), Accuracy(limit=0.02), quantity).excess == 0.0


@pytest.mark.parametrize("bound", [5.0, 0.2])
def test_errors_above_a_bound_never_read_as_if_they_kept_it(bound: float) -> None:
    for error in bound * np.array([1.00001, 1.004, 1.04, 1.4, 30.0]):
        assert float(upper_digits(error)) > bound
    for error in bound * np.array([1.0, 0.99999, 0.996, 0.5, 0.0]):
        assert error <= float(upper_digits(error)) <= bound
    errors = {"tilt_error": 0.3, "residual_velocity_error": 1.04, "depth_error": 1.23e-4, "status_error": 0.0}
    assert errors_text(errors) == "1.1 m/s, 0.3 deg and 0.13 mm of depth"
    assert errors_text({"limit_thickness_error": math.inf}) == "inf mm"
