"""Regular maps of the hits: exact where they must be, empty where too few hits are, plotted by xarray itself."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import xarray

import warpimpact
from warpimpact import Campaign
from warpimpact.kernels.status import Status
from warpimpact.runs.run import run

mpl.use("Agg")
PERIOD = np.array([16e-3, 8e-3])
SLOTTED_PLATE = (Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
ResultMaker = Callable[..., xarray.Dataset]


def with_tilt(dataset: xarray.Dataset, values: np.ndarray) -> xarray.Dataset:
    dataset["tilt"].values[:, 1] = values
    return dataset


def test_a_linear_map_of_a_plane_is_the_plane(make_result: ResultMaker) -> None:
    """Linear interpolation is exact for y + 2 z but at the edges, across which the periodic cell jumps."""
    dataset = make_result(600, double=True)
    dataset = with_tilt(dataset, 1e3 * (dataset["hit_y"] + 2.0 * dataset["hit_z"]).values)
    shown = warpimpact.hit_map(dataset, "tilt", standoff=0.13, method="linear", pixels=32)
    assert shown.shape == (16, 32)
    assert shown.dims == ("hit_z", "hit_y")
    inside = shown.sel(hit_y=slice(-6e-3, 6e-3), hit_z=slice(-2e-3, 2e-3))
    np.testing.assert_allclose(inside, (1e3 * (inside.hit_y + 2.0 * inside.hit_z)).transpose(*inside.dims), atol=1e-9)
    assert shown.attrs["units"] == "degree"
    assert float(shown["standoff"]) == 0.13


def test_a_place_takes_the_nearest_hit_across_the_edges(make_result: ResultMaker) -> None:
    dataset = make_result(150)
    shown = warpimpact.hit_map(dataset, "tilt", standoff=0.13, pixels=40)
    offset = np.stack([shown.hit_y.values[:, None], np.full((40, 1), shown.hit_z.values[0])], axis=-1)
    offset = offset - np.stack([dataset.hit_y, dataset.hit_z], axis=-1)
    offset -= PERIOD * np.round(offset / PERIOD)
    nearest = np.linalg.norm(offset, axis=-1).argmin(axis=1)
    np.testing.assert_array_equal(shown[0], dataset["tilt"].values[nearest, 1])


def test_a_place_far_from_every_hit_has_no_value(make_result: ResultMaker) -> None:
    dataset = make_result(400)
    half = dataset.isel(hit=(dataset["hit_y"] < 0.0).values)
    shown = warpimpact.hit_map(half, "residual_velocity")
    assert shown.sel(hit_y=slice(-7e-3, -1e-3)).notnull().all()
    assert shown.sel(hit_y=slice(3e-3, 5e-3)).isnull().all()


def test_a_hit_without_a_value_leaves_its_place_empty(make_result: ResultMaker) -> None:
    status = np.where(np.arange(500) % 5 == 0, Status.RICOCHETED, Status.PERFORATED)
    dataset = make_result(status)
    assert np.isfinite(dataset["residual_velocity"]).all()  # also of the cores that came back
    shown = warpimpact.hit_map(dataset, "residual_velocity")
    codes = warpimpact.hit_map(dataset, "status")
    np.testing.assert_array_equal(shown.isnull(), codes == Status.RICOCHETED)
    assert 0.1 < float(shown.isnull().mean()) < 0.3


@pytest.mark.parametrize("repeats", [1, 3])
def test_a_grid_is_its_own_map(repeats: int) -> None:
    text = SLOTTED_PLATE.replace('"standard"', '"draft"').replace("seed = 1\n", f"repeats = {repeats}\n")
    text = text.replace('"sobol"', '"grid"').replace("4096", "48")
    dataset = run(Campaign.from_text(text, name="a", folder=Path()), device="cpu")
    shown = warpimpact.hit_map(dataset, "tilt", standoff=0.13)
    assert shown.size * repeats == dataset.sizes["hit"]
    assert np.isfinite(shown).all()
    for hit in (0, 5, dataset.sizes["hit"] - 1):
        one = dataset.isel(hit=hit)
        at = shown.sel(hit_y=one.hit_y, hit_z=one.hit_z)
        assert float(at) == pytest.approx(float(one["tilt"].sel(standoff=0.13)), rel=1e-6)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"variable": "angular_velocity"}, '"angular_velocity" cannot be mapped; choose one of impact_velocity'),
        ({"variable": "tilt", "standoff": 0.2}, "got 200 mm, but the stand-offs are 50 mm, 130 mm"),
        ({"variable": "status", "method": "linear"}, "codes cannot be interpolated"),
        ({"variable": "tilt", "pixels": 0}, "pixels: got 0, but it must be at least 1"),
    ],
)
def test_what_cannot_be_mapped_is_reported(make_result: ResultMaker, change: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        warpimpact.hit_map(make_result(10), **change)


def test_hits_outside_the_cell_are_no_part_of_its_map(make_result: ResultMaker) -> None:
    with pytest.raises(ValueError, match="hits outside the cell"):
        warpimpact.hit_map(make_result(2, np.array([[0.0, 0.0], [9e-3, 0.0]])), "tilt")
