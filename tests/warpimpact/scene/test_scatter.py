"""Scatter: the distribution asked for, and shot k a function of seed and k alone."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from warpimpact import Impact, Plate
from warpimpact.scene import Hits, NoPattern, Sampler, Scatter, Shots, SlotPattern

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
