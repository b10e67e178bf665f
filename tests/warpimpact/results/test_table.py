"""Tables are what xarray makes of them: in memory, in a file to the bit, and in parts."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.inspection import summary_text
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.dataset import numbered
from warpimpact.results.layers import in_memory
from warpimpact.results.netcdf import open_table, read_table, write_table
from warpimpact.results.table import HitTable, joined
from warpimpact.runs.compute import HIT_MAP
from warpimpact.scene import Numerics
from warpimpact.solver.worker import Worker

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


@pytest.fixture(scope="module", params=["slotted_plate", "layered_target"])
def table(request: pytest.FixtureRequest) -> HitTable:
    """Some hits of a campaign."""
    campaign = Campaign.from_toml(CAMPAIGNS / f"{request.param}.toml")
    campaign = campaign.model_copy(update={"numerics": Numerics(level=0)})
    shots = campaign.sampler().shots(0, 40)
    return HIT_MAP.compute(campaign, shots, None, Worker("cpu"))


def content(group: Any, name: str = "") -> Iterator[tuple[Any, ...]]:
    """All that a netCDF file holds, in its order; HDF5 keeps none of attributes."""
    for dimension in group.dimensions.values():
        yield name, dimension.name, dimension.size, dimension.isunlimited()
    told = [(group, name), *((variable, f"{name}/{variable.name}") for variable in group.variables.values())]
    for one, place in told:
        for key in sorted(one.ncattrs()):
            value = one.getncattr(key)
            yield place, key, type(value), np.asarray(value).dtype.str, np.asarray(value).tobytes(), str(value)
    for variable in group.variables.values():
        variable.set_auto_maskandscale(False)
        values = variable[...]
        bits = values.tolist() if values.dtype == object else values.tobytes()
        yield name, variable.name, variable.dimensions, str(variable.dtype), variable.shape, bits
        yield name, variable.name, variable.chunking(), variable.filters()
    for inner in group.groups.values():
        yield from content(inner, f"{name}/{inner.name}")


def content_of(path: Path) -> list[tuple[Any, ...]]:
    with netCDF4.Dataset(path) as file:
        return list(content(file))


def encoding_of(dataset: xarray.Dataset) -> dict[Any, Any]:
    """Numbers are compressed; a coordinate has no missing values."""
    packed = {name: {"zlib": True, "complevel": 1} for name, one in dataset.variables.items() if one.dtype.kind in "if"}
    return {
        name: packed.get(name, {}) | ({"_FillValue": None} if name in dataset.coords else {})
        for name in dataset.variables
    }


def test_the_file_is_that_of_xarray(table: HitTable, tmp_path: Path) -> None:
    table = numbered(table, first=0)
    write_table(table, tmp_path / "table.nc")
    dataset, path = table.to_xarray(), tmp_path / "xarray.nc"
    in_groups = {group: [name for name in names if name in table] for group, names in v.GROUPS.items()}
    root = dataset.drop_vars([name for names in in_groups.values() for name in names])
    root.to_netcdf(path, encoding=encoding_of(root), engine="netcdf4")
    for group, names in in_groups.items():
        if names:
            inner = dataset[names].reset_coords(names).drop_attrs(deep=False)
            inner.to_netcdf(path, mode="a", group=group, encoding=encoding_of(inner), engine="netcdf4")
    assert content_of(tmp_path / "table.nc") == content_of(path)
    files.write(in_memory(dataset), tmp_path / "again.nc")
    assert sorted(map(str, content_of(tmp_path / "again.nc"))) == sorted(map(str, content_of(path)))
    assert files.read(tmp_path / "table.nc").identical(files.read(tmp_path / "again.nc"))


def test_a_chunked_file_is_that_of_xarray(table: HitTable, tmp_path: Path) -> None:
    table = table.drop_vars([name for names in v.GROUPS.values() for name in names])
    write_table(table, tmp_path / "table.nc", chunk=16, compressed=False)
    dataset, chunks = table.to_xarray(), {}
    for name, array in dataset.variables.items():
        chunks[name] = {"chunksizes": (16, *array.shape[1:])} if "hit" in array.dims else {}
        chunks[name] |= {"_FillValue": None} if name in dataset.coords else {}
    dataset.to_netcdf(tmp_path / "xarray.nc", encoding=chunks, unlimited_dims=["hit"], engine="netcdf4")
    assert content_of(tmp_path / "table.nc") == content_of(tmp_path / "xarray.nc")


def test_what_was_written_is_read(table: HitTable, tmp_path: Path) -> None:
    write_table(table, tmp_path / "a.nc")
    read = read_table(tmp_path / "a.nc")
    assert read.to_xarray().identical(table.to_xarray())
    with xarray.open_dataset(tmp_path / "a.nc") as plain:
        assert set(plain.coords) == read.coords - {name for names in v.GROUPS.values() for name in names}


def test_parts_of_an_open_file_are_parts_in_memory(table: HitTable, tmp_path: Path) -> None:
    write_table(table, tmp_path / "a.nc")
    with open_table(tmp_path / "a.nc") as read:
        inner = read.isel(hit=slice(10, 30)).isel(hit=slice(5, 100))
        assert inner.sizes["hit"] == 15
        assert inner.to_xarray().identical(table.to_xarray().isel(hit=slice(15, 30)))
        assert summary_text(read) == summary_text(table.to_xarray())


def test_parts_join_to_the_whole(table: HitTable) -> None:
    parts = [table.isel(hit=slice(first, first + 15)) for first in range(0, 40, 15)]
    assert joined(parts).to_xarray().identical(table.to_xarray())
