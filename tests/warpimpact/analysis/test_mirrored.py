"""Hits of the irreducible part with their mirror images are those that a run of every hit gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, Hits, Impact, Numerics, Plate, PolygonsPattern, SlotPattern, hit_map, run
from warpimpact.analysis.hit_map import mirrored
from warpimpact.campaign.tables import Output
from warpimpact.cli import main
from warpimpact.plotting.cell import nearest_hits, shots_text
from warpimpact.report.hit_data import page_data, thinned
from warpimpact.results import files
from warpimpact.results.variables import OUTCOME_VARIABLES, SHOT_VARIABLES
from warpimpact.runs.replay import replay
from warpimpact.scene import PolynomialCore, TrianglePattern

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


def campaign(pattern: Any = SLOTS, impact: Impact = STRAIGHT, count: int = 8, **changes: Any) -> Campaign:
    plate = Plate(thickness=4e-3, resistance=2.6e9, shear_coefficient=0.05, degradation=0.8, pattern=pattern)
    usual: dict[str, Any] = {"title": "a test", "core": CORE, "plate": plate, "impact": impact}
    usual |= {"numerics": Numerics(level=0, precision="double"), "output": Output(solid_reference=False)}
    return Campaign(**usual | {"hits": Hits(count=count, seed=2, irreducible=True)} | changes)


def every_hit_computed(campaign: Campaign, whole: xarray.Dataset, folder: Path) -> xarray.Dataset:
    """The hits of a mirrored result, each computed."""
    points = np.column_stack([whole["hit_y"], whole["hit_z"]])
    np.savetxt(folder / "hits.csv", points, fmt="%.17g", delimiter=",", header="hit_y,hit_z", comments="")
    listed = campaign.model_copy(update={"hits": Hits(sampling="list", file=folder / "hits.csv")})
    return run(listed, device="cpu")


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
    part = run(scene, device="cpu")
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
    result = run(campaign(plate=rimmed, impact=Impact(velocity=825.0, pitch=5, yaw=5), count=4), device="cpu")
    assert result.attrs["symmetries"] == "(y, z)"
    assert mirrored(result) is result


def test_a_finite_plate_has_mirror_images_without_centring(tmp_path: Path) -> None:
    # Some cores, but not all, reach beyond the rim.
    rimmed = campaign().plate.model_copy(update={"size": (14e-3, 18e-3)})
    part = run(campaign(plate=rimmed), device="cpu")
    assert part.attrs["symmetries"] == "(y, z); (y, -z); (-y, z); (-y, -z)"
    whole = mirrored(part)
    every = every_hit_computed(campaign(plate=rimmed), whole, tmp_path)
    np.testing.assert_allclose(whole["residual_velocity"], every["residual_velocity"], rtol=0.0, atol=1e-10)


@pytest.mark.usefixtures("unrendered")
def test_maps_and_pages_show_the_whole_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = SLOTTED_PLATE.read_text().replace('fidelity = "standard"', "level = 0")
    Path("a.toml").write_text(text.replace("seed = 1", "seed = 1\nirreducible = true"))
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
