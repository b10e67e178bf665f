"""The search for limits: its cost, its ends, shots with parameters of their own, and what it refuses."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import CirclePattern, Layer, OgiveCore, Plate, Scene, Shots, Target
from warpimpact.solver import limit
from warpimpact.solver.device import Cancel, Cancelled, Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import MOST_RUNS, Limits, LimitSpec
from warpimpact.solver.marching import FastLawComputation
from warpimpact.solver.simulate import simulate

from ...verification.scenes import shots_at

Array = NDArray[np.float64]

CORE = OgiveCore(diameter=6.17e-3, length=27e-3, crh=3.0, mass=5.25e-3)
PLATE = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05)
SCENE = Scene(core=CORE, target=PLATE)
STANDARD = FastLaw(level=2)


def limits(scene: Scene, some: Shots, numerics: FastLaw, *spec: Any, threads: int | None = None) -> Limits:
    return limit.limits(scene, some, LimitSpec.of(scene, *spec), numerics, Worker("cpu", threads))


def shots(count: int, velocity: float = 800.0, **own: object) -> Shots:
    return Shots(**shots_at(np.zeros(count), velocity=velocity).columns | own)


@pytest.mark.parametrize("velocity", [10.0, 3000.0])
def test_a_search_converges_from_any_start(velocity: float) -> None:
    actual = limits(SCENE, shots(2, velocity), STANDARD)
    assert (actual.runs <= MOST_RUNS).all()
    assert actual.converged.all()
    assert actual.value == pytest.approx(limits(SCENE, shots(2), STANDARD).value, abs=1.0)


def test_a_limit_beyond_the_largest_value_tried_is_infinite() -> None:
    strong = Scene(core=CORE, target=PLATE.model_copy(update={"thickness": 0.2}))
    velocity = limit.limits(strong, shots(1), LimitSpec("velocity", 1.0, highest=1000.0), STANDARD, Worker("cpu"))
    assert (velocity.value.item(), velocity.lower.item(), velocity.upper.item()) == (np.inf, 1000.0, np.inf)
    thin = PLATE.model_copy(update={"thickness": 0.1e-3})
    thickness = limits(Scene(core=CORE, target=thin), shots(1), STANDARD, "thickness")
    assert (thickness.value.item(), thickness.lower.item(), thickness.upper.item()) == (np.inf, 1.6e-3, np.inf)
    assert velocity.converged.item()
    assert thickness.converged.item()


def test_thickness_of_a_layer_of_its_own() -> None:
    # Solid plates far apart take their work one after the other: what the front leaves to do is done by the base.
    base = Layer(thickness=3e-3, resistance=PLATE.resistance, shear_coefficient=0.05, gap=0.1)
    scene = Scene(core=CORE, target=Target(layers=(PLATE, base)))
    alone = limits(SCENE, shots(1), STANDARD, "thickness").value.item()
    behind = limits(scene, shots(1), STANDARD, "thickness", 1)
    assert behind.converged.all()
    assert behind.value.item() == pytest.approx(alone - 4e-3, rel=0.03)
    assert behind.shots.layer_value(scene.target, "thickness", 1).item() == behind.lower.item()


HOLES = PLATE.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3))})


def scattered(count: int, **own: object) -> Shots:
    rng = np.random.default_rng(1)
    return replace(shots(count, **own), hit_y=rng.uniform(-4e-3, 4e-3, count), hit_z=rng.uniform(-4e-3, 4e-3, count))


def test_a_limit_depends_on_its_hit_alone_in_ten_runs() -> None:
    scene, many = Scene(core=CORE, target=HOLES), scattered(40)
    together = limits(scene, many, FastLaw(level=0), threads=2)
    alone = limits(scene, many[np.arange(30, 40)], FastLaw(level=0), threads=1)
    assert np.array_equal(together.value[30:], alone.value)
    assert np.array_equal(together.shots.velocity[30:], alone.shots.velocity)
    assert together.converged.all()
    assert together.runs.mean() < 8.0  # measured: 6.8


@pytest.mark.parametrize("quantity", ["velocity", "thickness"])
def test_a_plate_that_weakens_by_time_is_refused(quantity: str) -> None:
    weakening = PLATE.model_copy(update={"degradation": 0.8})
    with pytest.raises(ValueError, match=r"stops no core.*give degradation_distance in its place"):
        limits(Scene(core=CORE, target=weakening), shots(1), STANDARD, quantity)
    with pytest.raises(ValueError, match="degradation_distance"):
        limits(SCENE, shots(2, degradation=np.array([1.0, 0.9])), STANDARD, quantity)


def test_a_search_that_is_cancelled_ends() -> None:
    cancel = Cancel()
    cancel.cancel()
    with pytest.raises(Cancelled):
        limit.limits(SCENE, shots(3), LimitSpec("velocity", 1.0, 3000.0), STANDARD, Worker("cpu", cancel=cancel))


def outcomes_by(end: Callable[[Shots], tuple[Array, Array]]) -> Callable[..., Outcomes]:
    """A computation with status and residual velocity [m/s] by a formula."""
    base = simulate(SCENE, shots(1), method=STANDARD, device="cpu")

    def ended(computation: FastLawComputation) -> Outcomes:
        some = computation.prepared.shots
        status, speed = end(some)
        columns = {name: np.repeat(column, len(some), axis=0) for name, column in vars(base).items()}
        return Outcomes(**columns | {"status": status.astype(np.int8), "residual_velocity": speed})

    return ended


def test_a_run_that_fails_far_from_the_limit_spoils_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    # A slow core that flies back from the base, and leaves the largest window between the layers.
    def end(some: Shots) -> tuple[Array, Array]:
        passes, lost = some.velocity > 775.0, some.velocity < 430.0
        status = np.where(passes, Status.PERFORATED, np.where(lost, Status.LEFT_WINDOW, Status.ARRESTED))
        speed = np.sqrt(0.77 * np.maximum(some.velocity**2 - 775.0**2, 0.0))
        speed[lost] = np.nan
        return status, speed

    monkeypatch.setattr(FastLawComputation, "compute", outcomes_by(end))
    actual = limits(SCENE, shots(2, 825.0), STANDARD)
    assert actual.converged.all()
    assert actual.value == pytest.approx([775.0] * 2, abs=1.0)
    assert (actual.outcomes.status == Status.PERFORATED).all()


def test_a_run_that_fails_at_the_limit_leaves_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def end(some: Shots) -> tuple[Array, Array]:
        passes = some.velocity > 775.0
        status = np.where(passes, Status.PERFORATED, np.where(some.velocity > 700.0, Status.NOT_FINITE, 1))
        return status, np.where(passes, 100.0, 0.0)

    monkeypatch.setattr(FastLawComputation, "compute", outcomes_by(end))
    actual = limits(SCENE, shots(1), STANDARD)
    assert np.isnan(actual.value.item())
    assert not actual.converged.item()
    assert actual.outcomes.status.item() == Status.NOT_FINITE
    assert 700.0 < actual.shots.velocity.item() <= 775.0
