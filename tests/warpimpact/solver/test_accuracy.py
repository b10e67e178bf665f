"""The level that a pilot chooses keeps its accuracy on hits that were not in the pilot."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact import Campaign, run
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.runs.describe import pilot_in
from warpimpact.runs.replay import replay
from warpimpact.scene import PRESETS, Accuracy, Hits, Numerics, Scene, Shots, Target, make_shots
from warpimpact.solver.accuracy import (
    ERROR_PER_CHANGE,
    PILOT_LIMITS,
    PILOT_SECONDS,
    PilotResult,
    choose_level,
    ended_otherwise,
    errors_text,
    hit_errors,
    limit_errors,
    pilot_size,
    upper_digits,
)
from warpimpact.solver.resolution import LADDER, TooManySteps
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

from .shanked import BASE, IMPACT, OTHERS, PILOT, PLATE, SCENE, STOPPING

ASKED = Accuracy(residual_velocity=1.0)
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
    accuracy: Accuracy = ASKED,
    seconds: Callable[[int], float] = lambda level: 0.0,
    first: int = 0,
) -> tuple[PilotResult, list[int]]:
    """The level chosen for residual velocities that depend on the level, and the levels computed."""
    computed = dict[int, Outcomes]()

    def outcomes(level: int) -> Outcomes:
        if level not in computed:
            computed[level] = outcomes_of(speeds(level))
        return computed[level]

    def errors(coarse: Outcomes, fine: Outcomes) -> object:
        return hit_errors(coarse, fine, accuracy, (True,))

    found = choose_level(Numerics(accuracy=accuracy), first, outcomes, errors, seconds)  # type: ignore[arg-type]
    return found, list(computed)


@pytest.mark.parametrize("ratio", [0.5, 0.4, 0.25])
@pytest.mark.parametrize("scale", [0.5, 4.0, 20.0])
@pytest.mark.parametrize("hits", [1, 8, 64])
def test_the_coarsest_level_that_keeps_the_accuracy_is_chosen(ratio: float, scale: float, hits: int) -> None:
    of_hit = np.random.default_rng(7).uniform(0.2, 1.0, hits)

    def error(level: int) -> NDArray[np.float64]:
        return scale * ratio**level * of_hit

    found, levels = chosen(lambda level: 500.0 + error(level))
    level = found.numerics.level
    assert level is not None
    assert found.kept
    estimate, true = found.errors["residual_velocity_error"], float(np.quantile(error(level), 0.9, method="lower"))
    assert true <= estimate <= 1.0
    assert max(levels) == level + 2
    change = np.sort(error(level - 1) - error(level + 1))
    assert level == 0 or ERROR_PER_CHANGE * change[math.ceil(0.95 * hits) - 1] > 1.0


def test_an_accuracy_that_no_level_keeps_is_not_promised() -> None:
    found, _ = chosen(lambda level: np.full(8, 500.0 + 1e4 * 0.5**level))
    assert (found.kept, found.numerics.level) == (False, FINEST)  # where errors fall, the finest level is best
    change = 1e4 * (0.5**FINEST - 0.5 ** (FINEST + 2))
    assert found.errors["residual_velocity_error"] == pytest.approx(ERROR_PER_CHANGE * change)
    assert found.phrase.endswith("for 90 % of the hits, not as promised")
    stalled, _ = chosen(lambda level: np.full(8, 500.0 + 30.0 * 0.5**level + 40.0 * (level // 2 % 2)))
    assert (stalled.kept, stalled.numerics.level) == (False, 0)  # where errors stall, the coarsest one is as good


def test_a_pilot_ends_where_hits_take_too_long_or_do_not_fit() -> None:
    def slow(level: int) -> float:
        return PILOT_SECONDS * 2.0 ** (level - 5.2)

    def halved(level: int) -> NDArray[np.float64]:
        return np.full(8, 500.0 + 1e4 * 0.5**level)

    found, levels = chosen(halved, seconds=slow)
    assert (found.kept, found.numerics.level, max(levels)) == (False, 2, 4)
    assert chosen(halved, seconds=lambda level: 1e9)[0].numerics.level == 0  # the first level is always tried
    for error in (MemoryError, TooManySteps):

        def speeds(level: int, error: type[Exception] = error) -> NDArray[np.float64]:
            if level > 4:
                raise error
            return halved(level)

        assert chosen(speeds)[0].numerics.level == 2
        unknown, _ = chosen(speeds, first=3)
        assert (unknown.kept, unknown.numerics.level, unknown.errors) == (False, 3, {})
        assert unknown.phrase == "accuracy unknown for 90 % of the hits, not as promised"


def test_a_share_of_the_hits_may_have_larger_errors() -> None:
    def few_jump(level: int) -> NDArray[np.float64]:
        return 500.0 + np.where(np.arange(64) < 3, 100.0 * (level % 4 // 2), 0.1)

    assert chosen(few_jump)[0].kept
    assert not chosen(few_jump, Accuracy(residual_velocity=1.0, share=0.95))[0].kept


def test_hits_that_end_otherwise_behind_layers_count_in_the_status() -> None:
    speeds = np.full(64, 500.0)
    fine = outcomes_of(speeds, layered=True)
    for arrested, excess in ((0, 0.0), (1, 1.0 / 0.64), (2, 2.0 / 0.64)):
        coarse = outcomes_of(np.where(np.arange(64) < arrested, 0.0, speeds), layered=True, arrested=arrested)
        found = hit_errors(coarse, fine, PRESETS["standard"], (True, True))
        assert found.excess == pytest.approx(excess)
        assert found.errors["status_error"] == arrested / 64
        assert found.errors["residual_velocity_error"] == 0.0
    alone = hit_errors(outcomes_of(speeds), outcomes_of(np.where(np.arange(64) < 7, 0.0, speeds)), ASKED, (True,))
    assert alone.errors["residual_velocity_error"] == ERROR_PER_CHANGE * 500.0  # a core that stops has the speed 0


def test_errors_behind_layers_may_have_a_relative_part() -> None:
    coarse, fine = (outcomes_of(np.full(8, speed), layered=True) for speed in (502.0, 500.0))
    asked = Accuracy(residual_velocity=1.0, residual_velocity_share=0.01, tilt=1.0)
    assert hit_errors(coarse, fine, asked, (True, True)).excess == pytest.approx(ERROR_PER_CHANGE * 2.0 / 6.0)


@pytest.mark.parametrize(("gap", "free"), [(0.0, False), (20e-3, False), (40e-3, True)])
def test_the_velocity_within_a_laminate_counts_in_no_error(gap: float, free: bool) -> None:
    layers = (PLATE, BASE.model_copy(update={"gap": gap}))
    assert SCENE.model_copy(update={"target": Target(layers=layers)}).free_behind == (free, True)
    coarse = outcomes_of(np.zeros(4), layered=True)
    fine = coarse.assign(layer_residual_velocity=np.array([[9.0, 0.0]] * 4))
    error = hit_errors(coarse, fine, ASKED, (free, True)).errors["residual_velocity_error"]
    assert error == 9.0 * free * ERROR_PER_CHANGE


def test_a_computation_that_fails_has_no_bound_and_what_is_not_asked_for_none() -> None:
    coarse = outcomes_of(np.full(2, 500.0))
    failed = coarse.assign(status=np.array([Status.UNFINISHED, 0], dtype=np.int8))
    assert math.isinf(hit_errors(coarse, failed, ASKED, (True,)).excess)
    turned = coarse.assign(tilt=np.full((2, 1), 2.0))
    assert hit_errors(coarse, turned, ASKED, (True,)).excess == 0.0
    assert hit_errors(coarse, turned, Accuracy(tilt="1 rad"), (True,)).excess == 2.0 * ERROR_PER_CHANGE


@pytest.mark.parametrize(("quantity", "factor"), [("velocity", 1.0), ("thickness", 2.0)])
def test_errors_of_limits_are_relative_to_their_median(quantity: str, factor: float) -> None:
    coarse, fine = np.array([408.0, 408.0, np.inf, np.nan]), np.array([400.0, 400.0, np.inf, np.nan])
    error, excess = limit_errors(coarse, fine, Accuracy(limit=0.02), quantity)
    assert error == {f"limit_{quantity}_error": ERROR_PER_CHANGE * 8.0}
    assert excess == pytest.approx(ERROR_PER_CHANGE / factor)
    assert math.isinf(limit_errors(coarse, np.full(4, 400.0), Accuracy(limit=0.02), quantity).excess)
    assert limit_errors(np.zeros(4), np.zeros(4), Accuracy(limit=0.02), quantity).excess == 0.0


def test_a_pilot_has_hits_beyond_the_share() -> None:
    sizes = [pilot_size(Accuracy(tilt=1.0, share=share)) for share in (0.5, 0.9, 0.975, 0.99)]
    assert sizes == [128, 128, 128, 160]
    assert pilot_size(PRESETS["standard"], PILOT_LIMITS) == PILOT_LIMITS


@pytest.mark.parametrize("bound", [5.0, 1.0, 0.2])
def test_errors_above_a_bound_never_read_as_if_they_kept_it(bound: float) -> None:
    for error in bound * np.array([1.00001, 1.004, 1.04, 1.4, 30.0]):
        assert float(upper_digits(error)) > bound
    for error in bound * np.array([1.0, 0.99999, 0.996, 0.5, 0.0]):
        assert error <= float(upper_digits(error)) <= bound
    errors = {"tilt_error": 0.3, "residual_velocity_error": 1.04, "depth_error": 1.23e-4, "status_error": 0.0}
    assert errors_text(errors) == "1.1 m/s, 0.3 deg and 0.13 mm of depth"
    assert errors_text({"limit_thickness_error": math.inf}) == "inf mm"


def found_for(numerics: Numerics, shots: Shots = PILOT, scene: Scene = SCENE) -> PilotResult:
    return pilot_of(scene, shots, numerics, Worker("cpu"))


def errors_of_90_percent(coarse: Outcomes, fine: Outcomes) -> tuple[float, float]:
    """Errors of residual velocity [m/s] and last tilt [degree] that 90 % of the hits are within."""
    changes = fine.residual_velocity - coarse.residual_velocity, np.degrees(fine.tilt[:, -1] - coarse.tilt[:, -1])
    velocity, tilt = (float(np.quantile(np.nan_to_num(np.abs(change)), 0.9)) for change in changes)
    return velocity, tilt


@pytest.mark.parametrize("name", ["draft", "standard"])
def test_a_shanked_core_gets_the_accuracy_that_the_name_promises(name: str) -> None:
    found = found_for(Numerics(fidelity=name), make_shots(IMPACT, Hits(count=128, seed=5), PLATE))
    assert found.kept
    assert (found.numerics.level or 0) <= 4
    coarse, fine = (simulate(SCENE, OTHERS, numerics=one, device="cpu") for one in (found.numerics, Numerics(level=7)))
    velocity, tilt = errors_of_90_percent(coarse, fine)
    assert velocity / 1.3 <= found.errors["residual_velocity_error"] <= PRESETS[name].residual_velocity
    assert tilt / 1.3 <= found.errors["tilt_error"] <= math.degrees(PRESETS[name].tilt)


def test_draft_gives_errors_that_other_hits_keep_where_a_base_stops_some_of_them() -> None:
    some, others = (make_shots(IMPACT, Hits(count=64, seed=seed), PLATE) for seed in (5, 6))
    found = found_for(Numerics(fidelity="draft"), some, STOPPING)
    coarse, fine = (
        simulate(STOPPING, others, numerics=one, device="cpu") for one in (found.numerics, Numerics(level=7))
    )
    assert 0.2 < (fine.status == Status.ARRESTED).mean() < 0.8
    alike = ~ended_otherwise(coarse, fine)
    velocity, tilt = errors_of_90_percent(coarse[alike], fine[alike])
    assert velocity / 1.3 <= found.errors["residual_velocity_error"]
    assert tilt / 1.3 <= found.errors["tilt_error"]
    assert np.nanquantile(np.abs(coarse.depth - fine.depth)[alike], 0.9) <= found.errors["depth_error"] < 5e-3
    assert ended_otherwise(coarse, fine).mean() <= found.errors["status_error"] + 3.0 / 64.0


def test_an_accuracy_in_numbers_is_what_its_name_is() -> None:
    asked = {"residual_velocity": "5 m/s", "tilt": "5 deg"}
    numbers, name = (found_for(one, PILOT[:8]) for one in (Numerics(accuracy=asked), Numerics(fidelity="draft")))
    assert (numbers.numerics, numbers.phrase) == (name.numerics, name.phrase)
    assert found_for(Numerics(fidelity="standard", precision="double"), PILOT[:8]).numerics.precision == "double"
    with pytest.raises(ValueError, match="needs residual_velocity or tilt"):
        found_for(Numerics(accuracy={"limit": 0.01}), PILOT[:4])


def test_simulate_keeps_a_promise_as_a_run_does() -> None:
    numerics = Numerics(fidelity="draft")
    every, piloted = PILOT[:8], found_for(numerics, PILOT[:8]).numerics
    by_name, by_level = (simulate(SCENE, every, numerics=one, device="cpu") for one in (numerics, piloted))
    np.testing.assert_array_equal(by_name.residual_velocity, by_level.residual_velocity)


@pytest.mark.parametrize("hits", ["count = 12", 'count = 12\nsampling = "grid"'])
def test_a_result_has_its_promise_and_replays_on_its_level(hits: str) -> None:
    text = (Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
    before, after = text.split("[hits]")[0], '\n[numerics]\nfidelity = "draft"\n'
    campaign = Campaign.from_text(f"{before}[hits]\n{hits}{after}", name="t", folder=Path())
    result = run(campaign, device="cpu")
    found = pilot_in(result)
    assert found is not None
    assert found.kept
    assert result.attrs["promise_kept"] == 1
    assert 0.0 < result.attrs["residual_velocity_error"] == found.errors["residual_velocity_error"] <= 5.0
    assert replay(result, 5, folder=Path()).attrs["agreement"] == "bit-identical"
