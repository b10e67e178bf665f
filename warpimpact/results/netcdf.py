"""Tables in netCDF files. xarray would write the same files of the Datasets, to the bit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from warpimpact.results import variables as v
from warpimpact.results.table import HitTable, StoredColumn, joined

FILE_CHUNK = 2**15
"""Hits per chunk of a joined file: 256 KiB of one variable."""
_PACKED = {"zlib": True, "complevel": 1}


def write_table(
    table: HitTable,
    file: Path,
    *,
    chunk: int | None = None,
    compressed: bool = True,
    references: Mapping[str, HitTable] | None = None,
) -> None:
    """Write a HitTable. Coordinates that belong to a group are written into it.

    Args:
        references: tables of references, by the names of their groups.
        chunk: hits per chunk; "hit" is then unlimited.
        compressed: whether numbers of the root are compressed. Those of the groups always are.
    """
    groups = {group: [name for name in names if name in table.coords] for group, names in v.GROUPS.items()}
    root = table.drop_vars([name for names in groups.values() for name in names])
    with netCDF4.Dataset(file, "w", format="NETCDF4") as target:
        target.setncatts(root.attrs)
        if chunk is not None:
            target.createDimension(v.HIT, None)
        _write(root.variables, root.coords, target, chunk=chunk, compressed=compressed)
        for group, names in groups.items():
            if names:
                inner = {name: table[name] for name in names}
                beside = {dim: table[dim] for column in inner.values() for dim in column.dims if dim in table.coords}
                _write(inner | beside, frozenset(beside), target.createGroup(group))
        write_groups(references or {}, target)


def write_groups(groups: Mapping[str, HitTable], target: Any) -> None:
    """Write tables of references into an open file, each into a group of its name, without outlines and names of axes
    and layers: xarray crashes when it reads and closes groups with strings again and again."""
    for name, table in groups.items():
        strings = [label for label, column in table.variables.items() if column.values.dtype.kind in "UO"]
        table = table.drop_vars([*strings, *(inner for names in v.GROUPS.values() for inner in names)])
        group = target.createGroup(name)
        group.setncatts(table.attrs)
        _write(table.variables, table.coords, group)


def _write(
    variables: Mapping[str, StoredColumn],
    coords: frozenset[str],
    target: Any,
    *,
    chunk: int | None = None,
    compressed: bool = True,
) -> None:
    """Write variables into a file or one of its groups."""
    for column in variables.values():
        for dim, size in zip(column.dims, column.shape, strict=True):
            if dim not in target.dimensions:
                target.createDimension(dim, size)
    beside = sorted(name for name in coords if variables[name].dims != (name,))
    for name, column in variables.items():
        values, attributes = column.values, dict(column.attrs)
        options: dict[str, Any] = dict(_PACKED) if compressed and values.dtype.kind in "if" else {}
        if chunk is not None and v.HIT in column.dims:
            options["chunksizes"] = (chunk, *column.shape[1:])
        if name not in coords:  # CF: a coordinate has no missing values
            options["fill_value"] = np.array(np.nan, values.dtype) if values.dtype.kind == "f" else None
            near = " ".join(other for other in beside if {*variables[other].dims} <= {*column.dims})
            attributes |= {"coordinates": near} if near else {}
        kind = str if values.dtype.kind in "UO" else values.dtype
        written = target.createVariable(name, kind, column.dims, **options)
        written.setncatts(attributes)
        written.set_auto_maskandscale(False)
        written[:] = values.astype(object) if kind is str else values


def write_joined(
    tables: Iterable[HitTable],
    hits: int,
    file: Path,
    attributes: Mapping[str, Any],
    references: Mapping[str, HitTable],
) -> None:
    """Join tables of consecutive hits into one file, with a few of them in memory at a time.

    Args:
        hits: number of all hits.
        attributes: global attributes, which replace those of the first table.
        references: as in `write_table`.
    """
    gathered = _gathered(tables)
    write_table(first := next(gathered), file, chunk=min(hits, FILE_CHUNK))
    with netCDF4.Dataset(file, "a") as target:
        target.set_auto_maskandscale(False)
        for variable in target.variables.values():  # the cache of a variable, by default megabytes, holds two chunks
            if variable.chunking() != "contiguous":
                variable.set_var_chunk_cache(size=2 * math.prod(variable.chunking()) * variable.dtype.itemsize)
        at = first.sizes[v.HIT]
        for table in gathered:
            for name, column in table.variables.items():
                if v.HIT in column.dims and name in target.variables:
                    target[name][at : at + column.shape[0]] = column.values
            at += table.sizes[v.HIT]
        target.setncatts(dict(attributes))
        write_groups(references, target)


def _gathered(tables: Iterable[HitTable]) -> Iterator[HitTable]:
    """Tables joined to at least half a chunk, because every access to a file costs some time."""
    waiting: list[HitTable] = []
    for table in tables:
        waiting.append(table)
        if sum(part.sizes[v.HIT] for part in waiting) >= FILE_CHUNK // 2:
            yield joined(waiting)
            waiting = []
    if waiting:
        yield joined(waiting)


@contextmanager
def open_table(path: Path) -> Iterator[HitTable]:
    """Open a file that `write_table` wrote. Values are read when they are used."""
    with netCDF4.Dataset(path) as source:
        source.set_auto_maskandscale(False)
        groups = [group for group in v.GROUPS if group in source.groups]
        for group in groups:
            source[group].set_auto_maskandscale(False)
        root = {name: _column(variable) for name, variable in source.variables.items()}
        grouped = {
            name: _column(source[group][name])
            for group in groups
            for name in v.GROUPS[group]
            if name in source[group].variables
        }
        named = {name for column in root.values() for name in column.attrs.pop("coordinates", "").split()}
        coords = {*named, *grouped, *(name for name in root if root[name].dims == (name,))}
        yield HitTable(root | grouped, frozenset(coords), {name: source.getncattr(name) for name in source.ncattrs()})


def read_table(path: Path) -> HitTable:
    """Read a file that `write_table` wrote into memory."""
    with open_table(path) as table:
        return table.load()


def attribute(path: Path, name: str) -> Any:
    """A global attribute of a netCDF file; None if it is not there."""
    with netCDF4.Dataset(path) as source:
        return source.getncattr(name) if name in source.ncattrs() else None


def _column(variable: Any) -> Any:
    attributes = {name: variable.getncattr(name) for name in variable.ncattrs() if name != "_FillValue"}
    return StoredColumn(tuple(variable.dimensions), variable, attributes)
