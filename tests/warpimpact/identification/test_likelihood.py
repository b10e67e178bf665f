"""The likelihood of a shot against a sum written out, and the hits that it is integrated over."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.identification.fit import Fit, MeasuredShot
from warpimpact.identification.fit_file import Observation
from warpimpact.identification.likelihood import SCORES, HitPoints, evaluate, hit_points, score_shot
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import OUTCOME_VARIABLES
from warpimpact.scene import IDENTITY, Shots, Symmetry
from warpimpact.solver.device import Worker
from warpimpact.solver.simulate import simulate

FitMaker = Callable[..., Fit]
POINTS, SETS = 16, 2
CPU = Worker("cpu")
VELOCITY = Observation("residual_velocity", None, 600.0, 10.0)
YAW = Observation("yaw", 0, np.radians(170.0), np.radians(3.0))
SCALES = {"velocity": np.array([0.0, 5.0]), "angle": np.radians([0.0, 4.0])}
MIRRORED = (IDENTITY, Symmetry(-1, 1, False))


def outcomes_of(velocity: np.ndarray, angle: np.ndarray, status: Any = Status.PERFORATED) -> Outcomes:
    """Outcomes with these residual velocities [m/s] and yaws at one stand-off [rad]."""
    count = len(velocity)
    columns = {str(one): np.zeros(count) for one in OUTCOME_VARIABLES}
    columns |= dict.fromkeys(("tilt", "pitch", "yaw", "total_yaw"), angle[:, None])
    return Outcomes(**columns | {"status": np.broadcast_to(np.int8(status), count), "residual_velocity": velocity})


@pytest.fixture
def computed() -> Outcomes:
    rng = np.random.default_rng(3)
    return outcomes_of(
        600.0 + 15.0 * rng.standard_normal(SETS * POINTS), np.radians(175.0 + 20.0 * rng.random(SETS * POINTS))
    )


@pytest.fixture
def score(make_fit: FitMaker) -> Callable[..., xarray.Dataset]:
    """A function of observations and outcomes; points lie at y = 0, 1, 2, … m."""

    def scored(
        observations: tuple[Observation, ...],
        outcomes: Outcomes,
        *,
        status: str | None = None,
        group: tuple[Symmetry, ...] = (IDENTITY,),
        uniform: np.ndarray | None = None,
        scales: Any = SCALES,
    ) -> xarray.Dataset:
        sets = len(scales["velocity"])
        each, zeros = len(outcomes) // sets, np.zeros(len(outcomes))
        shots = Shots(
            **dict.fromkeys(("velocity", "obliquity", "azimuth", "pitch", "yaw", "spin"), zeros),
            hit_y=np.tile(np.arange(float(each)), sets),
            hit_z=zeros,
        )
        shot: MeasuredShot = replace(make_fit().shots[0], observations=observations, status=status)
        points = HitPoints(shots, group, (100.0, 100.0))
        scores = score_shot(shot, points, outcomes, scales, np.full(sets, 0.5) if uniform is None else uniform)
        return xarray.Dataset({name: ("set", column) for name, column in zip(SCORES, scores, strict=True)})

    return scored


@pytest.mark.parametrize("group", [(IDENTITY,), MIRRORED], ids=["alone", "mirrored"])
def test_the_likelihood_is_the_mean_over_the_hits(
    computed: Outcomes, score: Callable[..., xarray.Dataset], group: tuple[Symmetry, ...]
) -> None:
    """The image of a hit has the yaw with the other sign."""
    scored = score((VELOCITY, YAW), computed, group=group)
    for one in range(SETS):
        densities = []
        for place in range(one * POINTS, (one + 1) * POINTS):
            for symmetry in group:
                # The yaws lie on both sides of 180 degrees, the measured one at 170.
                yaw = np.degrees(computed.yaw[place, 0]) * symmetry.along_y % 360.0
                density = 1.0
                for miss, spread in (
                    (computed.residual_velocity[place] - 600.0, np.hypot(10.0, SCALES["velocity"][one])),
                    (yaw - 170.0, np.degrees(np.hypot(YAW.std, SCALES["angle"][one]))),
                ):
                    density *= np.exp(-0.5 * (miss / spread) ** 2) / (np.sqrt(2.0 * np.pi) * spread)
                densities.append(density)
        assert float(scored.log_likelihood[one]) == pytest.approx(np.log(np.mean(densities)) + np.log(np.degrees(1.0)))


def test_a_status_counts_the_hits_that_ended_so(score: Callable[..., xarray.Dataset]) -> None:
    status = np.where(np.arange(SETS * POINTS) % 4 == 0, Status.ARRESTED, Status.PERFORATED)
    outcomes = outcomes_of(np.full(SETS * POINTS, 500.0), np.zeros(SETS * POINTS), status)
    assert np.exp(score((), outcomes, status="arrested").log_likelihood.values) == pytest.approx([0.25, 0.25])
    none = score((), outcomes, status="untouched")
    assert np.isneginf(none.log_likelihood).all()
    assert np.isinf(none.misfit).all()


def test_shots_that_failed_do_not_count(computed: Outcomes, score: Callable[..., xarray.Dataset]) -> None:
    status = np.where(np.arange(SETS * POINTS) % POINTS < 8, Status.UNFINISHED, Status.PERFORATED)
    failed = score((VELOCITY,), computed.assign(status=status.astype(np.int8)))
    later = np.arange(SETS * POINTS) % POINTS >= 8
    left_out = score((VELOCITY,), outcomes_of(computed.residual_velocity[later], computed.yaw[later, 0]))
    assert failed.log_likelihood.values == pytest.approx(left_out.log_likelihood.values)


def test_hits_follow_their_posterior(score: Callable[..., xarray.Dataset]) -> None:
    """Of two hits, one 2 standard deviations off: it has the share 1/(1 + e²)."""
    sets = 4000
    velocity = np.tile([600.0, 620.0], sets)
    uniform, scales = np.random.default_rng(0).random(sets), {"velocity": np.zeros(sets), "angle": np.zeros(sets)}
    scored = score((VELOCITY,), outcomes_of(velocity, np.zeros(2 * sets)), uniform=uniform, scales=scales)
    assert float((scored.hit_y == 1.0).mean()) == pytest.approx(1.0 / (1.0 + np.exp(2.0)), abs=0.01)
    assert (scored.misfit == 0.0).all()


def test_hits_cover_the_cell(make_fit: FitMaker) -> None:
    fit = make_fit()
    plate = fit.scene_of(fit.shots[0]).target.layers[0]
    points = hit_points(fit, fit.shots[0], plate, np.array([[0.2, 0.7]]))
    assert len(points.group) == 4
    assert len(points.shots) == fit.file.sampling.hits
    images = [one.image(points.shots.hit_y, points.shots.hit_z, points.cell) for one in points.group]
    y, z = np.concatenate(images, axis=1)
    inside = plate.pattern.is_hole(y, z)
    assert inside.mean() == pytest.approx(np.pi * 4.0**2 / 12.0**2, abs=0.03)
    assert [np.mean(y), np.mean(z)] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_place_with_its_uncertainty_is_drawn(make_fit: FitMaker) -> None:
    place = '{ y = "6 mm", z = { distribution = "normal", mean = "5 mm", std = "0.5 mm" } }'
    fit = make_fit(('hit = "unknown"', f"hit = {place}"))
    plate, shifts = fit.scene_of(fit.shots[0]).target.layers[0], np.array([[0.2, 0.7]])
    shots = hit_points(fit, fit.shots[0], plate, shifts).shots
    assert (shots.hit_y == 6e-3).all()
    assert shots.hit_z.mean() == pytest.approx(5e-3, abs=5e-5)
    assert shots.hit_z.std() == pytest.approx(0.5e-3, rel=0.1)
    exact = make_fit(('hit = "unknown"', 'hit = { y = "6 mm", z = "5 mm" }'))
    assert len(hit_points(exact, exact.shots[0], plate, shifts).shots) == 1


def test_an_interval_of_degradation_is_a_degradation_of_the_shot(make_fit: FitMaker) -> None:
    """β^(T/Δt) is one law for (0.8, 2 µs) and (0.8^(1/2), 1 µs): the column gives what the scene itself gives."""
    fit = make_fit(
        ("[sampling]", "[discrepancy]\nvelocity = 0\nangle = 0\n[sampling]"),
        ('thickness = "3 mm"', 'thickness = "3 mm"\ndegradation = 0.8'),
        (
            "[prior.plate]",
            '[prior.plate]\ndegradation_interval = { distribution = "uniform", low = "1 us", high = "3 us" }',
        ),
    )
    points = np.zeros((2, len(fit.parameters)))
    points[1, [one.name for one in fit.parameters].index("degradation_interval")] = 1.0
    values = {one.place: float(one.at(points[1:, i])[0]) for i, one in enumerate(fit.parameters)}
    scene = fit.scene_of(fit.shots[0], values)
    assert scene.target.layers[0].degradation_interval == values["plate.degradation_interval"]
    uniform = np.full((2, 4), 0.3)
    own = hit_points(fit, fit.shots[0], scene.target.layers[0], uniform[1:, :2])
    alone = simulate(scene, own.shots, method=fit.file.numerics, device="cpu")
    scales = {"velocity": np.array([0.0]), "angle": np.array([0.0])}
    scored = evaluate(fit, points, uniform, CPU)
    expected, *_ = score_shot(fit.shots[0], own, alone, scales, uniform[1:, 2])
    assert float(scored.log_likelihood[1, 0]) == pytest.approx(expected[0], abs=0.02)


def test_a_score_depends_on_no_other_set(make_fit: FitMaker) -> None:
    fit, rng = make_fit(), np.random.default_rng(0)
    points, uniform = rng.standard_normal((4, 4)), rng.random((4, 4))
    together = evaluate(fit, points, uniform, CPU)
    for row in range(4):
        alone = evaluate(fit, points[[row]], uniform[[row]], CPU)
        np.testing.assert_allclose(together.log_likelihood[row], alone.log_likelihood[0], rtol=1e-5)
