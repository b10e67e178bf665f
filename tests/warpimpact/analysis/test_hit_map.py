"""Maps of a cell: nearest hits across its edges, mirror images of the irreducible part, and what presses on a core."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import warpimpact
from warpimpact import Campaign, FastLaw, Hits, Impact, Plate, PolygonsPattern, SlotPattern, hit_map, run
from warpimpact.analysis.hit_map import mirrored
from warpimpact.analysis.replay_geometry import pressed
from warpimpact.campaign.tables import Output
from warpimpact.cli import main
from warpimpact.measures.references import law_of
from warpimpact.plotting.cell import nearest_hits, shots_text
from warpimpact.records.variables import OUTCOME_VARIABLES, SHOT_VARIABLES
from warpimpact.report.hit_data import page_data, thinned
from warpimpact.results import files
from warpimpact.runs.replay import replay
from warpimpact.scene import PolynomialCore, TrianglePattern

from ...options import CPU
from ..slotted import slotted, slotted_text

PERIOD = np.array([16e-3, 8e-3])
ResultMaker = Callable[..., xarray.Dataset]


def test_a_place_far_from_every_hit_has_no_value(make_result: ResultMaker) -> None:
    dataset = make_result(400)
    half = dataset.isel(hit=(dataset["hit_y"] < 0.0).values)
    shown = warpimpact.hit_map(half, "residual_velocity")
    assert shown.sel(hit_y=slice(-7e-3, -1e-3)).notnull().all()
    assert shown.sel(hit_y=slice(3e-3, 5e-3)).isnull().all()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"variable": "angular_velocity"}, '"angular_velocity" cannot be mapped; choose one of impact_velocity'),
        ({"variable": "tilt", "standoff": 0.2}, "got 200 mm, but the stand-offs are 50 mm, 130 mm"),
        ({"variable": "tilt", "pixels": 0}, "pixels: got 0, but it must be at least 1"),
    ],
)
def test_what_cannot_be_mapped_is_reported(make_result: ResultMaker, change: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        warpimpact.hit_map(make_result(10), **change)


def test_hits_outside_the_cell_are_no_part_of_its_map(make_result: ResultMaker) -> None:
    with pytest.raises(ValueError, match="hits outside the cell"):
        warpimpact.hit_map(make_result(2, np.array([[0.0, 0.0], [9e-3, 0.0]])), "tilt")


CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
TRIANGLES = TrianglePattern(side=8e-3, spacing=(10e-3, 9e-3), staggered=True)
STRAIGHT = Impact(velocity=825.0)
PITCHED = Impact(velocity=825.0, obliquity="20 deg", azimuth="90 deg", pitch="2 deg")
YAWED = Impact(velocity=825.0, yaw="3 deg")
# An image differs from a computed hit by rounding only: measured, 64 to 256 hits, double precision: 5e-13 m/s, 2e-13°,
# 1e-11 rad/s, 1e-12 J.
ROUNDING = {"m s-1": 1e-10, "degree": 1e-10, "rad s-1": 1e-8, "J": 1e-9, "s": 1e-15, "1": 0.0}


def campaign(pattern: Any = SLOTS, impact: Impact = STRAIGHT, count: int = 8, **changes: Any) -> Campaign:
    plate = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, pattern=pattern)
    usual: dict[str, Any] = {"title": "a test", "core": CORE, "plate": plate, "impact": impact}
    usual |= {"numerics": FastLaw(level=0, precision="double"), "output": Output(solid_reference=False)}
    return Campaign(**usual | {"hits": Hits(count=count, seed=2, irreducible=True)} | changes)


def every_hit_computed(campaign: Campaign, whole: xarray.Dataset, folder: Path) -> xarray.Dataset:
    """The hits of a mirrored result, each computed."""
    points = np.column_stack([whole["hit_y"], whole["hit_z"]])
    np.savetxt(folder / "hits.csv", points, fmt="%.17g", delimiter=",", header="hit_y,hit_z", comments="")
    listed = campaign.model_copy(update={"hits": Hits(sampling="list", file=folder / "hits.csv")})
    return law_of(run(listed, options=CPU))


@pytest.fixture
def glide() -> PolygonsPattern:
    """Holes whose only symmetry is a mirror image in z with a shift by half a cell."""
    hole = np.array([(-5, -6), (-3, -6), (-3, 2), (-7, 2), (-7, -2), (-5, -2)])
    shift = np.array([8, 8])
    polygons = [(1e-3 * hole).tolist(), (1e-3 * (hole * (1, -1) + shift)).tolist()]
    return PolygonsPattern(polygons=polygons, spacing=(16e-3, 16e-3))


@pytest.mark.parametrize(
    ("pattern", "impact", "images"),
    [
        (SLOTS, STRAIGHT, 8),
        (SLOTS, PITCHED, 4),
        ("glide", STRAIGHT, 2),
    ],
    ids=["slots", "pitched", "glide"],
)
def test_mirror_images_equal_computed_hits(
    pattern: Any, impact: Impact, images: int, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    scene = campaign(request.getfixturevalue(pattern) if isinstance(pattern, str) else pattern, impact, 32 // images)
    part = law_of(run(scene, options=CPU))
    assert part.sizes["hit"] == 32 // images
    assert part.attrs["symmetries"].count("(") == images
    whole = mirrored(part)
    assert mirrored(whole) is whole
    assert whole.sizes["hit"] == 32
    every = every_hit_computed(scene, whole, tmp_path)
    for name in (*SHOT_VARIABLES, *(name for name in OUTCOME_VARIABLES if "axis" not in name.dims)):
        tolerance = ROUNDING[name.units]
        np.testing.assert_allclose(whole[name], every[name], rtol=0.0, atol=tolerance, err_msg=name)
        assert whole[name].attrs == part[name].attrs
    for name in ("pitch", "yaw"):
        assert np.abs(every[name]).max() > 1.0  # so that a sign would show


def test_a_scene_without_symmetry_is_sampled_whole() -> None:
    rimmed = campaign().plate.model_copy(update={"size": (40e-3, 40e-3)})
    result = law_of(run(campaign(plate=rimmed, impact=Impact(velocity=825.0, pitch=5, yaw=5), count=4), options=CPU))
    assert result.attrs["symmetries"] == "(y, z)"
    assert mirrored(result).identical(result.to_dataset())


def test_a_finite_plate_has_mirror_images_without_centring(tmp_path: Path) -> None:
    # Some cores, but not all, reach beyond the rim.
    rimmed = campaign().plate.model_copy(update={"size": (14e-3, 18e-3)})
    part = law_of(run(campaign(plate=rimmed), options=CPU))
    assert part.attrs["symmetries"] == "(y, z); (y, -z); (-y, z); (-y, -z)"
    whole = mirrored(part)
    every = every_hit_computed(campaign(plate=rimmed), whole, tmp_path)
    np.testing.assert_allclose(whole["residual_velocity"], every["residual_velocity"], rtol=0.0, atol=1e-10)


@pytest.mark.usefixtures("unrendered")
def test_maps_and_pages_show_the_whole_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    changes = ('fidelity = "draft"', "level = 0"), ("seed = 1", "seed = 1\nirreducible = true")
    Path("a.toml").write_text(slotted_text(*changes))
    assert main(["run", "a.toml", "--count", "16", "--device", "cpu"]) == 0
    assert main(["inspect", "a.nc"]) == 0
    assert "hits of 1/8 of the cell, which (y, z); (y, z) + centring; (y, -z); " in capsys.readouterr().out
    assert main(["plot", "a.nc"]) == 0
    stored = files.read(Path("a.nc"))
    assert replay(stored, 15).attrs["agreement"] == "bit-identical"
    assert nearest_hits(stored) is None
    assert nearest_hits(mirrored(stored)) is not None
    assert shots_text(mirrored(stored)).startswith("16 hits")
    yaw = hit_map(stored, "yaw", standoff=0.13, pixels=40).values
    np.testing.assert_allclose(yaw, -yaw[:, ::-1])
    assert np.abs(yaw).max() > 1.0
    (page,) = page_data([thinned(stored, 1000)])["results"]
    assert len(page["y"]) == 128
    assert page["number"][:17] == [*range(16), 0]


RESISTANCE = 2.6e9


@pytest.fixture(scope="module")
def histories() -> list[xarray.Dataset]:
    changes = ('"draft"', '"standard"'), ("shear_coefficient = 0.05", "shear_coefficient = 0")
    result = run(slotted(*changes, count=8), options=CPU)
    return [replay(result, hit, folder=Path()) for hit in range(8)]


def largest(history: xarray.Dataset) -> int:
    return int(np.linalg.norm(history["force"], axis=1).argmax())


def test_stress_adds_up_to_the_recorded_force(histories: list[xarray.Dataset]) -> None:
    for history in histories:
        step = largest(history)
        surface = pressed(history, step)
        force = -RESISTANCE * np.sum((surface.stress * surface.area)[..., None] * surface.normal, axis=(0, 1))
        recorded = history["force"].values[step]
        size = np.linalg.norm(recorded)
        assert force @ recorded / (size * np.linalg.norm(force)) > 0.995
        assert np.linalg.norm(force) == pytest.approx(size, rel=0.3)


def test_nothing_presses_outside_the_slab_or_in_holes(histories: list[xarray.Dataset]) -> None:
    for history in histories:
        surface = pressed(history, largest(history))
        x = surface.point[surface.stress > 0.0][:, 0]
        assert ((x >= 0.0) & (x <= 4e-3)).all()
        assert surface.stress.max() <= 1.0
    last = pressed(history, history.sizes["time"] - 1)
    assert not last.stress.any()
