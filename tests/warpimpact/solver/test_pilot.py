"""The resolution that a pilot chooses keeps its promise on hits that were not in the pilot."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from warpimpact import Campaign, run
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.runs.compute import HitMap
from warpimpact.runs.replay import replay
from warpimpact.scene import PRESETS, Accuracy, Hits, Impact, Numerics, Record, Scene, Shots, make_shots
from warpimpact.solver import pilot
from warpimpact.solver.changes import LevelVerdict, changes, ended_otherwise
from warpimpact.solver.findings import HitErrors, LimitErrors, errors_text, upper_digits
from warpimpact.solver.pilot import (
    ERROR_PER_CHANGE,
    FINEST_LIMIT,
    LIMITS,
    PART,
    ROOM,
    Aim,
    climb,
    limits_pilot_size,
    pilot_hits,
    pilot_limits,
    pilot_size,
)
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

from ...verification.scenes import PAPER_CORE, paper_plate
from .shanked import IMPACT, OTHERS, PILOT, PLATE, SCENE, STOPPING

NOTHING = Numerics(accuracy={"residual_velocity": 1e-9})
BOTH = Shots.joined([PILOT, PILOT])


@pytest.fixture(scope="module")
def limit() -> Outcomes:
    """Of the hits that are not in the pilot, finer by three levels at least than the names need here."""
    return simulate(SCENE, OTHERS, numerics=Numerics(level=7), device="cpu")


@pytest.fixture(scope="module")
def known() -> Outcomes:
    return simulate(SCENE, BOTH, numerics=Numerics(level=0), device="cpu")


@pytest.fixture(scope="module")
def stopping() -> Outcomes:
    return simulate(STOPPING, PILOT, numerics=Numerics(level=0), device="cpu")


def found_for(numerics: Numerics, shots: Shots = PILOT, scene: Scene = SCENE) -> HitErrors:
    return pilot_of(scene, shots, numerics, Worker("cpu"))


def cheap(level: int) -> float:
    return 1e-6


def dear(level: int) -> float:
    return 1.0


@pytest.fixture
def from_level(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lets a pilot begin at a level, with other settings of its rule."""

    def begin(level: int = 0, **settings: Any) -> None:
        monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: level)
        for name, value in settings.items():
            monkeypatch.setattr(pilot, name, value)

    return begin


@pytest.mark.parametrize("name", ["draft", "standard"])
def test_a_shanked_core_gets_the_accuracy_that_the_name_promises(name: str, limit: Outcomes) -> None:
    many = make_shots(IMPACT, Hits(count=256, seed=5), PLATE)
    found, accuracy = found_for(Numerics(fidelity=name), many), PRESETS[name]
    assert found.kept
    assert found.numerics.level <= 4
    each = changes(simulate(SCENE, OTHERS, numerics=found.numerics, device="cpu"), limit)
    velocity, tilt = (float(np.quantile(errors, 0.9)) for errors in each[:2])
    assert velocity <= accuracy.residual_velocity
    assert tilt <= accuracy.tilt
    # The errors that are told are upper estimates of the true ones; one in six may lie below (RISK).
    assert velocity / 1.3 <= found.residual_velocity_error <= accuracy.residual_velocity
    assert tilt / 1.3 <= found.tilt_error <= accuracy.tilt


def test_draft_tells_errors_that_other_hits_keep_where_a_base_stops_some_of_them() -> None:
    some, others = (make_shots(IMPACT, Hits(count=64, seed=seed), PLATE) for seed in (5, 6))
    found = found_for(Numerics(fidelity="draft"), some, STOPPING)
    coarse, fine = (
        simulate(STOPPING, others, numerics=one, device="cpu") for one in (found.numerics, Numerics(level=7))
    )
    assert 0.2 < (fine.status == Status.ARRESTED).mean() < 0.8
    velocity, tilt, depth = changes(coarse, fine)
    assert found.numerics.level <= 5
    assert np.nanquantile(velocity, 0.9) <= found.residual_velocity_error
    assert np.nanquantile(tilt, 0.9) <= found.tilt_error
    assert np.nanquantile(depth, 0.9) <= found.depth_error < 5e-3
    other = ended_otherwise(coarse, fine)
    assert (np.isnan(velocity) == other).all()
    assert other.mean() <= found.status_error + 3.0 / 64.0
    assert "mm of depth" in found.phrase


def test_an_accuracy_in_numbers_is_what_its_name_is() -> None:
    asked = {"residual_velocity": "5 m/s", "tilt": "5 deg"}
    numbers, name = (
        found_for(numerics, PILOT[:8]) for numerics in (Numerics(accuracy=asked), Numerics(fidelity="draft"))
    )
    assert (numbers.numerics, numbers.phrase) == (name.numerics, name.phrase)
    looser = found_for(Numerics(accuracy=asked | {"share": 0.5}), PILOT[:16])
    assert looser.tilt_error < found_for(Numerics(accuracy=asked), PILOT[:16]).tilt_error
    assert looser.phrase.endswith("for 50 % of the hits")


def test_simulate_keeps_a_promise_as_a_run_does() -> None:
    numerics = Numerics(fidelity="draft")
    every, piloted = PILOT[:8], found_for(numerics, PILOT[:8]).numerics
    asked, named = (simulate(SCENE, every, numerics=one, device="cpu") for one in (numerics, piloted))
    np.testing.assert_array_equal(asked.residual_velocity, named.residual_velocity)


@pytest.mark.parametrize(("share", "shots"), [(0.5, 64), (0.9, 64), (0.975, 64), (0.99, 160)])
def test_a_pilot_has_shots_beyond_the_share(share: float, shots: int) -> None:
    assert pilot_size(Numerics(accuracy={"tilt": "5 deg", "share": share}).asked) == shots
    assert pilot_size(PRESETS["reference"]) == 32
    assert [pilot_size(PRESETS["standard"], hits) for hits in (100, 2048, 10**6)] == [64, 128, 256]


def test_a_stricter_name_takes_a_finer_level_in_the_precision_asked_for() -> None:
    levels = [
        found_for(Numerics(fidelity=name, precision="double"), PILOT[:8]).numerics for name in ("draft", "standard")
    ]
    assert levels[0].level < levels[1].level
    assert all(one.precision == "double" for one in levels)


@pytest.mark.parametrize(("ladder", "further", "level", "finer"), [(2, 5, 0, 1), (10, 1, 1, 3)])
def test_a_promise_that_cannot_be_kept_ends_at_the_finest_level_that_may_be_taken(
    ladder: int, further: int, level: int, finer: int, from_level: Callable[..., None]
) -> None:
    from_level(0, LADDER=pilot.LADDER[:ladder], FURTHER=further, PATIENCE=0.0)
    found = found_for(NOTHING, PILOT[:4])
    assert (found.kept, found.numerics) == (False, Numerics(level=level))
    coarse, fine = (simulate(SCENE, PILOT[:4], numerics=Numerics(level=k), device="cpu") for k in (level, finer))
    largest = np.abs(coarse.residual_velocity - fine.residual_velocity).max()
    assert found.residual_velocity_error == pytest.approx(ERROR_PER_CHANGE[finer - level] * largest)


def test_levels_that_do_not_fit_the_memory_end_the_search() -> None:
    def full(at: Numerics, some: Shots) -> Outcomes:
        raise MemoryError

    found = pilot_hits(full, PILOT[:4], Numerics(), cheap)
    assert not found.kept
    assert math.isinf(found.tilt_error)
    assert found.numerics == Numerics(level=2)


def test_a_run_needs_an_accuracy_of_outcomes() -> None:
    with pytest.raises(ValueError, match="needs residual_velocity or tilt"):
        found_for(Numerics(accuracy={"limit": 0.01}), PILOT[:4])


CAMPAIGN = """
title = "t"
[core]
shape = "ogive"
diameter = "6.17 mm"
crh = 3
length = "27 mm"
mass = "5.25 g"
[plate]
thickness = "6 mm"
resistance = "2 GPa"
shear_coefficient = 0.08
degradation = 0.85
pattern = { shape = "circle", diameter = "7 mm", spacing = ["10 mm", "17.3 mm"], staggered = true }
[impact]
velocity = "820 m/s"
[hits]
count = 12
[numerics]
fidelity = "draft"
"""


@pytest.mark.parametrize("hits", ["count = 12", 'count = 12\nsampling = "grid"', "count = 16\nirreducible = true"])
def test_a_result_tells_its_promise_and_replays_on_its_level(hits: str) -> None:
    campaign = Campaign.from_text(CAMPAIGN.replace("count = 12", hits), name="t", folder=Path())
    result = run(campaign, device="cpu")
    assert HitMap().found_in(result) is not None
    assert result.attrs["promise_kept"] == 1
    assert 0.0 < result.attrs["residual_velocity_error"] <= 5.0
    assert 0.0 < result.attrs["tilt_error"] <= 5.0
    assert replay(result, 5, folder=Path()).attrs["agreement"] == "bit-identical"


def test_a_single_setting_promises_nothing() -> None:
    campaign = Campaign.from_text(CAMPAIGN + "patches_axial = 20\n", name="t", folder=Path())
    assert not {"promise_kept", "resolution", "tilt_error"} & run(campaign, device="cpu").attrs.keys()


@pytest.mark.parametrize(
    ("excess", "typical", "tried", "taken"),
    [
        ([1.9, 0.9], None, [0, 1], 1),
        # The level behind one that is far off is not tried.
        ([9.0, 5.0, 2.5, 1.2, 0.6], None, [0, 2, 3, 4], 4),
        # No finer level where errors do not fall: those of shots that all levels have, no upper estimates.
        ([9.0, 8.9, 8.8, 0.5], None, [0, 2], 0),
        ([2.0, 2.5, 3.0, 0.9], [3.0, 2.5, 2.0, 0.5], [0, 1, 2, 3], 3),
        ([2.0, 2.5, 3.0, 0.9], [3.0, 2.5, 2.2, 0.5], [0, 1, 2], 0),
        # The coarsest of the levels that err alike.
        ([3.0, 2.8, 1.7, 1.4, 1.5], None, [0, 1, 2, 3, 4], 2),
    ],
)
def test_levels_that_a_pilot_tries(
    excess: list[float], typical: list[float] | None, tried: list[int], taken: int
) -> None:
    seen = []

    def judge(level: int, finer: int) -> LevelVerdict:
        seen.append(level)
        return LevelVerdict(excess[level] <= 1.0, excess[level], (typical or excess)[level], math.inf)

    assert climb(judge, range(min(5, len(excess))), 1) == taken
    assert seen == tried


@pytest.mark.parametrize(("otherwise", "levels"), [(0, [0, 1, 2]), (4, [0, 1, 2, 3])])
def test_errors_do_not_stall_where_it_is_the_status_that_gets_better(
    otherwise: int, levels: list[int], stopping: Outcomes, from_level: Callable[..., None]
) -> None:
    ends, seen = np.where(np.arange(32) < otherwise, Status.RICOCHETED, stopping.status), []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:  # which err by as much at every level
        seen.append(at.level)
        speed = stopping.layer_residual_velocity + 100.0 * (at.level % 4 < 2)
        return stopping.assign(layer_residual_velocity=speed, status=ends if at.level == 0 else stopping.status)

    from_level(0, SHOTS=32, SKIPS_A_LEVEL=math.inf)
    pilot_hits(outcomes_at, PILOT, Numerics(), dear, (True, True))
    assert [level for level in sorted(set(seen)) if level + 2 in seen] == levels


@pytest.mark.parametrize(
    ("price", "tried"),
    [
        (cheap, [0, 1, 2, 3, 4]),  # takes no time: beyond the usual levels, as long as one is to be found
        (dear, [0, 1, 2]),  # the last of the usual levels
        # To look at the third level takes 16 hits at the fifth: as long as WORTH at the third, or longer.
        (lambda level: {2: 3.0, 4: 290.0}.get(level, 1.0), [0, 1, 2]),
        (lambda level: {2: 3.0, 4: 300.0}.get(level, 1.0), [0, 1]),
    ],
)
def test_a_pilot_looks_at_levels_that_are_worth_their_time(
    price: Callable[[int], float], tried: list[int], known: Outcomes, from_level: Callable[..., None]
) -> None:
    seen = []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        seen.append(at.level)  # errors fall to half from level to level, and the fifth keeps the promise
        return known[:16].assign(residual_velocity=known[:16].residual_velocity + 40.0 * 0.5**at.level)

    from_level(0, SHOTS=16, FURTHER=2, SKIPS_A_LEVEL=math.inf)
    found = pilot_hits(outcomes_at, PILOT[:16], Numerics(accuracy={"residual_velocity": 3.0}), price)
    assert sorted(level for level in set(seen) if level + 2 in seen) == tried
    assert found.kept == (tried[-1] == 4)


@pytest.mark.parametrize(("whole", "to"), [(False, 4), (True, 2)])
def test_errors_of_a_promise_that_is_not_kept_are_those_to_the_finest_level(
    whole: bool, to: int, known: Outcomes, from_level: Callable[..., None]
) -> None:
    # That of as many shots as are known of the level itself: what a measure shifts by needs them.
    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:  # which creep to no end
        return known[: len(some)].assign(residual_velocity=known[: len(some)].residual_velocity + 10.0 * at.level)

    from_level(0, SHOTS=16, FURTHER=3, OPEN=(0.0, math.inf) if whole else (2.0, 2.0))
    price = {2: 30.0, 4: 2e3 if whole else 1.0}  # so that 16 more hits at the fifth level are not worth their time
    count = 32 if whole else 16
    asked = Numerics(accuracy={"residual_velocity": 1.0})
    found = pilot_hits(outcomes_at, PILOT[:count], asked, lambda level: price.get(level, 1.0))
    assert (found.kept, found.numerics.level) == (False, 0)
    assert found.residual_velocity_error == pytest.approx(ERROR_PER_CHANGE[2] * 10.0 * to)
    assert found.tried[0].errors == found
    assert len(found.tried[0].coarse) == len(found.tried[0].fine) == count


@pytest.mark.parametrize(("otherwise", "parts"), [(0, [32, 32]), (1, [32, 32, 32, 32]), (3, [32, 32])])
def test_more_hits_tell_the_share_that_ends_otherwise(
    otherwise: int, parts: list[int], stopping: Outcomes, from_level: Callable[..., None]
) -> None:
    ends, counts = stopping.status.copy(), []
    ends[:otherwise] = np.where(ends[:otherwise] == Status.ARRESTED, Status.PERFORATED, Status.ARRESTED)

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        counts.append(len(some))
        return stopping.assign(status=ends if at.level == 2 and len(counts) < 3 else stopping.status)

    from_level(2, SHOTS=32, FURTHER_LAYERED=0)
    found = pilot_hits(outcomes_at, BOTH, Numerics(), dear, (True, True))
    assert counts == parts
    assert found.kept == (otherwise == 0)


def test_more_hits_of_a_coarser_level_tell_the_share_that_ends_otherwise_at_a_finer_one(
    stopping: Outcomes, from_level: Callable[..., None]
) -> None:
    other, computed = np.where(stopping.status == Status.ARRESTED, Status.PERFORATED, Status.ARRESTED), []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        computed.append((at.level, len(some)))
        first = (at.level, 32) not in computed[:-1]  # of which one ends otherwise, but at the finest two levels
        status = np.where((np.arange(32) == 0) & first & (at.level < 2), other, stopping.status)
        behind = stopping.layer_residual_velocity + (0.9 if at.level == 0 else 0.0)
        return stopping.assign(layer_residual_velocity=behind, status=status)

    from_level(0, SHOTS=32)
    asked = Numerics(accuracy={"residual_velocity": 1.0, "tilt": 1.0, "depth": "1 mm", "status_share": 0.02})
    found = pilot_hits(outcomes_at, BOTH, asked, dear, (True, True))
    assert computed == [(0, 32), (2, 32), (0, 32), (2, 32), (1, 32), (3, 32)]
    assert (found.kept, found.numerics.level, found.status_error) == (True, 1, 1.0 / 64.0)


def test_as_many_hits_of_a_coarser_level_do_not_tell_the_share_that_ends_otherwise_at_a_finer_one(
    stopping: Outcomes, from_level: Callable[..., None]
) -> None:
    other = np.where(stopping.status == Status.ARRESTED, Status.PERFORATED, Status.ARRESTED)

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        behind = stopping.layer_residual_velocity + (9.0 if at.level == 0 else 0.0)
        status = np.where((np.arange(32) == 0) & (at.level == 1), other, stopping.status)
        return stopping.assign(layer_residual_velocity=behind, status=status)

    from_level(0, SHOTS=32, SKIPS_A_LEVEL=math.inf)
    found = pilot_hits(outcomes_at, PILOT, Numerics(), dear, (True, True))
    assert [each.errors.status_error for each in found.tried] == [0.0, 1.0 / 32.0, 0.0]
    assert (found.kept, found.numerics.level) == (True, 2)


@pytest.mark.parametrize(("error", "parts"), [(0.5, [16, 16]), (1.1, [16] * 4 + [32] * 2), (1.6, [16, 16])])
def test_a_pilot_doubles_its_hits_until_they_tell_enough(
    error: float, parts: list[int], known: Outcomes, from_level: Callable[..., None]
) -> None:
    counts = []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        counts.append(len(some))
        one = known[: len(some)]
        return one.assign(residual_velocity=one.residual_velocity + error / ERROR_PER_CHANGE[2] * (at.level == 0))

    from_level(0, SHOTS=16, FURTHER=0)
    found = pilot_hits(outcomes_at, BOTH, Numerics(accuracy={"residual_velocity": 1.0}), dear)
    assert counts == parts
    assert found.kept == (error < 1.0)


@pytest.mark.parametrize(
    ("excess", "computed", "kept"),
    [
        ([0.5, 0.5], 2, True),
        ([2.0, 0.9], 4, True),
        ([2.0, 1.1], 8, False),  # neither the first level does it nor the one that single hits begin with
        ([4.0, 0.9], 4, False),  # so far off that more hits do not help
    ],
)
def test_more_hits_tell_more_of_what_a_measure_shifts_by(
    excess: list[float], computed: int, kept: bool, known: Outcomes, from_level: Callable[..., None]
) -> None:
    counts = []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        counts.append(len(some))
        return known[: len(some)]

    def excess_of(coarse: Outcomes, fine: Outcomes, shots: Shots) -> float:
        return excess[len(shots) // 32]

    from_level(1, SHOTS=16, FURTHER=0)
    found = pilot_hits(outcomes_at, PILOT, Numerics(), dear, aim=Aim(excess_of))
    assert (counts, found.numerics.level, found.kept) == ([16] * computed, 0, kept)


@pytest.mark.parametrize(
    ("hits", "parts"),  # both levels cost the same, so twice as many as the run has are compared
    [(0, [16, 16]), (4, [16, 16, 8, 8]), (8, [16, 16, 16, 16]), (1000, [16, 16, 16, 16])],
)
def test_beside_an_accuracy_more_hits_are_compared_as_far_as_the_run_is_worth_it(
    hits: int, parts: list[int], known: Outcomes, from_level: Callable[..., None]
) -> None:
    counts = []

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        counts.append(len(some))
        return known[: len(some)].assign(residual_velocity=np.full(len(some), 9.0 * (at.level or 0)))

    from_level(0, SHOTS=16)
    found = pilot_hits(outcomes_at, PILOT, Numerics(), dear, aim=Aim(lambda *_: 0.1, alone=False), hits=hits)
    assert (counts, found.numerics.level, found.kept) == (parts, 0, True)  # by the measures, not by the accuracy
    assert found.residual_velocity_error > 1.0


def test_errors_of_the_first_hits_tell_how_they_fall_from_level_to_level(
    known: Outcomes, from_level: Callable[..., None]
) -> None:
    excess = {0: (2.9, 1.2), 1: (2.9, 1.2), 2: (2.0, 1.1), 3: (0.5, 0.5)}  # of 16 and of 32 hits

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        return known[: len(some)].assign(residual_velocity=np.full(len(some), float(at.level or 0)))

    def excess_of(coarse: Outcomes, fine: Outcomes, shots: Shots) -> float:
        return excess[int(coarse.residual_velocity[0])][len(shots) // 32]

    from_level(0, SHOTS=16)
    found = pilot_hits(outcomes_at, PILOT, Numerics(), dear, aim=Aim(excess_of))
    assert (found.kept, found.numerics.level) == (True, 3)


@pytest.mark.parametrize(("keeps", "level"), [(1, 1), (2, 0)])
def test_one_level_is_tried_behind_one_that_nearly_keeps_the_promise(
    keeps: int, level: int, known: Outcomes, from_level: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def compared(at: Numerics, *rest: Any) -> tuple[HitErrors, LevelVerdict]:
        kept = at.level >= keeps
        return HitErrors(at, kept, 0.9, 0.0, 0.0), LevelVerdict(kept, 0.5 if kept else 4.0, 0.5**at.level, 0.9)

    from_level(0)
    monkeypatch.setattr(pilot, "compared", compared)
    found = pilot_hits(lambda at, some: known[:4], PILOT[:4], Numerics(), dear)
    assert (found.kept, found.numerics.level) == (level == keeps, level)


@pytest.mark.parametrize("allowed", [0.7, 2.0])
def test_a_long_run_has_coarser_settings_that_keep_the_promise_on_other_hits(allowed: float) -> None:
    plate = paper_plate()
    scene = Scene(core=PAPER_CORE, target=plate, record=Record(standoffs=(0.13,)))
    shots, others = (make_shots(Impact(velocity=825.0), Hits(count=64, seed=seed), plate) for seed in (1, 2))
    asked = Numerics(accuracy=Accuracy(residual_velocity=allowed, tilt=allowed), precision="double")
    short, long = (pilot_of(scene, shots, asked, Worker("cpu"), hits=PART * len(shots) - less) for less in (1, 0))
    assert short.numerics.coarser is None
    assert (long.kept, long.numerics.level, long.numerics.precision) == (True, short.numerics.level, "double")
    assert long.numerics.coarser is not None
    taken = next(each.coarse for each in long.tried if each.errors.numerics == long.numerics)
    again = simulate(scene, shots, numerics=long.numerics, device="cpu")
    np.testing.assert_array_equal(taken.residual_velocity, again.residual_velocity)
    coarse, fine = (simulate(scene, others, numerics=at, device="cpu") for at in (long.numerics, Numerics(level=6)))
    velocity, tilt, _ = (np.quantile(errors, 0.9) for errors in changes(coarse, fine))
    assert velocity <= long.residual_velocity_error <= allowed
    assert tilt <= long.tilt_error <= math.radians(allowed)


@pytest.mark.parametrize("kept", [True, False])  # or kept nearly, with weighed errors
@pytest.mark.parametrize(
    ("level", "excess", "status", "coarser"),
    [
        (4, {"": ROOM}, {}, ""),
        (4, {"": 0.5, "step 3": ROOM + 0.01, "grid 3": ROOM}, {}, "grid 3"),
        (4, {"": 0.4, "step 2": 1.1, "step 3": 0.8, "grid 3, step 3": ROOM}, {}, "grid 3, step 3"),
        (4, {"": 0.4, "step 2": 0.8, "grid 3, step 2": ROOM}, {}, "grid 3, step 2"),
        (1, {"": 0.3, "step 0": ROOM}, {}, "step 0"),
        (8, {"": 0.3, "step 6": ROOM}, {}, "step 6"),
        # No more shots end otherwise than at the level itself.
        (4, {"": 0.5, "step 3": 0.5, "grid 3": ROOM}, {"step 3": 0.01}, "grid 3"),
        (4, {"": 0.5, "step 3": ROOM}, {"": 0.01, "step 3": 0.01}, "step 3"),
        (4, {"": 0.5, "step 3": ROOM}, {"": math.nan, "step 3": math.nan}, "step 3"),
    ],
)
def test_coarser_settings_are_tried_as_far_as_there_is_room(
    level: int,
    excess: dict[str, float],
    status: dict[str, float],
    coarser: str,
    kept: bool,
    known: Outcomes,
    from_level: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried, velocities = list[str](), dict[str, NDArray[np.float64]]()

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        tried.append(str(at.coarser or f"level {at.level}"))
        velocities[tried[-1]] = known.residual_velocity[:4] + len(tried)
        return known[:4].assign(residual_velocity=velocities[tried[-1]])

    def compared(
        at: Numerics, asked: Accuracy, given: Any, margin: float, *rest: Any
    ) -> tuple[HitErrors, LevelVerdict]:
        name, finer = str(at.coarser or ""), min(level + 2, 9)
        assert margin == ERROR_PER_CHANGE[finer - level]
        for outcomes, of in zip(given, (name or f"level {level}", f"level {level}", f"level {finer}"), strict=True):
            np.testing.assert_array_equal(outcomes.residual_velocity, velocities[of])
        over = excess.get(name, 2.0)
        errors = HitErrors(at, kept, 0.9, over, 0.0, status_error=status.get(name, 0.0))
        return errors, LevelVerdict(kept, over if kept else 9.0, 1.0, math.inf if kept else over)

    from_level(level, FURTHER=0)
    monkeypatch.setattr(pilot, "compared", compared)
    found = pilot_hits(outcomes_at, PILOT[:4], Numerics(), dear, hits=PART * 4)
    assert tried[2:] == list(excess)[1:]
    assert (found.kept, str(found.numerics.coarser or "")) == (kept, coarser)
    assert found.residual_velocity_error == excess[coarser]
    np.testing.assert_array_equal(found.tried[0].coarse.residual_velocity, velocities[coarser or f"level {level}"])


DRAFT = Numerics(fidelity="draft")
SHARE = PRESETS["draft"].limit


def limits_found(values: Mapping[int, ArrayLike], asked: Numerics = DRAFT) -> tuple[LimitErrors, list[int]]:
    """What a pilot of limits [m/s] finds that are the same for all hits of a level, or one for each; and its levels."""
    levels = []

    def limits_at(level: int) -> NDArray[np.float64]:
        levels.append(level)
        return np.full(LIMITS, values[level])

    return pilot_limits(limits_at, asked, "velocity"), levels


def few(times: float) -> NDArray[np.float64]:
    """Of a pilot's limits, one in eight many times as large as the others."""
    return np.where(np.arange(LIMITS) < 2, times, 1.0)


@pytest.mark.parametrize(
    ("limit_at", "kept", "level", "error"),
    [
        # Neighbours agree, and the limit lies 4 % away from the first ones.
        (lambda k: 104.0 if k < 2 else 100.0, True, 2, 0.0),
        (lambda k: 100.0 + 1.0 / 2**k, True, 0, ERROR_PER_CHANGE[2] * 0.75),
        # The finest level that is taken has one finer beside it.
        (lambda k: 100.0 + 90.0 * 0.6**k, False, FINEST_LIMIT, ERROR_PER_CHANGE[1] * 90.0 * 0.4 * 0.6**FINEST_LIMIT),
        # Half are within the promise from the first level on. One in eight errs four times as much: these are within it
        # two levels on; with eight times as much they are not.
        (
            lambda k: 100.0 + 90.0 * few(4.0) * SHARE / 2**k,
            True,
            2,
            ERROR_PER_CHANGE[2] * 90.0 * 4.0 * SHARE * 0.75 / 4.0,
        ),
        (lambda k: 100.0 + 90.0 * few(8.0) * SHARE / 2**k, False, 0, ERROR_PER_CHANGE[2] * 90.0 * 8.0 * SHARE * 0.75),
    ],
)
def test_the_level_of_limits(limit_at: Callable[[int], ArrayLike], kept: bool, level: int, error: float) -> None:
    found, _ = limits_found({k: limit_at(k) for k in range(FINEST_LIMIT + 2)})
    assert (found.kept, found.numerics) == (kept, Numerics(level=level))
    assert found.error == pytest.approx(error)


def test_limits_that_come_and_go_end_the_climb() -> None:
    # Most limits err by less than the promise; one in eight exists on every second pair of levels.
    values = {k: np.full(LIMITS, 100.0 + 1.0 / 2**k) for k in range(FINEST_LIMIT + 2)}
    for level, value in values.items():
        value[:2] = np.inf if level // 2 % 2 else 100.0
    found, levels = limits_found(values)
    assert (found.kept, found.error, found.numerics) == (False, np.inf, Numerics(level=0))
    assert FINEST_LIMIT not in levels


def test_an_accuracy_of_limits_in_numbers_is_that_of_the_name() -> None:
    values = {k: 100.0 * (1.0 + 3.0 * SHARE / 2**k) for k in range(FINEST_LIMIT + 2)}
    asked = Numerics(accuracy={"limit": SHARE})
    assert limits_found(values, asked) == limits_found(values)
    assert limits_pilot_size(asked.asked) == LIMITS
    assert limits_pilot_size(Numerics(accuracy={"limit": SHARE, "share": 0.99}).asked) == 160
    with pytest.raises(ValueError, match="needs limit"):
        limits_found(values, Numerics(accuracy={"tilt": "1 deg"}))


@pytest.mark.parametrize("bound", [5.0, 1.0, 0.2])
def test_errors_above_a_bound_never_read_as_if_they_kept_it(bound: float) -> None:
    for error in bound * np.array([1.00001, 1.004, 1.04, 1.4, 30.0]):
        assert float(upper_digits(error)) > bound
    for error in bound * np.array([1.0, 0.99999, 0.996, 0.5, 0.0]):
        assert error <= float(upper_digits(error)) <= bound
    assert errors_text(1.04, 0.3, 1.23e-4) == "1.1 m/s, 0.3 deg and 0.13 mm of depth"
    assert errors_text(math.inf, 123.0) == "inf m/s and 130 deg"
