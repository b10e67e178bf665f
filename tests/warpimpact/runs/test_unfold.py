"""Hits of the irreducible part unfolded over the cell are those that a run of every hit gives."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, Hits, Impact, Numerics, Plate, PolygonsPattern, PolynomialCore, SlotPattern, run
from warpimpact.analysis.inspect import inspect_text
from warpimpact.analysis.summary import estimated
from warpimpact.campaign.campaign import Output
from warpimpact.campaign.stop import Stop
from warpimpact.cli import main
from warpimpact.continuum.hit_history import CORNERS
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import files
from warpimpact.results.measures import Measure
from warpimpact.results.tallies import Tally
from warpimpact.results.variables import OUTCOME_VARIABLES, SHOT_VARIABLES
from warpimpact.runs import compute as computing
from warpimpact.runs import shards
from warpimpact.runs.parts import Interrupted
from warpimpact.runs.progress import RunProgress
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run_to_file
from warpimpact.scene import Scatter, Symmetry, TrianglePattern, make_shots, symmetries_used
from warpimpact.solver import replay as replaying
from warpimpact.solver import simulate as simulation
from warpimpact.solver.history import History
from warpimpact.solver.memory import Memory
from warpimpact.solver.replay import Deformed
from warpimpact.solver.unfold import image_of

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
TRIANGLES = TrianglePattern(side=8e-3, spacing=(10e-3, 9e-3), staggered=True)
STRAIGHT, SPINNING = Impact(velocity=825.0), Impact(velocity=825.0, spin=1.7e4)
PITCHED = Impact(velocity=825.0, obliquity="20 deg", azimuth="90 deg", pitch="2 deg")
YAWED = Impact(velocity=825.0, yaw="3 deg")
# An image differs from a computed hit by rounding only: measured, 64 to 256 hits, double precision: 5e-13 m/s, 2e-13°,
# 1e-11 rad/s, 1e-12 J.
ROUNDING = {"m s-1": 1e-10, "degree": 1e-10, "rad s-1": 1e-8, "J": 1e-9, "s": 1e-15, "1": 0.0}


def campaign(pattern: Any = SLOTS, impact: Impact = STRAIGHT, count: int = 32, **changes: Any) -> Campaign:
    plate = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, pattern=pattern)
    usual: dict[str, Any] = {"title": "a test", "core": CORE, "plate": plate, "impact": impact}
    usual |= {"numerics": Numerics(level=0, precision="double"), "output": Output(solid_reference=False)}
    return Campaign(**usual | {"hits": Hits(count=count, seed=2, irreducible=True)} | changes)


def every_hit_computed(campaign: Campaign, unfolded: xarray.Dataset, folder: Path) -> xarray.Dataset:
    """The hits of an unfolded result, each computed."""
    points = np.column_stack([unfolded["hit_y"], unfolded["hit_z"]])
    np.savetxt(folder / "hits.csv", points, fmt="%.17g", delimiter=",", header="hit_y,hit_z", comments="")
    listed = campaign.model_copy(update={"hits": Hits(sampling="list", file=folder / "hits.csv")})
    return run(listed, device="cpu")


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many shots each computation had."""
    counts: list[int] = []

    def counting(memory: Memory, *how: Any) -> Outcomes:
        counts.append(len(memory.prepared.shots))
        return simulation.marched(memory, *how)

    monkeypatch.setattr(computing, "marched", counting)
    return counts


@pytest.fixture
def glide() -> PolygonsPattern:
    """Holes whose only symmetry is a mirror image in z with a shift by half a cell."""
    hole = np.array([(-5, -6), (-3, -6), (-3, 2), (-7, 2), (-7, -2), (-5, -2)])
    shift = np.array([8, 8])
    polygons = [(1e-3 * hole).tolist(), (1e-3 * (hole * (1, -1) + shift)).tolist()]
    return PolygonsPattern(polygons=polygons, spacing=(16e-3, 16e-3), cell_size=0.25e-3)


@pytest.mark.parametrize(
    ("pattern", "impact", "images"),
    [
        (SLOTS, STRAIGHT, 8),
        (SLOTS.model_copy(update={"staggered": False}), STRAIGHT, 4),
        (SLOTS, SPINNING, 4),
        (SLOTS, PITCHED, 4),
        (SLOTS, YAWED, 4),
        (TRIANGLES, STRAIGHT, 4),
        ("glide", STRAIGHT, 2),
    ],
    ids=["slots", "rows", "spinning", "pitched", "yawed", "triangles", "glide"],
)
def test_unfolded_equals_computed(
    pattern: Any, impact: Impact, images: int, computed: list[int], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    scene = campaign(request.getfixturevalue(pattern) if isinstance(pattern, str) else pattern, impact)
    unfolded = run(scene, device="cpu")
    assert computed == [32 // images]
    assert unfolded.sizes["hit"] == 32
    assert unfolded.attrs["computed_hits"] == 32 // images
    assert unfolded.attrs["images"] == unfolded.attrs["symmetries"].count("(") == images
    every = every_hit_computed(scene, unfolded, tmp_path)
    for name in (*SHOT_VARIABLES, *OUTCOME_VARIABLES):
        tolerance = ROUNDING[name.units]
        np.testing.assert_allclose(unfolded[name], every[name], rtol=0.0, atol=tolerance, err_msg=name)
    for name in ("pitch", "yaw"):
        assert np.abs(every[name]).max() > 1.0  # so that a sign would show
    assert (np.abs(every["angular_velocity"]).max("hit")[1:] > 100.0).all()


def test_a_scene_without_symmetry_is_computed_whole(computed: list[int]) -> None:
    rimmed = campaign().plate.model_copy(update={"size": (40e-3, 40e-3)})
    result = run(campaign(plate=rimmed, impact=Impact(velocity=825.0, pitch=5, yaw=5), count=4), device="cpu")
    assert computed == [4]
    assert result.attrs["symmetries"] == "(y, z)"
    assert result.attrs["computed_hits"] == 4


def test_a_finite_plate_is_unfolded_by_mirror_images(tmp_path: Path) -> None:
    # Some cores, but not all, reach beyond the rim.
    rimmed = campaign().plate.model_copy(update={"size": (14e-3, 18e-3)})
    unfolded = run(campaign(plate=rimmed), device="cpu")
    assert unfolded.attrs["symmetries"] == "(y, z), (y, -z), (-y, z), (-y, -z)"
    every = every_hit_computed(campaign(plate=rimmed), unfolded, tmp_path)
    np.testing.assert_allclose(unfolded["residual_velocity"], every["residual_velocity"], rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("impact", [STRAIGHT, PITCHED], ids=["straight", "pitched"])
def test_every_image_replays_to_the_bits_of_its_outcome(impact: Impact, tmp_path: Path) -> None:
    scene = campaign(impact=impact, count=16, numerics=Numerics(level=0))
    files.write(run(scene, device="cpu"), tmp_path / "a.nc")
    stored = files.read(tmp_path / "a.nc")
    for hit in range(8, 16):
        history = replay(stored, hit, folder=tmp_path)
        assert history.attrs["agreement"] == "bit-identical"
        last = history.isel(time=-1)
        end = stored["angular_velocity"][hit].values
        assert last["angular_velocity"].values == pytest.approx(end, rel=1e-4, abs=1.0)
        moved = last["plate_position"][1:] - last["position"][1:]
        assert moved.values == pytest.approx([float(stored["hit_y"][hit]), float(stored["hit_z"][hit])], abs=1e-12)


@pytest.mark.parametrize("impact", [STRAIGHT, PITCHED], ids=["straight", "pitched"])
def test_the_history_of_an_image_is_that_of_its_own_shot(impact: Impact) -> None:
    asked = campaign(impact=impact, count=8)
    group = symmetries_used(asked.impact, asked.hits, asked.plate)
    shots = make_shots(asked.impact, asked.hits, asked.plate)
    alone = [replaying.replay(asked.scene, shots[k : k + 1], numerics=asked.numerics) for k in range(len(group))]
    for k, symmetry in enumerate(group):
        home, image = ((shots.hit_y[at], shots.hit_z[at]) for at in (0, k))
        folded = image_of(alone[0], symmetry, home=home, image=image)
        for name in History.__dataclass_fields__:
            got, expected = (getattr(one.history, name) for one in (folded, alone[k]))
            scale = np.abs(expected).max()
            np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-8 * scale + 1e-9, err_msg=name)
        cells = [common(getattr(folded.plate, axis), getattr(alone[k].plate, axis)) for axis in ("cell_y", "cell_z")]
        shares = [
            one.plate.share[:, y[:, None], z]
            for one, y, z in zip((folded, alone[k]), *([axis[0], axis[1]] for axis in cells), strict=True)
        ]
        np.testing.assert_allclose(*shares, rtol=0.0, atol=1e-9)
        assert (shares[0] != shares[0][:, ::-1]).any()


@pytest.mark.parametrize("signs", [(1, 1), (-1, 1), (-1, -1)])
def test_an_element_of_an_image_keeps_its_orientation(signs: tuple[int, int]) -> None:
    asked = campaign(count=4)
    alone = replaying.replay(
        asked.scene, make_shots(asked.impact, asked.hits, asked.plate)[:1], numerics=asked.numerics
    )
    corners = np.array([[x, y, z] for x, y, z in CORNERS], dtype=np.float32)
    cube = Deformed(np.arange(8)[None, :], corners[None], np.ones((1, 1), dtype=bool), np.zeros((1, 1)))
    symmetry = Symmetry(*signs, False)
    folded = image_of(replace(alone, deformed=cube), symmetry, home=(0.0, 0.0), image=(0.0, 0.0)).deformed
    assert folded is not None
    places = folded.position[0][folded.corners[0]]
    assert np.linalg.det(places[[1, 3, 4]] - places[0]) == pytest.approx(1.0)
    assert folded.position[0] == pytest.approx(corners * [1, *signs])


def common(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices into two increasing axes of the cells that both have; an image's window may lie a cell beside."""
    assert (np.diff(one) > 0.0).all()
    at, of = np.nonzero(np.abs(one[:, None] - other) < 1e-9)
    assert len(at) >= len(one) - 1
    return at, of


@pytest.mark.usefixtures("unrendered")
def test_the_command_tells_what_was_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = SLOTTED_PLATE.read_text().replace('fidelity = "standard"', "level = 0")
    text = text.replace("seed = 1", "seed = 1\nirreducible = true")
    for impact, sentence in (
        ('"825 m/s"', "8 of 64 hits computed, the others are their images by (y, z), (y, z) + centring, (y, -z), "),
        ('"825 m/s"\npitch = "1 deg"\nspin = 1e4', "32 of 64 hits computed"),
    ):
        Path("a.toml").write_text(text.replace('"825 m/s"', impact))
        assert main(["run", "a.toml", "--count", "64", "--device", "cpu", "--overwrite"]) == 0
        assert sentence in capsys.readouterr().out
        assert main(["plot", "a.nc", "--overwrite"]) == 0
        assert main(["replay", "a.nc", "--hit", "63", "--overwrite"]) == 0
        assert "The end is bit-identical to the stored outcome.\n" in capsys.readouterr().out
    rim = '[plate]\nsize = ["40 mm", "40 mm"]'
    Path("a.toml").write_text(text.replace('"825 m/s"', '"825 m/s"\npitch = 5\nyaw = 5').replace("[plate]", rim))
    assert main(["run", "a.toml", "--count", "4", "--device", "cpu", "--overwrite"]) == 0
    assert "all 4 hits computed: plate and shot have no symmetry in common" in capsys.readouterr().out


def test_an_unfolded_run_is_streamed_resumed_and_replayed(
    tmp_path: Path, small_shards: None, assert_same_bits: Callable[[Path, Path], None]
) -> None:
    scatter = Scatter(velocity={"distribution": "normal", "mean": "820 m/s", "std": "10 m/s"})
    scene = campaign(count=1100, numerics=Numerics(level=0), scatter=scatter)  # 137 orbits

    def interrupt(standing: RunProgress) -> None:
        assert standing.total == 1096
        if standing.saved >= shards.FEWEST:
            raise KeyboardInterrupt

    straight, resumed = tmp_path / "straight.nc", tmp_path / "resumed.nc"
    run_to_file(scene, straight, device="cpu,cpu")
    with pytest.raises(Interrupted):
        run_to_file(scene, resumed, device="cpu", progress=interrupt)
    for path in resumed.with_name("resumed.nc.parts").glob("*.nc"):
        shard = files.read(path)
        assert shard.attrs["computed_hits"] == shard.sizes["hit"] // 8
    run_to_file(scene, resumed, device="cpu", resume=True)
    assert_same_bits(straight, resumed)
    stored = files.read(resumed)
    assert stored.sizes["hit"] == 1096
    assert stored.attrs["computed_hits"] == 137
    assert stored.attrs["hits_per_second"] == pytest.approx(137 / stored.attrs["compute_time"])
    assert "137 of 1096 hits computed" in inspect_text(stored)
    velocity = stored["impact_velocity"].values.reshape(-1, 8)
    assert (velocity == velocity[:, :1]).all()
    assert len(np.unique(velocity)) == 137
    assert replay(stored, 1095, folder=tmp_path).attrs["agreement"] == "bit-identical"


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_a_stop_rule_counts_a_hit_and_its_images_once(sampling: str, small_shards: None) -> None:
    rule = Stop(quantity="mean(residual_velocity)", half_width="3 m/s", max_count=8192)
    hits = Hits(sampling=sampling, count=8192, seed=3, irreducible=True)
    scene = campaign(hits=hits, numerics=Numerics(level=0), stop=rule)
    result = run(scene, device="cpu")
    assert 256 < result.sizes["hit"] < 8192
    computed = Tally(rule.measure, replicates=scene.replicates)
    computed.add(result.isel(hit=slice(None, None, 8)))
    expected = computed.estimate()
    assert result.attrs["stop_reason"] == "half_width"
    assert result.attrs["estimate"] == pytest.approx(expected.value, rel=1e-12)
    assert result.attrs["estimate_interval"] == pytest.approx([expected.low, expected.high], rel=1e-9)
    told = estimated(result, [rule.measure])[rule.measure]
    assert [told.low, told.high] == pytest.approx([expected.low, expected.high], rel=1e-9)


TALLIED = ["mean(energy_loss)", "quantile(residual_velocity, 0.3)", "P(residual_velocity > 780 m/s)", "P(perforated)"]


@pytest.mark.parametrize("replicates", [1, 8])
@pytest.mark.parametrize("text", TALLIED)
def test_images_tell_no_more_than_one_of_them(text: str, replicates: int, make_result: Any) -> None:
    single = make_result(np.random.default_rng(4).choice([0, 0, 0, 2, 3], 400))
    images = single.isel(hit=np.repeat(np.arange(400), 4))
    one = Tally(Measure.parse(text), replicates=replicates)
    many = Tally(Measure.parse(text), replicates=replicates, images=4)
    one.add(single)
    many.add(images.isel(hit=slice(0, 600)))
    many.add(images.isel(hit=slice(600, None)))
    expected, told = one.estimate(), many.estimate()
    assert told.count == 4 * expected.count
    if not text.startswith("quantile"):  # a quantile interpolates between neighbours, which are images
        assert told.value == pytest.approx(expected.value, rel=1e-12)
        assert [told.low, told.high] == pytest.approx([expected.low, expected.high], rel=1e-9)
    else:
        step = 100.0 * 0.9 / 399
        assert told.value == pytest.approx(expected.value, abs=2.0 * step)
        assert [told.low, told.high] == pytest.approx([expected.low, expected.high], abs=3.0 * step)
