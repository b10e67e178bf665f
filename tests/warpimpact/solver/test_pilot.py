"""The promise of a named fidelity: the level that a pilot chooses keeps it on hits that were not in the pilot."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from warpimpact import Campaign, run
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.runs.compute import HitMap
from warpimpact.runs.replay import replay
from warpimpact.scene import (
    PRESETS,
    Accuracy,
    CirclePattern,
    Hits,
    Impact,
    Layer,
    Numerics,
    OgiveCore,
    Plate,
    Record,
    Scene,
    Shots,
    Target,
    make_shots,
)
from warpimpact.solver import climb, pilot, purse
from warpimpact.solver.changes import RISK, SLOW, changes, design_effect, ended_otherwise, upper_error, upper_place
from warpimpact.solver.climb import MARGIN
from warpimpact.solver.pilot import HitErrors, pilot_hits, pilot_size
from warpimpact.solver.pilot_text import errors_text, upper_digits
from warpimpact.solver.purse import Purse
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

CORE = OgiveCore(diameter=6.17e-3, crh=3, length=27e-3, mass=5.25e-3)
PLATE = Plate(
    thickness=6e-3,
    resistance=2e9,
    shear_coefficient=0.08,
    degradation=0.85,
    pattern=CirclePattern(diameter=7e-3, spacing=(10e-3, 17.3e-3), staggered=True),
)
SCENE = Scene(core=CORE, target=PLATE, record=Record(standoffs=(0.05, 0.13)))
IMPACT = Impact(velocity="820 m/s", obliquity="12 deg", yaw="1 deg")
PILOT = make_shots(IMPACT, Hits(count=32, seed=5), PLATE)
OTHERS = make_shots(IMPACT, Hits(count=96, seed=6), PLATE)


@pytest.fixture(scope="module")
def limit() -> Outcomes:
    """Of the hits that are not in the pilot, finer by three levels at least than the names need here."""
    return simulate(SCENE, OTHERS, numerics=Numerics(level=7), device="cpu")


def found_for(numerics: Numerics, shots: Shots = PILOT, scene: Scene = SCENE) -> HitErrors:
    return pilot_of(scene, shots, numerics, Worker("cpu"))


def errors(numerics: Numerics, limit: Outcomes) -> tuple[float, float]:
    """90th percentiles of the errors in residual velocity [m/s] and in tilt at the last stand-off [rad]."""
    velocity, tilt, _ = changes(simulate(SCENE, OTHERS, numerics=numerics, device="cpu"), limit)
    return float(np.quantile(velocity, 0.9)), float(np.quantile(tilt, 0.9))


@pytest.mark.parametrize("name", ["draft", "standard"])
def test_a_shanked_core_gets_the_accuracy_that_the_name_promises(name: str, limit: Outcomes) -> None:
    many = make_shots(IMPACT, Hits(count=256, seed=5), PLATE)
    found, accuracy = found_for(Numerics(fidelity=name), many), PRESETS[name]
    assert found.kept
    assert found.numerics.level <= 4
    velocity, tilt = errors(found.numerics, limit)
    assert velocity <= accuracy.residual_velocity
    assert tilt <= accuracy.tilt
    # The errors that are told are upper estimates of the true ones; one in six may lie below (RISK).
    assert velocity / 1.3 <= found.residual_velocity_error <= accuracy.residual_velocity
    assert tilt / 1.3 <= found.tilt_error <= accuracy.tilt


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


NOTHING = Numerics(accuracy={"residual_velocity": 1e-9})


def test_what_cannot_be_kept_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    # With a ladder of two levels and a promise of nothing, the finest level that can be judged is taken.
    monkeypatch.setattr(pilot, "LADDER", pilot.LADDER[:2])
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    found = found_for(NOTHING, PILOT[:8])
    assert not found.kept
    assert found.numerics == Numerics(level=0)
    coarse, fine = (simulate(SCENE, PILOT[:8], numerics=Numerics(level=k), device="cpu") for k in (0, 1))
    largest = np.abs(coarse.residual_velocity - fine.residual_velocity).max()
    assert found.residual_velocity_error == pytest.approx(MARGIN[1] * largest)


def test_a_promise_ends_at_its_finest_level(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pilot, "FURTHER", 1)
    monkeypatch.setattr(purse, "PATIENCE", 0.0)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    found = found_for(NOTHING, PILOT[:4])
    assert not found.kept
    assert found.numerics == Numerics(level=1)


def test_levels_that_do_not_fit_the_memory_end_the_search() -> None:
    def full(level: int, some: Shots) -> Outcomes:
        raise MemoryError

    found = pilot_hits(full, PILOT[:4], Numerics())
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
    found = HitMap().found_in(result)
    assert found is not None
    assert result.attrs["promise_kept"] == 1
    assert 0.0 < result.attrs["residual_velocity_error"] <= 5.0
    assert 0.0 < result.attrs["tilt_error"] <= 5.0
    assert replay(result, 5, folder=Path()).attrs["agreement"] == "bit-identical"


def test_a_single_setting_promises_nothing() -> None:
    campaign = Campaign.from_text(CAMPAIGN + "patches_axial = 20\n", name="t", folder=Path())
    assert not {"promise_kept", "resolution", "tilt_error"} & run(campaign, device="cpu").attrs.keys()


# Stops some of the cores, and lets others go on slowly.
BASE = Layer(thickness=6.6e-3, resistance=5e9, gap=40e-3, shear_coefficient=0.08)
STOPPING = SCENE.model_copy(update={"target": Target(layers=(PLATE, BASE))})


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


@pytest.mark.parametrize(
    ("excess", "tried", "taken"),
    [
        ([1.9, 0.9], [0, 1], 1),
        ([9.0, 5.0, 2.5, 1.2, 0.6], [0, 2, 3, 4], 4),  # the level behind one that is far off is not tried
        ([9.0, 8.9, 8.8, 0.5], [0, 2], 0),  # no finer level where errors do not fall
        ([3.0, 2.8, 1.7, 1.4, 1.5], [0, 1, 2, 3, 4], 2),  # the coarsest of those that err alike
    ],
)
def test_levels_that_a_pilot_tries(excess: list[float], tried: list[int], taken: int) -> None:
    seen = []

    def judge(index: int, finer: int, margin: float) -> climb.Verdict[HitErrors]:
        seen.append(index)
        found = HitErrors(Numerics(level=index), excess[index] <= 1.0, 0.9, 0.0, 0.0)
        return climb.Verdict(found, excess[index], excess[index], False)

    found = climb.coarsest(judge, range(5), 9, 1)
    assert found is not None
    assert (seen, found.numerics.level) == (tried, taken)


@pytest.mark.parametrize(("typical", "tried"), [([3.0, 2.5, 2.0, 0.5], 4), ([3.0, 2.5, 2.2, 0.5], 3)])
def test_how_errors_fall_is_told_by_shots_that_all_levels_have(typical: list[float], tried: int) -> None:
    seen = []

    def judge(index: int, finer: int, margin: float) -> climb.Verdict[HitErrors]:
        seen.append(index)  # the upper estimates are of other numbers of shots
        excess = [2.0, 2.5, 3.0, 0.9][index]
        return climb.Verdict(
            HitErrors(Numerics(level=index), excess <= 1.0, 0.9, 0.0, 0.0), excess, typical[index], False
        )

    found = climb.coarsest(judge, range(4), 9, 1)
    assert found is not None
    assert (len(seen), found.kept) == (tried, tried == 4)


@pytest.mark.parametrize(("otherwise", "levels"), [(0, [0, 1, 2]), (4, [0, 1, 2, 3])])
def test_errors_do_not_stall_where_it_is_the_status_that_gets_better(
    otherwise: int, levels: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, seen = simulate(STOPPING, PILOT, numerics=Numerics(level=0), device="cpu"), []
    ends = np.where(np.arange(32) < otherwise, Status.RICOCHETED, one.status)

    def outcomes_at(level: int, some: Shots) -> Outcomes:  # which err by as much at every level
        seen.append(level)
        speed = one.layer_residual_velocity + 100.0 * (level % 4 < 2)
        return one.assign(layer_residual_velocity=speed, status=ends if level == 0 else one.status)

    monkeypatch.setattr(pilot, "SHOTS", 32)
    monkeypatch.setattr(climb, "FAR", math.inf)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    pilot_hits(outcomes_at, PILOT, Numerics(), (True, True))
    assert [level for level in sorted(set(seen)) if level + 2 in seen] == levels


@pytest.mark.parametrize(
    ("price", "tried"),
    [
        (lambda level: 1e-6, [0, 1, 2, 3, 4]),  # takes no time: beyond the usual levels, as long as one is to be found
        (lambda level: 1.0, [0, 1, 2]),  # the last of the usual levels
        # To look at the third level takes 16 hits at the fifth: as long as WORTH at the third, or longer.
        (lambda level: {2: 3.0, 4: 290.0}.get(level, 1.0), [0, 1, 2]),
        (lambda level: {2: 3.0, 4: 300.0}.get(level, 1.0), [0, 1]),
    ],
)
def test_a_pilot_looks_at_levels_that_are_worth_their_time(
    price: Callable[[int], float], tried: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = simulate(SCENE, PILOT[:16], numerics=Numerics(level=0), device="cpu")
    seen = []

    def outcomes_at(level: int, some: Shots) -> Outcomes:
        seen.append(level)  # errors fall to half from level to level, and the fifth keeps the promise
        return known.assign(residual_velocity=known.residual_velocity + 40.0 * 0.5**level)

    monkeypatch.setattr(pilot, "SHOTS", 16)
    monkeypatch.setattr(pilot, "FURTHER", 2)
    monkeypatch.setattr(climb, "FAR", math.inf)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    asked = Numerics(accuracy={"residual_velocity": 3.0})
    found = pilot_hits(outcomes_at, PILOT[:16], asked, purse=Purse(price))
    assert sorted(level for level in set(seen) if level + 2 in seen) == tried
    assert found.kept == (tried[-1] == 4)


@pytest.mark.parametrize(("whole", "to"), [(False, 4), (True, 2)])
def test_errors_of_a_promise_that_is_not_kept_are_those_to_the_finest_level(
    whole: bool, to: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # That of as many shots as are known of the level itself: what a measure shifts by needs them.
    known = simulate(SCENE, PILOT, numerics=Numerics(level=0), device="cpu")

    def outcomes_at(level: int, some: Shots) -> Outcomes:  # which creep to no end
        one = known[: len(some)]
        return one.assign(residual_velocity=one.residual_velocity + 10.0 * level)

    monkeypatch.setattr(pilot, "SHOTS", 16)
    monkeypatch.setattr(pilot, "FURTHER", 3)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    monkeypatch.setattr(pilot, "OPEN", (0.0, math.inf) if whole else (2.0, 2.0))
    price = {2: 30.0, 4: 2e3}  # so that 16 more hits at the fifth level are not worth their time
    limited = Purse(lambda level: price.get(level, 1.0)) if whole else None
    found = pilot_hits(
        outcomes_at, PILOT[: 32 if whole else 16], Numerics(accuracy={"residual_velocity": 1.0}), purse=limited
    )
    assert (found.kept, found.numerics.level) == (False, 0)
    assert found.residual_velocity_error == pytest.approx(MARGIN[2] * 10.0 * to)
    assert found.tried[0][0] == found
    assert [len(one) for one in found.tried[0][1:]] == [32 if whole else 16] * 2


@pytest.mark.parametrize(("otherwise", "parts"), [(0, [32, 32]), (1, [32, 32, 32, 32]), (3, [32, 32])])
def test_more_hits_tell_the_share_that_ends_otherwise(
    otherwise: int, parts: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = simulate(STOPPING, PILOT, numerics=Numerics(level=0), device="cpu")
    ends, counts = one.status.copy(), []
    ends[:otherwise] = np.where(ends[:otherwise] == Status.ARRESTED, Status.PERFORATED, Status.ARRESTED)

    def outcomes_at(level: int, some: Shots) -> Outcomes:
        counts.append(len(some))
        return one.assign(status=ends if level == 2 and len(counts) < 3 else one.status)

    monkeypatch.setattr(pilot, "SHOTS", 32)
    monkeypatch.setattr(pilot, "FURTHER_LAYERED", 0)
    found = pilot_hits(outcomes_at, Shots.joined([PILOT, PILOT]), Numerics(), (True, True))
    assert counts == parts
    assert found.kept == (otherwise == 0)


def test_more_hits_of_a_coarser_level_tell_the_share_that_ends_otherwise_at_a_finer_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, computed = simulate(STOPPING, PILOT, numerics=Numerics(level=0), device="cpu"), []
    other = np.where(one.status == Status.ARRESTED, Status.PERFORATED, Status.ARRESTED)

    def outcomes_at(level: int, some: Shots) -> Outcomes:
        computed.append((level, len(some)))
        first = (level, 32) not in computed[:-1]  # of which one ends otherwise, but at the finest two levels
        status = np.where((np.arange(32) == 0) & first & (level < 2), other, one.status)
        behind = one.layer_residual_velocity + (0.9 if level == 0 else 0.0)
        return one.assign(layer_residual_velocity=behind, status=status)

    monkeypatch.setattr(pilot, "SHOTS", 32)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    asked = Numerics(accuracy={"residual_velocity": 1.0, "tilt": 1.0, "depth": "1 mm", "status_share": 0.02})
    found = pilot_hits(outcomes_at, Shots.joined([PILOT, PILOT]), asked, (True, True))
    assert computed == [(0, 32), (2, 32), (0, 32), (2, 32), (1, 32), (3, 32)]
    assert (found.kept, found.numerics.level, found.status_error) == (True, 1, 1.0 / 64.0)


@pytest.mark.parametrize("error", [math.inf, math.nan, 1e300])
@pytest.mark.parametrize(
    ("asked", "place"), [({"tilt": 0.02}, 0), ({"residual_velocity": 1.0}, 1), ({"residual_velocity": 1.0}, 2)]
)
def test_what_an_accuracy_does_not_ask_for_counts_nothing(asked: dict[str, float], place: int, error: float) -> None:
    errors = np.array([0.5, math.radians(0.01), 0.0])
    errors[place] = error
    assert pilot._excess(Accuracy(**asked), errors, layered=True) == 0.5


@pytest.mark.parametrize(("share_of_allowed", "parts"), [(0.5, [16, 16]), (1.1, [16, 16, 16, 16])])
def test_more_hits_are_computed_where_the_first_leave_the_level_open(
    share_of_allowed: float, parts: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = []

    def outcomes_at(level: int, some: Shots) -> Outcomes:
        counts.append(len(some))
        return simulate(SCENE, some, numerics=Numerics(level=level), device="cpu")

    monkeypatch.setattr(pilot, "SHOTS", 16)
    monkeypatch.setattr(pilot, "FURTHER", 0)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 0)
    told = pilot_hits(outcomes_at, PILOT[:16], Numerics(fidelity="draft")).tilt_error
    counts.clear()
    asked = Numerics(accuracy={"residual_velocity": 1e3, "tilt": math.degrees(told / share_of_allowed)})
    pilot_hits(outcomes_at, PILOT, asked)
    assert counts == parts


def test_a_pilot_doubles_its_hits_until_they_tell_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    one, counts = simulate(SCENE, PILOT, numerics=Numerics(level=0), device="cpu"), []
    excess = {16: 1.2, 32: 0.6, 64: 0.6}

    def outcomes_at(at: int, some: Shots) -> Outcomes:
        counts.append(len(some))
        return one[: len(some)]

    monkeypatch.setattr(pilot, "SHOTS", 16)
    monkeypatch.setattr(pilot, "FURTHER", 0)
    shots = Shots.joined([PILOT, PILOT])
    found = pilot_hits(outcomes_at, shots, Numerics(), excess_of=lambda coarse, fine, some: excess[len(some)])
    assert counts == [16, 16, 16, 16]
    assert found.kept


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
    excess: list[float], computed: int, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, counts = simulate(SCENE, PILOT[:32], numerics=Numerics(level=0), device="cpu"), []

    def outcomes_at(at: int, some: Shots) -> Outcomes:
        counts.append(len(some))
        return one[: len(some)]

    monkeypatch.setattr(pilot, "SHOTS", 16)
    monkeypatch.setattr(pilot, "FURTHER", 0)
    monkeypatch.setattr(pilot, "coarsest_level", lambda strictness: 1)
    found = pilot_hits(
        outcomes_at, PILOT[:32], Numerics(), excess_of=lambda coarse, fine, shots: excess[len(shots) // 32]
    )
    assert (counts, found.numerics.level, found.kept) == ([16] * computed, 0, kept)


def test_errors_of_slow_cores_are_those_of_their_energy(limit: Outcomes) -> None:
    one, impact = limit[np.arange(3)], np.full(3, 800.0)
    speeds, back = np.array([600.0, 20.0, 20.0]), [Status.PERFORATED, Status.PERFORATED, Status.ARRESTED]
    passed = one.assign(residual_velocity=speeds, status=np.zeros(3, dtype=np.int8))
    stopped = np.where(np.array(back) == Status.ARRESTED, np.nan, one.tilt[:, -1])
    slower = passed.assign(
        residual_velocity=np.array([599.0, 18.0, 0.0]),
        tilt=np.stack([stopped + 0.01] * 2, axis=1),
        status=np.array(back, dtype=np.int8),
    )
    velocity, tilt, depth = changes(passed.assign(tilt=np.stack([one.tilt[:, -1]] * 2, axis=1)), slower, impact)
    energy = (speeds**2 - slower.residual_velocity**2)[1:] / (2.0 * SLOW * 800.0)
    assert velocity == pytest.approx([1.0, *energy])
    assert tilt == pytest.approx([0.01, 0.01 * 19.0 / 200.0, math.pi * 10.0 / 200.0])
    assert np.isnan(depth).all()


def test_fast_cores_count_as_they_are(limit: Outcomes) -> None:
    coarse = simulate(SCENE, OTHERS, numerics=Numerics(level=1), device="cpu")
    velocity, tilt, _ = changes(coarse, limit, OTHERS.velocity)
    plain = changes(coarse, limit)
    assert limit.residual_velocity.min() > SLOW * 820.0
    np.testing.assert_array_equal(velocity, plain[0])
    np.testing.assert_array_equal(tilt, plain[1])


def test_shots_at_one_plate_count_as_one_where_they_err_alike() -> None:
    errors = np.arange(60.0)
    assert upper_error(errors, 0.9) == upper_error(errors, 0.9, np.arange(60)) == upper_place(60, 0.9) - 1 < 58
    assert upper_error(errors, 0.9, risk=0.5) == 54  # of as many as lie beyond 90 %
    assert upper_error(errors, 0.9, np.arange(60) // 3) == 59  # of 20 plates the last one
    assert upper_error(errors, 0.9, np.zeros(60, dtype=int)) == 59  # one plate tells of no other
    assert upper_error(errors, 0.9, np.arange(60) % 20) < 59  # the largest errors are those of other plates


@pytest.mark.parametrize("alike", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize(("plates", "at_a_plate"), [(22, 3), (85, 3), (32, 2), (16, 8)])
def test_an_estimate_is_rarely_below_the_percentile_however_alike_shots_at_a_plate_err(
    plates: int, at_a_plate: int, alike: float
) -> None:
    rng, numbers = np.random.default_rng(8), np.repeat(np.arange(plates), at_a_plate)
    below = 0
    for _ in range(1000):
        own, shared = rng.normal(size=plates * at_a_plate), rng.normal(size=plates)[numbers]
        below += upper_error(math.sqrt(alike) * shared + math.sqrt(1.0 - alike) * own, 0.9, numbers) < 1.2816
    enough = 0.9**plates < RISK  # for the largest of errors that are wholly alike
    assert below < 1000 * (RISK + 0.04 if enough or alike < 1.0 else 0.9**plates + 0.04)


def test_design_effect_of_groups_of_several_sizes() -> None:
    # An analysis of variance, of groups of one size: between them over within, F, gives (m - 1) correlation + 1.
    rng = np.random.default_rng(2)
    values = rng.normal(size=(400, 5)) + rng.normal(size=(400, 1))
    within = values.var(axis=1, ddof=1).mean()
    between = 5.0 * values.mean(axis=1).var(ddof=1)
    correlation = (between - within) / (between + 4.0 * within)
    groups = np.repeat(np.arange(400), 5)
    doubt = math.sqrt(2.0 * 4.0 / (5.0 * 399.0))
    assert design_effect(values.ravel(), groups) == pytest.approx(1.0 + 4.0 * correlation + doubt, rel=3e-3)
    some = rng.random(2000) < 0.7  # as where some shots have no depth
    assert design_effect(values.ravel()[some], groups[some]) == pytest.approx(1.0 + 2.5 * correlation, rel=0.15)


def test_a_failed_computation_has_no_bound(limit: Outcomes) -> None:
    one = limit[np.arange(2)]
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


@pytest.mark.parametrize("bound", [5.0, 1.0, 0.2])
def test_errors_above_a_bound_never_read_as_if_they_kept_it(bound: float) -> None:
    for error in bound * np.array([1.00001, 1.004, 1.04, 1.4, 30.0]):
        assert float(upper_digits(error)) > bound
    for error in bound * np.array([1.0, 0.99999, 0.996, 0.5, 0.0]):
        assert error <= float(upper_digits(error)) <= bound
    assert errors_text(1.04, 0.3, 1.23e-4) == "1.1 m/s, 0.3 deg and 0.13 mm of depth"
    assert errors_text(math.inf, 123.0) == "inf m/s and 130 deg"
