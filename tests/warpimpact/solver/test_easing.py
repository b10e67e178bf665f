"""Coarser levels of single settings, where a level keeps its promise with room to spare."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Accuracy, Hits, Impact, Numerics, Record, Scene, Shots, make_shots
from warpimpact.solver import easing
from warpimpact.solver.changes import changes
from warpimpact.solver.climb import MARGIN
from warpimpact.solver.easing import FEW, PART, ROOM, WIDE, eased
from warpimpact.solver.findings import HitErrors
from warpimpact.solver.resolution import LADDER
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

from ...verification.scenes import PAPER_CORE, paper_plate

PLATE = paper_plate()
SCENE = Scene(core=PAPER_CORE, target=PLATE, record=Record(standoffs=(0.13,)))
PILOT, OTHERS = (make_shots(Impact(velocity=825.0), Hits(count=64, seed=seed), PLATE) for seed in (1, 2))


@pytest.mark.parametrize("allowed", [0.7, 2.0])
def test_a_long_run_has_coarser_settings_that_keep_the_promise_on_other_hits(allowed: float) -> None:
    accuracy = Accuracy(residual_velocity=allowed, tilt=allowed)
    asked, many = Numerics(accuracy=accuracy, precision="double"), PART * len(PILOT)
    short, long = (pilot_of(SCENE, PILOT, asked, Worker("cpu"), hits=hits) for hits in (many - 1, many))
    assert short.numerics.coarser is None
    assert (long.kept, long.numerics.level, long.numerics.precision) == (True, short.numerics.level, "double")
    assert long.numerics.coarser is not None
    assert len(long.tried) == len(short.tried)
    taken = next(coarse for one, coarse, _ in long.tried if one.numerics == long.numerics)
    again = simulate(SCENE, PILOT, numerics=long.numerics, device="cpu")
    np.testing.assert_array_equal(taken.residual_velocity, again.residual_velocity)
    found, truth = (simulate(SCENE, OTHERS, numerics=one, device="cpu") for one in (long.numerics, Numerics(level=6)))
    velocity, tilt, _ = (np.quantile(of, 0.9) for of in changes(found, truth))
    assert velocity <= long.residual_velocity_error <= accuracy.residual_velocity
    assert tilt <= long.tilt_error <= accuracy.tilt


def trials(
    excess: dict[str, float], monkeypatch: pytest.MonkeyPatch, level: int = 4, status: dict[str, float] | None = None
) -> tuple[list[str], HitErrors]:
    """What is tried from a level on, by the excess of each trial, and the share of the hits that end otherwise; and
    what is taken. The pilot tried the next finer level, too, with outcomes of its own."""
    between, fine = (simulate(SCENE, PILOT[:2], numerics=Numerics(level=k), device="cpu") for k in (0, 1))
    ended = {"status_error": (status or {}).get("", 0.0)}
    other, found = (HitErrors(Numerics(level=at), True, 0.9, 0.0, 0.0, **ended) for at in (level + 1, level))
    found = replace(found, tried=((other, fine, between), (found, between, fine)))
    outcomes, tried = dict[str, Outcomes](), list[str]()

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        assert (at.level, len(some)) == (level, len(fine))
        tried.append(str(at.coarser))
        return outcomes.setdefault(tried[-1], Outcomes.joined([between]))

    def judged(coarse: Outcomes, against: Outcomes, shots: Shots, at: Numerics, *given: Any) -> tuple[Any, ...]:
        name = str(at.coarser or "")
        assert coarse is outcomes.get(name, between)
        assert (against, len(shots)) == (fine, len(fine))
        assert given == (Numerics().asked, MARGIN[1 if level == len(LADDER) - 2 else 2], (True,), between)
        over = excess.get(name, 2.0)
        return HitErrors(at, over <= 1.0, 0.9, over, 0.0, status_error=(status or {}).get(name, 0.0)), over, math.inf

    monkeypatch.setattr(easing, "judged", judged)
    best = eased(found, outcomes_at, PILOT, Numerics(), (True,))
    assert best.tried[0] == found.tried[0]
    assert best.tried[1][0].numerics == best.numerics
    assert best.tried[1][1] is outcomes.get(str(best.numerics.coarser or ""), between)
    assert best.tried[1][2] is fine
    return tried, best


@pytest.mark.parametrize(
    ("level", "excess", "coarser"),
    [
        (4, {"": 0.9 * FEW}, ""),
        (4, {"": 1.1 * FEW, "step 2": 0.9 * FEW}, "step 2"),
        (4, {"": ROOM + 0.01}, ""),
        (4, {"": WIDE + 0.01, "step 3": ROOM + 0.01, "grid 3": ROOM}, "grid 3"),
        (4, {"": WIDE - 0.01, "step 2": 1.1, "step 3": 0.8, "grid 3, step 3": ROOM}, "grid 3, step 3"),
        (4, {"": WIDE - 0.01, "step 2": 0.8, "grid 3, step 2": ROOM}, "grid 3, step 2"),
        (4, {"": 0.6, "step 3": 0.7, "grid 3, step 3": 1.1, "around 3, step 3": 1.2, "along 3, step 3": 1.3}, "step 3"),
        (0, {"": 0.3}, ""),
        (1, {"": 0.3, "step 0": ROOM}, "step 0"),
        (2, {"": 0.3, "step 0": ROOM}, "step 0"),
        (8, {"": 0.3, "step 6": ROOM}, "step 6"),
    ],
)
def test_what_is_tried_goes_by_the_room_that_is_left(
    level: int, excess: dict[str, float], coarser: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried, found = trials(excess, monkeypatch, level)
    assert tried == [name for name in excess if name]
    assert str(found.numerics.coarser or "") == coarser
    assert found.residual_velocity_error == excess[coarser]


@pytest.mark.parametrize(
    ("status", "coarser"),
    [
        ({"step 3": 0.01}, "grid 3, step 3"),  # as many as standard allows
        ({"step 3": 0.011}, ""),
        ({"": 0.02, "step 3": 0.02}, "grid 3, step 3"),  # no more than at the level itself
        ({"": 0.02, "grid 3, step 3": 0.02}, "step 3"),  # more than with that step
        ({"": math.nan, "step 3": math.nan, "grid 3, step 3": math.nan}, "grid 3, step 3"),  # a single plate
    ],
)
def test_no_more_hits_end_otherwise_than_may(
    status: dict[str, float], coarser: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, found = trials({"": 0.6, "step 3": 0.7, "grid 3, step 3": 0.8}, monkeypatch, status=status)
    assert str(found.numerics.coarser or "") == coarser


def test_a_level_that_does_not_keep_its_promise_stays_as_it_is() -> None:
    asked = Numerics(accuracy={"residual_velocity": 1e-6})
    found = pilot_of(SCENE, PILOT[:2], asked, Worker("cpu"), hits=10**6)
    assert not found.kept
    assert found.numerics.coarser is None


@pytest.mark.parametrize(("status", "taken"), [(0.02, "step 3"), (0.03, ""), (math.nan, "step 3")])
def test_a_level_that_keeps_it_with_weighed_errors_is_judged_by_them(
    status: float, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = simulate(SCENE, PILOT[:1], numerics=Numerics(level=0), device="cpu")

    def judged(*given: object) -> tuple[HitErrors, float, float]:
        at = given[3]
        assert isinstance(at, Numerics)
        other = 0.02 if at.coarser is None else status
        weighed = {"": 0.6, "step 3": ROOM}.get(str(at.coarser or ""), 2.0)
        return HitErrors(at, False, 0.9, 9.0, 0.0, status_error=other), 9.0, weighed

    monkeypatch.setattr(easing, "judged", judged)
    found = HitErrors(Numerics(level=4), False, 0.9, 9.0, 0.0, status_error=0.02)
    found = replace(found, tried=((found, nothing, nothing),))
    best = eased(found, lambda at, some: nothing, PILOT, Numerics(), (True,))
    assert (best.kept, str(best.numerics.coarser or "")) == (False, taken)


def test_errors_of_the_finer_level_count_as_much_as_the_level_between_says() -> None:
    asked = Numerics()
    coarse, between, fine = (
        simulate(SCENE, PILOT[:16], numerics=Numerics(level=level), device="cpu") for level in (0, 2, 4)
    )

    def tilt(one: Outcomes, margin: float, between: Outcomes | None = None) -> float:
        shots, at = PILOT[:16], Numerics(level=0)
        return easing.judged(one, fine, shots, at, asked.asked, margin, (True,), between)[0].tilt_error

    expected = tilt(coarse, 1.0) + 0.4 * tilt(between, 1.0)
    assert tilt(coarse, 1.4, between) == pytest.approx(expected)
    assert tilt(between, 1.4, between) == pytest.approx(tilt(between, 1.4))
    assert math.isfinite(expected)
