"""Regular maps of the hits: exact where they must be, empty where too few hits are, plotted by xarray itself."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray

import warpimpact
from warpimpact.kernels.status import Status

PERIOD = np.array([16e-3, 8e-3])
ResultMaker = Callable[..., xarray.Dataset]


def test_a_place_takes_the_nearest_hit_across_the_edges(make_result: ResultMaker) -> None:
    dataset = make_result(150)
    shown = warpimpact.hit_map(dataset, "tilt", standoff=0.13, pixels=40)
    offset = np.stack([shown.hit_y.values[:, None], np.full((40, 1), shown.hit_z.values[0])], axis=-1)
    offset = offset - np.stack([dataset.hit_y, dataset.hit_z], axis=-1)
    offset -= PERIOD * np.round(offset / PERIOD)
    nearest = np.linalg.norm(offset, axis=-1).argmin(axis=1)
    assert (shown.dims, shown.shape, shown.attrs["units"]) == (("hit_z", "hit_y"), (20, 40), "degree")
    assert float(shown["standoff"]) == 0.13
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
