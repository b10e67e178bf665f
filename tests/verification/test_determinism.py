"""The same shots give the same bits, however they are distributed."""

from typing import Any

import numpy as np
import pytest

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Shots
from warpimpact.solver import marching

from .scenes import paper_plate, scattered_hits, shots_at, simulate

COUNT = 100


def mixed_shots() -> Shots:
    """Velocities, obliquities and attitudes that differ from hit to hit, so that windows and steps do."""
    rng = np.random.default_rng(1)
    return shots_at(
        *scattered_hits(COUNT),
        velocity=rng.uniform(300.0, 900.0, COUNT),
        obliquity=rng.uniform(0.0, 70.0, COUNT),
        azimuth=rng.uniform(0.0, 360.0, COUNT),
        pitch=rng.uniform(-10.0, 10.0, COUNT),
        yaw=rng.uniform(-10.0, 10.0, COUNT),
        spin=rng.uniform(0.0, 2e4, COUNT),
    )


ALIKE, MIXED = shots_at(*scattered_hits(COUNT)), mixed_shots()
KINDS = pytest.mark.parametrize("shots", [ALIKE, MIXED], ids=["alike", "mixed"])
NUMERICS = pytest.mark.parametrize(
    "numerics",
    [{"precision": "single"}, {"precision": "double"}, {"precision": "single", "time_step": 0.7e-6}],
    ids=["single", "double", "fixed step"],
)


def outcomes_of(shots: Shots, device: str, numerics: dict[str, Any]) -> Outcomes:
    return simulate(paper_plate(), shots, level=0, device=device, **numerics)


def assert_identical(got: Outcomes, expected: Outcomes) -> None:
    for name, values in vars(expected).items():
        np.testing.assert_array_equal(getattr(got, name), values, err_msg=name)


@KINDS
@NUMERICS
def test_same_shots_twice(shots: Shots, numerics: dict[str, Any], device: str) -> None:
    assert_identical(outcomes_of(shots, device, numerics), outcomes_of(shots, device, numerics))


@KINDS
@NUMERICS
@pytest.mark.parametrize("size", [1, 7, 32, 33, 64])
def test_any_split(shots: Shots, numerics: dict[str, Any], size: int, device: str) -> None:
    parts = [outcomes_of(shots[k : k + size], device, numerics) for k in range(0, COUNT, size)]
    assert_identical(Outcomes.joined(parts), outcomes_of(shots, device, numerics))


@KINDS
@pytest.mark.parametrize("threads", [1, 3, 8])
def test_any_number_of_threads(shots: Shots, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = outcomes_of(shots, "cpu", {})
    monkeypatch.setattr(marching, "launching", lambda _: threads)
    assert_identical(outcomes_of(shots, "cpu", {}), expected)


@KINDS
def test_any_chunk(shots: Shots, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = outcomes_of(shots, "cpu", {})
    monkeypatch.setattr(marching, "CHUNK", 5)
    assert_identical(outcomes_of(shots, "cpu", {}), expected)


def test_first_window_is_wide_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    # A hit that leaves it is computed again: this is right, but twice the work. 9 % of these hits leave windows of 1.2
    # radii.
    marched, march_some = [], marching.March._march_some

    def counted(self: marching.March, pending: Any, *rest: Any) -> None:
        marched.append(len(pending))
        march_some(self, pending, *rest)

    monkeypatch.setattr(marching.March, "_march_some", counted)
    simulate(paper_plate(), ALIKE)
    assert marched == [COUNT]
