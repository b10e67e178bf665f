"""The likelihood of a shot against a sum written out, and the hits that it is integrated over."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from warpimpact.identification import scoring
from warpimpact.identification.aim import HitPoints, aim
from warpimpact.identification.fit import Fit
from warpimpact.identification.hit_places import CLASSES
from warpimpact.identification.likelihood import Compared, Data, ShotScore, holds
from warpimpact.identification.measured import Observation
from warpimpact.identification.scoring import benches, data_of, evaluate
from warpimpact.kernels.status import Status
from warpimpact.records.exit import OUTCOME_VARIABLES
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.measures import Measure
from warpimpact.scene import IDENTITY, Shots
from warpimpact.solver.simulate import simulate
from warpimpact.solver.worker import Worker

FitMaker = Callable[..., Fit]
POINTS = 16
CPU = Worker("cpu")


def outcomes_of(velocity: np.ndarray, angle: np.ndarray, status: Any = Status.PERFORATED) -> Outcomes:
    """Outcomes with these residual velocities [m/s] and yaws at one stand-off [rad]."""
    count = len(velocity)
    columns = {str(one): np.zeros(count) for one in OUTCOME_VARIABLES}
    columns |= dict.fromkeys(("tilt", "pitch", "yaw", "total_yaw"), angle[:, None])
    return Outcomes(**columns | {"status": np.broadcast_to(np.int8(status), count), "residual_velocity": velocity})


def aim_of(weight: np.ndarray, replicates: int = 8, sets: int = 2) -> HitPoints:
    zeros = np.zeros(sets * len(weight))
    shots = Shots(
        **dict.fromkeys(("velocity", "obliquity", "azimuth", "pitch", "yaw", "spin"), zeros),
        hit_y=np.tile(np.arange(float(len(weight))), sets),
        hit_z=zeros,
    )
    return HitPoints(shots, (IDENTITY,), np.tile(weight, (sets, 1)), replicates)


def score(data: Data, aim: HitPoints, outcomes: Outcomes, scales: Any, rng: np.random.Generator) -> ShotScore:
    return Compared.of(data, aim, outcomes).score(scales, rng)


VELOCITY = Observation("residual_velocity", None, None, 600.0, 10.0)
YAW = Observation("yaw", 0, 0.05, np.radians(170.0), np.radians(3.0))
SHIFTS = np.array([[0.2, 0.7]])
SCALES = {"velocity": np.array([0.0, 5.0]), "angle": np.radians([0.0, 4.0])}


@pytest.fixture
def computed() -> Outcomes:
    rng = np.random.default_rng(3)
    return outcomes_of(
        600.0 + 15.0 * rng.standard_normal(2 * POINTS), np.radians(175.0 + 20.0 * rng.random(2 * POINTS))
    )


def test_the_likelihood_is_the_mean_over_the_hits_of_the_class(computed: Outcomes) -> None:
    weight = (np.arange(POINTS) % 3 != 0).astype(float)
    found = score(Data((VELOCITY, YAW), None), aim_of(weight), computed, SCALES, np.random.default_rng(0))
    for one in range(2):
        total = 0.0
        for point in np.flatnonzero(weight):
            place = one * POINTS + point
            density = 1.0
            for miss, spread in (
                (computed.residual_velocity[place] - 600.0, np.hypot(10.0, SCALES["velocity"][one])),
                # The yaws lie on both sides of 180 degrees, the measured one at 170.
                ((np.degrees(computed.yaw[place, 0]) - 170.0), np.degrees(np.hypot(YAW.std, SCALES["angle"][one]))),
            ):
                density *= np.exp(-0.5 * (miss / spread) ** 2) / (np.sqrt(2.0 * np.pi) * spread)
            total += density
        per_radian = np.log(np.degrees(1.0))
        assert found.log_likelihood[one] == pytest.approx(np.log(total / weight.sum()) + per_radian)


def test_angles_are_compared_the_short_way_round(computed: Outcomes) -> None:
    data, rng = Data((YAW,), None), np.random.default_rng(0)
    round_the_other_way = computed.assign(yaw=computed.yaw - 2.0 * np.pi)
    one, other = (
        score(data, aim_of(np.ones(POINTS)), of, SCALES, rng).log_likelihood for of in (computed, round_the_other_way)
    )
    assert one == pytest.approx(other)


def test_a_selection_conditions_the_likelihood(computed: Outcomes) -> None:
    """Only cores faster than 600 m/s were measured: the others count neither above nor below the line."""
    condition = Measure.parse("P(residual_velocity > 600 m/s)")
    selected = Data((VELOCITY,), None, (condition,))
    inside = holds(condition, computed, ()).reshape(2, POINTS)
    found = score(selected, aim_of(np.ones(POINTS)), computed, SCALES, np.random.default_rng(0)).log_likelihood
    for one in range(2):
        alone = outcomes_of(
            computed.residual_velocity[one * POINTS :][:POINTS][inside[one]], np.zeros(inside[one].sum())
        )
        scales = {kind: scale[[one]] for kind, scale in SCALES.items()}
        by_hand = score(
            Data((VELOCITY,), None), aim_of(np.ones(inside[one].sum()), 1, 1), alone, scales, np.random.default_rng(0)
        )
        assert found[one] == pytest.approx(by_hand.log_likelihood[0])


def test_a_status_counts_the_hits_that_ended_so() -> None:
    status = np.where(np.arange(2 * POINTS) % 4 == 0, Status.ARRESTED, Status.PERFORATED)
    outcomes = outcomes_of(np.full(2 * POINTS, 500.0), np.zeros(2 * POINTS), status)
    found = score(Data((), "arrested"), aim_of(np.ones(POINTS)), outcomes, SCALES, np.random.default_rng(0))
    assert np.exp(found.log_likelihood) == pytest.approx([0.25, 0.25])


def test_shots_that_failed_do_not_count(computed: Outcomes) -> None:
    status = np.where(np.arange(2 * POINTS) < 4, Status.UNFINISHED, Status.PERFORATED)
    weight = np.ones(POINTS)
    weight[:4] = 0.0
    data, rng = Data((VELOCITY,), None), np.random.default_rng(0)
    failed = score(data, aim_of(np.ones(POINTS)), computed.assign(status=status.astype(np.int8)), SCALES, rng)
    left_out = score(data, aim_of(weight), computed, SCALES, rng)
    assert failed.log_likelihood[0] == pytest.approx(left_out.log_likelihood[0])


def test_kept_hits_follow_their_posterior() -> None:
    """Of two hits, one 2 standard deviations off: it has the share 1/(1 + e²)."""
    sets = 4000
    velocity = np.tile([600.0, 620.0], sets)
    scales = {"velocity": np.zeros(sets), "angle": np.zeros(sets)}
    data = Data((VELOCITY,), None)
    found = score(
        data, aim_of(np.ones(2), 1, sets), outcomes_of(velocity, np.zeros(2 * sets)), scales, np.random.default_rng(0)
    )
    assert (found.fitted[..., 0] == 620.0).mean() == pytest.approx(1.0 / (1.0 + np.exp(2.0)), abs=0.01)
    assert (found.fitted_hit[..., 0] == (found.fitted[..., 0] == 620.0)).all()
    assert found.predicted.mean() == pytest.approx(610.0, abs=0.5)
    assert found.predicted.var() == pytest.approx(100.0 + 100.0, rel=0.05)


def test_hits_cover_the_cell_and_know_their_class(make_fit: FitMaker) -> None:
    fit = make_fit()
    scene = fit.scene_of(fit.shots[0])
    plate, core = scene.target.layers[0], scene.core
    points = aim(fit.shots[0], plate, core, fit.sampling, SHIFTS)
    assert len(points.group) == 4
    assert len(points.computed) == fit.sampling.hits
    share = 1.0 - np.pi * 4.0**2 / 12.0**2
    assert points.weight.mean() == pytest.approx(share, abs=0.03)
    inside = CLASSES["through a hole"](plate, core, points.shots.hit_y, points.shots.hit_z)
    assert (inside == (np.hypot(points.shots.hit_y, points.shots.hit_z) <= 4e-3)).all()
    edge = CLASSES["at an edge"](plate, core, points.shots.hit_y, points.shots.hit_z)
    beyond = np.abs(np.hypot(points.shots.hit_y, points.shots.hit_z) - 4e-3) < 2.9e-3
    assert (edge | ~beyond).all()  # the circle of 3 mm crosses the hole's edge wherever it comes that near


def test_a_place_with_its_uncertainty_is_drawn(make_fit: FitMaker) -> None:
    place = '{ y = "6 mm", z = { distribution = "normal", mean = "5 mm", std = "0.5 mm" } }'
    fit = make_fit(('hit = "between holes"', f"hit = {place}"))
    scene = fit.scene_of(fit.shots[0])
    points = aim(fit.shots[0], scene.target.layers[0], scene.core, fit.sampling, SHIFTS)
    assert (points.shots.hit_y == 6e-3).all()
    assert points.shots.hit_z.mean() == pytest.approx(5e-3, abs=5e-5)
    assert points.shots.hit_z.std() == pytest.approx(0.5e-3, rel=0.1)
    exact = make_fit(('hit = "between holes"', 'hit = { y = "6 mm", z = "5 mm" }'))
    assert len(aim(exact.shots[0], scene.target.layers[0], scene.core, fit.sampling, SHIFTS).shots) == 1


def test_an_interval_of_degradation_is_a_degradation_of_the_shot(make_fit: FitMaker) -> None:
    """β^(T/Δt) is one law for (0.8, 2 µs) and (0.8^(1/2), 1 µs): the column gives what the scene itself gives."""
    fit = make_fit(
        ('thickness = "3 mm"', 'thickness = "3 mm"\ndegradation = 0.8'),
        (
            "[prior.plate]",
            '[prior.plate]\ndegradation_interval = { distribution = "uniform", low = "1 us", high = "3 us" }',
        ),
    )
    (bench,) = benches(fit)
    column = [one.name for one in fit.parameters].index("degradation_interval")
    points = np.zeros((2, len(fit.parameters)))
    points[1, column] = 1.0
    ((run, outcomes),) = scoring.computed(fit, bench, points, CPU)
    values = {one.path: float(one.at(points[1:, i])[0]) for i, one in enumerate(fit.parameters)}
    scene = fit.scene_of(fit.shots[0], values)
    assert scene.target.layers[0].degradation_interval == values["plate", "degradation_interval"]
    own = run.aim.computed[fit.sampling.hits :]
    alone = simulate(scene, own, numerics=fit.numerics, device="cpu")
    again = outcomes.residual_velocity.reshape(2, -1)[1]
    assert again == pytest.approx(alone.residual_velocity, abs=0.02)


def test_sets_that_differ_in_discrepancy_alone_share_their_runs(make_fit: FitMaker) -> None:
    fit = make_fit()
    points = np.random.default_rng(0).standard_normal((4, len(fit.parameters)))
    points[[1, 3], :2] = points[[0, 2], :2]
    (bench,) = benches(fit)
    assert sum(len(run.which) for run, _ in scoring.computed(fit, bench, points, CPU)) == 2
    together = evaluate(fit, points[:2], CPU, seed=0)  # each set has hits of its own
    for row in range(2):
        alone = evaluate(fit, points[[row]], CPU, seed=0)
        for one, other in zip(together, alone, strict=True):
            assert one.log_likelihood[row] == pytest.approx(other.log_likelihood[0])
    assert data_of(fit, fit.shots[0]).standoffs == (0.05,)
