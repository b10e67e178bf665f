"""open_result: a result of which only what is used is read, and one sentence where there is no result."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import ResultError, open_result
from warpimpact.results import files


def test_a_result_is_opened_by_its_name(tmp_path: Path, make_result: Callable[..., xarray.Dataset]) -> None:
    written = make_result(5)
    files.write(written, tmp_path / "a.nc")
    for name in (tmp_path / "a.nc", str(tmp_path / "a.nc")):
        with open_result(name) as result:
            assert not result.residual_velocity.variable._in_memory  # read when it is used
            assert np.array_equal(result.residual_velocity, written.residual_velocity)
            assert result.tilt.attrs["units"] == "degree"


def test_what_is_no_result_is_told(tmp_path: Path) -> None:
    xarray.Dataset({"a": 1.0}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(ResultError, match=r"other\.nc: not a warpimpact result"):
        open_result(tmp_path / "other.nc")
    with pytest.raises(ResultError, match=r"none\.nc: cannot be read \(it is not there\)"):
        open_result(str(tmp_path / "none.nc"))
