"""Shots: where they hit, the distributions of what scatters, symmetries; shot k is a function of seed and k alone."""

import math
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import stats

from warpimpact.scene import (
    CirclePattern,
    Hits,
    Impact,
    NoPattern,
    Pattern,
    Plate,
    Sampler,
    Scatter,
    Shots,
    SlotPattern,
    Symmetry,
    TrianglePattern,
    make_shots,
    symmetries_used,
)
from warpimpact.scene.quantities import LISTED, QUANTITIES
from warpimpact.scene.sampling import SYMMETRIES, irreducible_part, sobol, symmetries
from warpimpact.scene.units import quantity

PERIOD = (16e-3, 8e-3)
CELL = Plate(thickness="4 mm", resistance=1e9, pattern=CirclePattern(diameter="5 mm", spacing=PERIOD))
SOLID = Plate(thickness="4 mm", resistance=1e9)


def _points(**hits: object) -> np.ndarray:
    shots = make_shots(Impact(velocity=825), Hits(**hits), CELL)
    return np.column_stack([shots.hit_y, shots.hit_z])


@pytest.mark.parametrize("sampling", ["sobol", "random", "grid"])
def test_hits_fill_the_cell_around_the_origin(sampling: str) -> None:
    points = _points(sampling=sampling, count=8192, seed=1) / PERIOD
    assert ((points >= -0.5) & (points < 0.5)).all()
    in_quarters = np.histogram2d(*points.T, bins=2, range=[[-0.5, 0.5]] * 2)[0]
    # Independent draws: 2048 ± 39; the others are even by construction.
    assert in_quarters == pytest.approx(2048, abs=160 if sampling == "random" else 0)


@pytest.mark.parametrize(("count", "shape"), [(2, (2, 1)), (128, (16, 8)), (130, (16, 8)), (1, (1, 1))])
def test_a_grid_has_nearly_square_cells(count: int, shape: tuple[int, int]) -> None:
    points = _points(sampling="grid", count=count)
    y, z = np.unique(points[:, 0]), np.unique(points[:, 1])
    assert (len(y), len(z)) == shape
    assert len(points) == len(y) * len(z)
    assert y == pytest.approx(-y[::-1], abs=1e-18)
    assert y[0] == pytest.approx(PERIOD[0] * (0.5 / shape[0] - 0.5), rel=1e-14)


def test_a_list_may_have_every_quantity_of_a_shot(tmp_path: Path) -> None:
    names = [name for name in LISTED if name not in ("hit_y", "hit_z")]
    (tmp_path / "hits.csv").write_text(f"hit_y,hit_z,{','.join(names)}\n-0.1,3.5e-3{',0.5' * len(names)}\n")
    shots = make_shots(Impact(velocity=825), Hits(sampling="list", file=tmp_path / "hits.csv"), CELL)
    assert (shots.hit_y.item(), shots.hit_z.item()) == (-0.1, 3.5e-3)
    for name in names:
        in_degrees = quantity(QUANTITIES[name].type).unit == "rad"
        assert shots.columns[name].item() == (math.radians(0.5) if in_degrees else 0.5), name


@pytest.mark.parametrize(
    ("hits", "complaint"),
    [
        ({}, 'sampling = "sobol" needs count'),
        ({"sampling": "list"}, 'sampling = "list" needs file'),
        ({"sampling": "list", "file": __file__, "count": 3}, "count and sampling"),
        ({"sampling": "grid", "count": 3, "replicates": 8}, "replicates and sampling"),
        ({"count": 3, "file": __file__}, "the header must be any of hit_y, hit_z, velocity"),
        ({"sampling": "sobel", "count": 3}, "'sobol', 'grid', 'random' or 'list'"),
    ],
)
def test_incomplete_or_contradictory_hits_are_refused(hits: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        Hits(**hits)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("obliquity", 90, "at least 0 and less than 90 deg"),
        ("obliquity", -0.1, "at least 0 and less than 90 deg"),
        ("yaw", "-1.6 rad", "greater than -90 and less than 90 deg"),
    ],
)
def test_an_impossible_impact_is_refused_with_angles_in_degrees(field: str, value: object, allowed: str) -> None:
    with pytest.raises(ValidationError, match=f"{field}\n  Input should be {allowed}"):
        Impact(**{"velocity": 825, field: value})


PLATE = Plate(thickness="4 mm", resistance="2 GPa", pattern=NoPattern())
SLOTTED = Plate(
    thickness="4 mm",
    resistance="2 GPa",
    pattern=SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True),
)
IMPACT = Impact(velocity=820.0)
SCATTER = Scatter(
    velocity={"distribution": "normal", "mean": "820 m/s", "std": "10 m/s"},
    obliquity={"distribution": "uniform", "low": "0 deg", "high": "10 deg"},
    resistance={"distribution": "lognormal", "median": "2 GPa", "sigma": 0.05},
)


def sampler(sampling: str, count: int, *, scatter: Scatter = SCATTER, **hits: int) -> Sampler:
    one = {"replicates": 1} if sampling == "sobol" else {}
    return Sampler(IMPACT, Hits(sampling=sampling, count=count, **one | hits), PLATE, scatter)


def same(one: Shots, other: Shots) -> bool:
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(one.columns[name], other.columns[name], equal_nan=True) for name in one.columns
    )


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"distribution": "normal", "mean": "820 m/s", "std": "10 m/s"}, stats.norm(820, 10)),
        (
            {"distribution": "truncated_normal", "mean": 820, "std": 10, "low": "0.81 km/s", "high": 840},
            stats.truncnorm(-1, 2, 820, 10),
        ),
        ({"distribution": "uniform", "low": 800, "high": 840}, stats.uniform(800, 40)),
        ({"distribution": "triangular", "low": 800, "mode": 830, "high": 840}, stats.triang(0.75, 800, 40)),
        ({"distribution": "lognormal", "median": 820, "sigma": 0.1}, stats.lognorm(0.1, scale=820)),
    ],
    ids=lambda value: value["distribution"] if isinstance(value, dict) else "",
)
@pytest.mark.parametrize("sampling", ["sobol", "random", "grid"])
def test_draws_follow_the_distribution(parameters: dict[str, object], expected: object, sampling: str) -> None:
    scatter = Scatter(velocity=parameters)
    shares = np.linspace(2.0**-31, 1.0 - 2.0**-31, 1001)
    np.testing.assert_array_equal(scatter.velocity.quantile(shares), expected.ppf(shares))
    shots = sampler(sampling, 4096, scatter=scatter).shots(0, 4096)
    assert stats.kstest(shots.velocity, expected.cdf).pvalue > 1e-3
    assert abs(stats.spearmanr(shots.velocity, shots.hit_y).statistic) < 0.06  # 4096 independent pairs: ± 0.016


SAMPLERS: dict[str, Callable[..., Sampler]] = {
    "sobol": lambda count, **hits: sampler("sobol", count, **hits),
    "replicates": lambda count, **hits: sampler("sobol", count, replicates=8, **hits),
    "random": lambda count, **hits: sampler("random", count, **hits),
    "irreducible": lambda count, **hits: Sampler(
        IMPACT, Hits(count=count, irreducible=True, replicates=8, **hits), SLOTTED, Scatter(velocity=SCATTER.velocity)
    ),
    "irreducible, random": lambda count, **hits: Sampler(
        IMPACT, Hits(sampling="random", count=count, irreducible=True, **hits), SLOTTED
    ),
}


@pytest.mark.parametrize("make", SAMPLERS.values(), ids=SAMPLERS)
def test_a_shot_depends_on_the_seed_and_its_number_alone(make: Callable[..., Sampler]) -> None:
    count = len(make(1024, seed=3))
    assert count == 1024
    whole, kept = make(1024, seed=3).shots(0, count), make(1024, seed=3)
    for first, some in ((600, 100), (0, 4), (5, 1), (1019, 50), (7, 300), (1023, 1), (512, 256)):  # any order and batch
        part = whole[first : first + some]
        assert same(kept.shots(first, some), part)
        assert same(make(1024, seed=3).shots(first, some), part)
    assert same(make(512, seed=3).shots(0, 512), whole[:512])  # a larger count keeps the earlier shots
    assert not same(make(1024, seed=4).shots(0, count), whole)


def test_a_discrete_distribution_gives_its_values_as_often_as_its_weights_say() -> None:
    scatter = Scatter(velocity={"distribution": "discrete", "values": ["830 m/s", 810], "weights": [1, 3]})
    values, counts = np.unique(sampler("sobol", 4096, scatter=scatter).shots(0, 4096).velocity, return_counts=True)
    assert values.tolist() == [810.0, 830.0]
    assert counts.tolist() == [3072, 1024]  # a net is exact


def test_what_else_scatters_changes_no_draw() -> None:
    for sampling in ("sobol", "random"):
        alone = sampler(sampling, 64, scatter=Scatter(velocity=SCATTER.velocity)).shots(0, 64)
        assert np.array_equal(alone.velocity, sampler(sampling, 64).shots(0, 64).velocity)
    one = {"distribution": "uniform", "low": 1e9, "high": 2e9}
    strength, both = (
        Scatter(strength=one),
        Scatter(strength=one, thickness=[None, {**one, "low": 0.001, "high": 0.002}]),
    )
    shots = sampler("sobol", 1024, scatter=both).shots(0, 1024)
    assert np.array_equal(shots.strength, sampler("sobol", 1024, scatter=strength).shots(0, 1024).strength)
    ranks = np.floor(1024 * (shots.columns["strength"] - 1e9) / 1e9)
    assert np.array_equal(np.sort(ranks), np.arange(1024))  # one point in each of 1024 intervals


def test_replicates_are_independent_nets() -> None:
    shots = sampler("sobol", 8 * 256, replicates=8).shots(0, 8 * 256)
    for replicate in range(8):
        y, z = (values[replicate::8] for values in (shots.hit_y, shots.hit_z))
        counts = np.histogram2d(y / PLATE.sampled_cell[0], z / PLATE.sampled_cell[1], bins=16, range=[[-0.5, 0.5]] * 2)
        assert (counts[0] == 1).all()
    assert len(np.unique(shots.hit_y)) == 8 * 256


def test_columns_of_a_list_override(tmp_path: Path) -> None:
    (tmp_path / "hits.csv").write_text("hit_y,hit_z,velocity,yaw\n0,0,700,0.1\n0.001,0,710,0.2\n")
    hits = Hits(sampling="list", file=tmp_path / "hits.csv", seed=2)
    shots = Sampler(Impact(velocity=820, yaw=0.3), hits, PLATE, SCATTER).shots(0, 4)
    assert shots.velocity.tolist() == [700.0, 710.0]
    assert shots.yaw.tolist() == pytest.approx(np.radians([0.1, 0.2]), rel=1e-15)  # a list has degrees
    assert len(np.unique(shots.obliquity)) == 2


@pytest.mark.parametrize("header", ["resistance,degradation_length [mm]", "hit,resistance,degradation_length"])
def test_a_list_has_no_degradation_length(header: str, tmp_path: Path) -> None:
    (tmp_path / "hits.csv").write_text(f"{header}\n" + ",".join(["1"] * len(header.split(","))))
    with pytest.raises(
        ValidationError, match=r"line 1: degradation_length: cannot differ from hit to hit; give one in"
    ):
        Hits(count=4, file=tmp_path / "hits.csv")


MM = 1e-3
HITS = Hits(count=1024, irreducible=True)
STRAIGHT = Impact(velocity=825)
SLOTS = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
ROWS = SLOTS.model_copy(update={"staggered": False})
HOLES = CirclePattern(diameter="9 mm", spacing=["12.5 mm", "21.65 mm"], staggered=True)
TRIANGLES = TrianglePattern(side="6 mm", spacing=["7 mm", "5.5 mm"], staggered=True)
SPECKS = TrianglePattern(side="5 um", spacing=["7 mm", "5.5 mm"])  # holes that a grid over the cell would miss


def plate(pattern: Pattern, **changes: Any) -> Plate:
    return Plate(**{"thickness": 4 * MM, "resistance": 2.6e9, "pattern": pattern} | changes)


def got(plate: Plate, impact: Impact = STRAIGHT) -> set[str]:
    return {str(symmetry) for symmetry in symmetries(plate, impact)}


def centred(*names: str) -> set[str]:
    return {*names, *(f"{name} + centring" for name in names)}


ALL = ("(y, z)", "(-y, z)", "(y, -z)", "(-y, -z)")


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (plate(SLOTS), centred(*ALL)),
        (plate(HOLES), centred(*ALL)),
        (plate(NoPattern()), centred(*ALL)),
        (plate(ROWS), {*ALL}),
        (plate(TRIANGLES), centred("(y, z)", "(-y, z)")),
        (plate(SPECKS), {"(y, z)", "(-y, z)"}),
        (plate(SLOTS, size=[40 * MM, 40 * MM]), {*ALL}),
        (plate(TRIANGLES, size=[40 * MM, 4 * MM]), {"(y, z)", "(-y, z)"}),
    ],
    ids=["slots", "holes", "solid", "rows", "triangles", "specks", "slots with a rim", "triangles with a rim"],
)
def test_of_a_plate(scene: Plate, expected: set[str]) -> None:
    assert got(scene) == expected


@pytest.mark.parametrize(
    ("impact", "expected"),
    [
        ({"obliquity": "20 deg", "azimuth": "0 deg"}, centred("(y, z)", "(y, -z)")),
        ({"obliquity": "20 deg", "azimuth": "90 deg"}, centred("(y, z)", "(-y, z)")),
        ({"obliquity": "20 deg", "azimuth": "35 deg"}, centred("(y, z)")),
        ({"azimuth": "35 deg"}, centred(*ALL)),
        ({"pitch": "1 deg"}, centred("(y, z)", "(-y, z)")),
        ({"yaw": "1 deg"}, centred("(y, z)", "(y, -z)")),
        ({"spin": 1e4}, centred("(y, z)", "(-y, -z)")),
        ({"spin": 1e4, "pitch": "1 deg"}, centred("(y, z)")),
        ({"obliquity": "20 deg", "azimuth": "90 deg", "pitch": "-1 deg"}, centred("(y, z)", "(-y, z)")),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_of_a_shot(impact: dict[str, Any], expected: set[str]) -> None:
    assert got(plate(SLOTS), Impact(velocity=825, **impact)) == expected


def groups() -> list[tuple[Symmetry, ...]]:
    """Every group that symmetries can form."""

    def after(one: Symmetry, other: Symmetry) -> Symmetry:
        return Symmetry(one.along_y * other.along_y, one.along_z * other.along_z, one.centred != other.centred)

    subsets = (s for n in (1, 2, 4, 8) for s in combinations(SYMMETRIES, n))
    return [s for s in subsets if all(after(a, b) in s for a in s for b in s)]


@pytest.mark.parametrize("group", groups(), ids=lambda group: ", ".join(map(str, group)))
def test_images_of_the_irreducible_part_cover_the_cell_once(group: tuple[Symmetry, ...]) -> None:
    cell = (16 * MM, 9 * MM)
    y, z = np.random.default_rng(3).uniform(-0.5, 0.5, (2, 500)) * np.array(cell)[:, None]
    (low_y, high_y), (low_z, high_z) = irreducible_part(group)
    times = np.zeros(500, dtype=int)
    for symmetry in group:
        at_y, at_z = symmetry.image(y, z, cell)
        assert (np.abs(at_y) <= 0.5 * cell[0]).all()
        assert (np.abs(at_z) <= 0.5 * cell[1]).all()
        across, along = at_y / cell[0], at_z / cell[1]
        times += (low_y < across) & (across < high_y) & (low_z < along) & (along < high_z)
    assert (times == 1).all()


@pytest.mark.parametrize("pattern", [SLOTS, TRIANGLES], ids=["slots", "triangles"])
def test_images_of_a_hit_see_the_plate_alike(pattern: Pattern) -> None:
    scene = plate(pattern)
    shots = make_shots(STRAIGHT, HITS, scene)
    assert len(shots) == 1024
    places = [one.image(shots.hit_y, shots.hit_z, scene.sampled_cell) for one in symmetries_used(STRAIGHT, HITS, scene)]
    solid = np.array([scene.is_solid(*place) for place in places])
    assert 0.0 < solid.mean() < 1.0
    assert (solid == solid[:1]).all()


@pytest.mark.parametrize("name", ["obliquity", "azimuth", "pitch", "yaw", "spin"])
def test_scatter_that_symmetry_would_turn_is_refused(name: str) -> None:
    scatter = Scatter(**{name: {"distribution": "uniform", "low": 0.0, "high": 0.1}})
    with pytest.raises(
        ValueError, match=f"hits.irreducible = true cannot be combined with a distribution of impact.{name}: a"
    ):
        make_shots(STRAIGHT, HITS, plate(SLOTS), scatter)
    assert len(make_shots(STRAIGHT, Hits(count=64), plate(SLOTS), scatter)) == 64


def test_an_interrupt_that_scipy_ignores_ends_the_sampling(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its tables were not read, and all hits would lie at one point."""
    monkeypatch.setattr(stats.qmc.Sobol, "random", lambda _, count: np.zeros((count, 1)))
    with pytest.raises(KeyboardInterrupt):
        sobol(2)
