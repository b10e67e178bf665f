"""Result files: written whole or not at all, joined from parts, read and checked."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import netCDF4

from warpimpact.results import attributes as attr
from warpimpact.results import kinds
from warpimpact.results import variables as v
from warpimpact.results.checks import HISTORY, map_fault, packing_fault, sweep_fault, unusable
from warpimpact.results.dataset import numbered
from warpimpact.results.declared import Declaration
from warpimpact.results.interrupts import uninterrupted
from warpimpact.results.netcdf import write_table
from warpimpact.results.outlines import in_a_file, in_memory
from warpimpact.results.table import Table
from warpimpact.scene.input_files import check_file

if TYPE_CHECKING:
    import xarray


class OutputError(OSError):
    """A result file that cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file that cannot be read as a warpimpact result; the message is one sentence for the user."""


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path) as file:
        write_table(in_a_file(Table.from_xarray(dataset)), file)


def write_shard(table: Table, path: Path, named: Callable[[Path], Path]) -> None:
    """Write a part of a result to a netCDF file, whole or not at all, without compression, which costs time.

    Args:
        path: its name while it is written.
        named: gives the name of what was written, by its contents.

    Raises:
        OutputError: The file cannot be written.
    """
    with uninterrupted(), aside(path, named=named) as file:
        write_table(table, file, compressed=False)


CHUNK = 2**15
"""Hits per chunk of a joined file: 256 KiB of one variable."""


@contextmanager
def aside(path: Path, folder: Path | None = None, *, named: Callable[[Path], Path] | None = None) -> Iterator[Path]:
    """A name in a folder of the same disk, if not given that of `path`, to write to; what was written there is on the
    disk before it gets its own name, which is `path` or, where there is `named`, what that makes of the file.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    written = (folder or path.parent) / f".{path.name}.{os.getpid()}.part"
    try:
        with told_as(path):
            yield written
            _flush(written, os.O_RDWR)
            os.replace(written, named(written) if named else path)
            if os.name == "posix":  # elsewhere a folder cannot be opened, and needs no flushing
                _flush(path.parent, os.O_RDONLY)
    finally:
        with suppress(OSError):
            written.unlink()


@contextmanager
def told_as(path: Path) -> Iterator[None]:
    """Tell what goes wrong in writing as an OutputError of this file."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # netCDF reports a full disk as RuntimeError
        raise OutputError(f"{path}: cannot be written ({_cause(error, path)})") from error


def _flush(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _cause(error: Exception, path: Path) -> str:
    """What an error of the disk means: netCDF does not say that the disk is full."""
    with suppress(OSError):
        if isinstance(error, RuntimeError) and shutil.disk_usage(path.parent).free < 2**20:
            return "the disk is full"
    return str(error)


def read(path: Path) -> xarray.Dataset:
    """Read a result file into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a warpimpact result.
    """
    with uninterrupted(), opened(path) as file:
        return _numbered(file.load())


def open_result(path: str | Path) -> xarray.Dataset:
    """Open a result file. Only what is used of it is read; ``with open_result(path) as result:`` closes it.

    Args:
        path: a file of ``warpimpact run``, of `run_to_file`, or of ``to_netcdf`` of a result.

    Returns:
        The Dataset of `run`, one entry per hit.

    Raises:
        ResultError: the file is missing, is not netCDF, or is not a warpimpact result.
    """
    with opened(Path(path)):
        pass  # checked; the file that is returned stays open
    dataset = _joined(Path(path))
    result = _numbered(dataset)
    result.set_close(dataset.close)
    return result


def _numbered(dataset: xarray.Dataset) -> xarray.Dataset:
    return dataset.set_xindex(v.HIT) if v.HIT in dataset.coords else numbered(dataset)


@contextmanager
def opened(path: Path) -> Iterator[xarray.Dataset]:
    """A result file of which only what is used is read.

    Raises:
        ResultError: as in `read`.
    """
    with _netcdf(path, "a map of hits", kinds.RESULT) as dataset:
        _check_map(dataset, path)
        yield dataset


@contextmanager
def opened_either(path: Path) -> Iterator[xarray.Dataset]:
    """A result file, or the history of one of its hits, of which only what is used is read.

    Raises:
        ResultError: The file is missing, is not netCDF, or is neither.
    """
    with _netcdf(path, "a map of hits", kinds.RESULT, kinds.HISTORY) as dataset:
        if is_history(dataset):
            _refuse(path, "the history of a hit", HISTORY.fault(dataset))
        else:
            _check_map(dataset, path)
        yield dataset


def read_sweep_result(path: Path) -> xarray.Dataset:
    """Read a sweep into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a sweep.
    """
    with uninterrupted(), _netcdf(path, "a sweep", kinds.SWEEP) as dataset:
        _check_has(dataset, path, *v.COORDINATES)
        _refuse(path, "a sweep", sweep_fault(dataset))
        return _numbered(dataset.load())


def read_declared(path: Path, what: str, kind: kinds.Kind, declared: Declaration) -> xarray.Dataset:
    """Read a file that has what is declared into memory.

    Args:
        what: it is, as messages say it.

    Raises:
        ResultError: the file is missing, is not netCDF, or is not such a file.
    """
    with uninterrupted(), _netcdf(path, what, kind) as file:
        dataset = file.load()
        _refuse(path, what, declared.fault(dataset))
    return dataset


def _check_has(dataset: xarray.Dataset, path: Path, *names: str) -> None:
    missing = {*names, *v.COORDINATES, *v.VARIABLES} - {v.HIT} - dataset.variables.keys()
    if missing:
        raise ResultError(f'{path}: not a warpimpact result, it has no variable "{min(missing)}"')
    if attr.PLATE_PERIOD not in dataset.attrs:
        raise ResultError(
            f'{path}: not a warpimpact result, it has no attribute "{attr.PLATE_PERIOD}"; where it was chosen from '
            "one, keep its attributes"
        )


def _check_map(dataset: xarray.Dataset, path: Path) -> None:
    _check_has(dataset, path)
    if found := unusable(dataset):
        raise ResultError(f"{path}: {found}")
    if dataset.sizes[v.HIT] == 0:
        raise ResultError(f"{path}: has no hits, so there is nothing to show")
    _refuse(path, "a result", map_fault(dataset))


def _refuse(path: Path, what: str, fault: str | None) -> None:
    if fault is not None:
        raise ResultError(f"{path}: not {what} of warpimpact, or damaged: {fault}")


def is_history(dataset: xarray.Dataset) -> bool:
    """Whether a Dataset is the history of one hit, not a map of hits."""
    return v.TIME in dataset.variables


_MOST_PACKED = 2000
"""How many times its size a file may hold: zlib packs a thousand bytes into one at best."""


@contextmanager
def _netcdf(path: Path, wanted: str, *wanted_kinds: kinds.Kind) -> Iterator[xarray.Dataset]:
    """An open netCDF file of some kind; what the library finds damaged in it, now or when it is read, is told in a
    sentence."""
    kind = kind_of(path)
    told_later = kind is None and kinds.RESULT in wanted_kinds and kinds.is_netcdf(path)  # by what it lacks
    if kind not in wanted_kinds and not told_later:
        refuse_kind(path, kind, wanted)
    try:
        with readable(path):
            dataset = _joined(path)
        with dataset:
            needed, size = dataset.nbytes, path.stat().st_size
            if needed > 2**20 + _MOST_PACKED * size:
                raise ResultError(f"{path}: damaged: it has {size} bytes, but declares {needed} of data")
            if found := packing_fault(dataset):
                raise ResultError(f"{path}: damaged: {found}")
            yield dataset
    except RuntimeError as error:
        if not str(error).startswith("NetCDF"):
            raise
        raise ResultError(f"{path}: damaged, it cannot be read ({error})") from error


def kind_of(path: Path) -> kinds.Kind | None:
    """What a file is, by its contents; None of one that is nothing known.

    Raises:
        ResultError: it is missing, is no regular file, or is damaged.
    """
    try:
        check_file(path)
    except ValueError as error:
        raise ResultError(str(error)) from None
    with readable(path):
        return kinds.kind_of(path)


def refuse_kind(path: Path, kind: kinds.Kind | None, wanted: str) -> NoReturn:
    """Say what a file is that is not what is wanted.

    Raises:
        ResultError: always.
    """
    if kind is not None:
        raise ResultError(kinds.told(path, kind, wanted))
    if not kinds.is_netcdf(path):
        raise ResultError(f"{path}: cannot be read as a netCDF file")
    raise ResultError(f"{path}: not {wanted} of warpimpact")


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Tell what goes wrong in opening a file as a ResultError: one that was altered leads the libraries into errors of
    any class."""
    try:
        yield
    except Exception as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error


def _joined(path: Path) -> xarray.Dataset:
    """The root of a file with the contents of its groups as coordinates, and with room for some chunks of a variable
    instead of for tens of megabytes.

    Numbers of hits have no index, which would be in memory as a whole.
    """
    import xarray

    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * CHUNK, slots, preemption)
    try:
        root = xarray.open_dataset(path, engine="netcdf4", create_default_indexes=False)
    finally:
        netCDF4.set_chunk_cache(*kept)
    dataset = root.copy()
    with netCDF4.Dataset(path) as file:
        groups = [group for group in v.GROUPS if group in file.groups]
    for group in groups:
        with xarray.open_dataset(path, engine="netcdf4", group=group) as inner:
            dataset = dataset.assign_coords({name: array.variable for name, array in inner.load().data_vars.items()})
    for name in dataset.dims:
        if name != v.HIT and name in dataset.coords:
            dataset = dataset.set_xindex(str(name))
    dataset = in_memory(dataset)
    dataset.set_close(root.close)
    return dataset
