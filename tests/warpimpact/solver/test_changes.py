"""What changes between two levels of resolution, and what most shots stay within."""

import math

import numpy as np
import pytest

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Accuracy, Hits, Numerics, Target, make_shots
from warpimpact.solver.changes import (
    RISK,
    SLOW_SHARE,
    LevelVerdict,
    _excess,
    changes,
    compared,
    upper_error,
    upper_place,
)
from warpimpact.solver.simulate import simulate

from .shanked import BASE, IMPACT, OTHERS, PILOT, PLATE, SCENE, STOPPING


@pytest.fixture(scope="module")
def fine() -> Outcomes:
    return simulate(SCENE, OTHERS, numerics=Numerics(level=3), device="cpu")


def test_errors_behind_layers_may_have_a_relative_part() -> None:
    some = make_shots(IMPACT, Hits(count=16, seed=5), PLATE)
    coarse, fine = (simulate(STOPPING, some, numerics=Numerics(level=k), device="cpu") for k in (0, 2))
    plain, relative = changes(coarse, fine), changes(coarse, fine, None, (0.01, 2.0))
    last = np.nan_to_num(fine.tilt[:, -1])
    np.testing.assert_allclose(relative[1], plain[1] / (1.0 + 2.0 * last), rtol=1e-12)
    behind = np.nan_to_num(fine.layer_residual_velocity).max(axis=1)
    assert (relative[0] <= plain[0])[~np.isnan(plain[0])].all()
    assert (relative[0] >= plain[0] / (1.0 + 0.01 * behind) - 1e-9)[~np.isnan(plain[0])].all()


@pytest.mark.parametrize(("gap", "free"), [(0.0, False), (20e-3, False), (40e-3, True)])
def test_the_velocity_within_a_laminate_counts_in_no_error(gap: float, free: bool) -> None:
    layers = (PLATE, BASE.model_copy(update={"gap": gap}))
    assert SCENE.model_copy(update={"target": Target(layers=layers)}).free_behind == (free, True)
    zero = np.zeros((4, 2))
    coarse = simulate(STOPPING, make_shots(IMPACT, Hits(count=4, seed=5), PLATE), numerics=Numerics(level=0))
    still = {"status": np.zeros(4, int), "stopped_in": np.full(4, -1), "residual_velocity": zero[:, 0]}
    coarse = coarse.assign(layer_residual_velocity=zero, **still)
    fine = coarse.assign(layer_residual_velocity=np.array([[9.0, 0.0]] * 4))
    np.testing.assert_array_equal(changes(coarse, fine)[0], 9.0)
    np.testing.assert_array_equal(changes(coarse, fine, free=(free, True))[0], 9.0 * free)


@pytest.mark.parametrize("error", [math.inf, math.nan, 1e300])
@pytest.mark.parametrize(
    ("asked", "place"), [({"tilt": 0.02}, 0), ({"residual_velocity": 1.0}, 1), ({"residual_velocity": 1.0}, 2)]
)
def test_what_an_accuracy_does_not_ask_for_counts_nothing(asked: dict[str, float], place: int, error: float) -> None:
    errors = np.array([0.5, math.radians(0.01), 0.0])
    errors[place] = error
    assert _excess(Accuracy(**asked), errors, layered=True) == 0.5


def test_errors_of_slow_cores_are_those_of_their_energy(fine: Outcomes) -> None:
    one, impact = fine[np.arange(3)], np.full(3, 800.0)
    speeds, back = np.array([600.0, 20.0, 20.0]), [Status.PERFORATED, Status.PERFORATED, Status.ARRESTED]
    passed = one.assign(residual_velocity=speeds, status=np.zeros(3, dtype=np.int8))
    stopped = np.where(np.array(back) == Status.ARRESTED, np.nan, one.tilt[:, -1])
    slower = passed.assign(
        residual_velocity=np.array([599.0, 18.0, 0.0]),
        tilt=np.stack([stopped + 0.01] * 2, axis=1),
        status=np.array(back, dtype=np.int8),
    )
    velocity, tilt, depth = changes(passed.assign(tilt=np.stack([one.tilt[:, -1]] * 2, axis=1)), slower, impact)
    energy = (speeds**2 - slower.residual_velocity**2)[1:] / (2.0 * SLOW_SHARE * 800.0)
    assert velocity == pytest.approx([1.0, *energy])
    assert tilt == pytest.approx([0.01, 0.01 * 19.0 / 200.0, math.pi * 10.0 / 200.0])
    assert np.isnan(depth).all()


def test_fast_cores_count_as_they_are(fine: Outcomes) -> None:
    coarse = simulate(SCENE, OTHERS, numerics=Numerics(level=1), device="cpu")
    velocity, tilt, _ = changes(coarse, fine, OTHERS.velocity)
    plain = changes(coarse, fine)
    assert fine.residual_velocity.min() > SLOW_SHARE * 820.0
    np.testing.assert_array_equal(velocity, plain[0])
    np.testing.assert_array_equal(tilt, plain[1])


def test_an_upper_bound_is_an_order_statistic() -> None:
    errors = np.arange(60.0)
    assert upper_error(errors, 0.9) == upper_place(60, 0.9) - 1 < 58
    assert upper_error(errors, 0.9, risk=0.5) == 54  # of as many as lie beyond 90 %


def test_a_failed_computation_has_no_bound(fine: Outcomes) -> None:
    one = fine[np.arange(2)]
    failed = one.assign(status=np.array([Status.UNFINISHED, one.status[1]], dtype=np.int8))
    velocity, tilt, _ = changes(one, failed, np.full(2, 820.0))
    assert np.isinf([velocity[0], tilt[0]]).all()
    assert velocity[1] == tilt[1] == 0.0


@pytest.mark.parametrize(("share", "shots"), [(0.5, 64), (0.9, 64), (0.99, 200)])
def test_an_estimate_is_rarely_below_the_percentile_that_it_stands_for(share: float, shots: int) -> None:
    assert [upper_place(count, 0.9) for count in (1, 16, 32, 64)] == [1, 16, 31, 61]
    errors = np.random.default_rng(3).exponential(size=(20000, shots))
    below = np.sort(errors)[:, upper_place(shots, share) - 1] < -np.log(1.0 - share)
    assert 0.08 < below.mean() < RISK


def test_errors_of_the_finer_level_count_as_much_as_the_level_between_says() -> None:
    coarse, between, fine = (simulate(SCENE, PILOT, numerics=Numerics(level=k), device="cpu") for k in (0, 1, 3))

    def tilt(coarse: Outcomes, between: Outcomes, margin: float) -> float:
        outcomes, asked = (coarse, between, fine), Numerics().asked
        return compared(Numerics(level=1), asked, outcomes, margin, PILOT, (True,))[0].tilt_error

    assert tilt(coarse, between, 1.4) == pytest.approx(tilt(coarse, coarse, 1.0) + 0.4 * tilt(between, between, 1.0))
    assert tilt(between, between, 1.4) == pytest.approx(1.4 * tilt(between, between, 1.0))
    assert 0.0 < tilt(between, between, 1.0) < tilt(coarse, coarse, 1.0)


def test_what_a_level_errs_by_over_what_is_allowed(fine: Outcomes) -> None:
    some, shots, asked = fine[np.arange(32)], OTHERS[:32], Accuracy(residual_velocity=2.0)

    def verdict(speed: float) -> LevelVerdict:
        coarse, finer = (some.assign(residual_velocity=speed + k * np.arange(32.0)) for k in (0.0, 1.0))
        return compared(Numerics(level=2), asked, (coarse, coarse, finer), 1.4, shots, (True,))[1]

    fast, slow = verdict(600.0), verdict(20.0)
    assert fast.excess == fast.weighed == slow.excess == 0.7 * (upper_place(32, 0.9) - 1)
    assert fast.typical == 0.7 * (upper_place(32, 0.75, 0.5) - 1)
    assert slow.weighed == pytest.approx(slow.excess * (20.0 + 15.0) / (SLOW_SHARE * 820.0))
    assert not fast.kept
