"""Result files: written whole or not at all, joined from parts, read and checked."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import netCDF4

from warpimpact.results import kinds
from warpimpact.results import variables as v
from warpimpact.results.checks import RESULT, SWEEP, packing_fault
from warpimpact.results.interrupts import uninterrupted
from warpimpact.results.kind import Kind
from warpimpact.results.netcdf import write_table
from warpimpact.results.outlines import in_a_file, in_memory
from warpimpact.results.table import HitTable
from warpimpact.scene.input_files import check_file

if TYPE_CHECKING:
    import xarray


class OutputError(OSError):
    """A result file cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file cannot be read as a warpimpact result; the message is one sentence for the user."""


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path) as file:
        write_table(in_a_file(HitTable.from_xarray(dataset)), file)


FILE_CHUNK = 2**15
"""Hits per chunk of a joined file: 256 KiB of one variable."""


@contextmanager
def aside(path: Path, folder: Path | None = None, *, named: Callable[[Path], Path] | None = None) -> Iterator[Path]:
    """A temporary path on the same disk to write to. After the block the file is flushed and renamed to `path`, or to
    `named(file)` if that is given. `folder` is where the temporary file lies; by default that of `path`.

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
    """Raise errors of writing as an OutputError about this file."""
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
    """The cause of an error of the disk in words: netCDF does not say that the disk is full."""
    with suppress(OSError):
        if isinstance(error, RuntimeError) and shutil.disk_usage(path.parent).free < 2**20:
            return "the disk is full"
    return str(error)


def write_tree(tree: xarray.DataTree, path: Path) -> None:
    """Write a tree of Datasets, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path) as file:
        tree.to_netcdf(file, engine="netcdf4", format="NETCDF4")


def read(path: Path, kind: Kind = RESULT) -> xarray.Dataset:
    """Read a file of a kind into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not of this kind.
    """
    with uninterrupted(), opened(path, kind) as dataset:
        loaded = dataset.load()
    return loaded.set_xindex(v.HIT) if kind in (RESULT, SWEEP) else loaded


def read_tree(path: Path, kind: Kind) -> xarray.DataTree:
    """Read a file of groups into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not of this kind.
    """
    check_kind(path, kind)
    with uninterrupted(), readable(path):
        tree = _loaded(path)
    if (mistake := kind.mistake(tree)) is not None:
        raise ResultError(f"{path}: {mistake}")
    return tree


def open_result(path: str | Path) -> xarray.Dataset:
    """Open a result file. Values are read when they are used. ``with open_result(path) as result:`` closes the file.

    Args:
        path: a file of ``warpimpact run``, of `run_to_file`, or of ``to_netcdf`` of a result.

    Returns:
        The Dataset of `run`, one entry per hit.

    Raises:
        ResultError: the file is missing, is not netCDF, or is not a warpimpact result.
    """
    with opened(Path(path)):
        pass  # the file is checked here; the one that is returned stays open
    dataset = _joined(Path(path))
    result = dataset.set_xindex(v.HIT)
    result.set_close(dataset.close)
    return result


@contextmanager
def opened(path: Path, *kinds_allowed: Kind) -> Iterator[xarray.Dataset]:
    """Open a file of one of these kinds (by default a map of hits). Values are read when they are used.

    Damage that the library finds, now or when values are read, is raised as a sentence.

    Raises:
        ResultError: The file is missing, is not netCDF, or is of no such kind.
    """
    kind = check_kind(path, *(kinds_allowed or (RESULT,)))
    try:
        with readable(path):
            dataset = _joined(path)
        with dataset:
            needed, size = dataset.nbytes, path.stat().st_size
            if needed > 2**20 + _MOST_PACKED * size:
                raise ResultError(f"{path}: damaged: it has {size} bytes, but declares {needed} of data")
            if fault := packing_fault(dataset):
                raise ResultError(f"{path}: damaged: {fault}")
            if (mistake := kind.mistake(dataset)) is not None:
                raise ResultError(f"{path}: {mistake}")
            yield dataset
    except RuntimeError as error:
        if not str(error).startswith("NetCDF"):
            raise
        raise ResultError(f"{path}: damaged, it cannot be read ({error})") from error


def is_history(dataset: xarray.Dataset) -> bool:
    """Whether a Dataset is the history of one hit, not a map of hits."""
    return v.TIME in dataset.variables


_MOST_PACKED = 2000
"""Largest ratio of the contents of a file to its size: zlib packs a thousand bytes into one at best."""


def kind_of(path: Path) -> Kind | None:
    """The kind of a file, by its contents; None if it is no known kind.

    Raises:
        ResultError: the file is missing, is no regular file, or is damaged.
    """
    try:
        check_file(path)
    except ValueError as error:
        raise ResultError(str(error)) from None
    with readable(path):
        return kinds.kind_of(path)


def check_kind(path: Path, *wanted: Kind) -> Kind:
    """The kind of a file, if it is one of the wanted ones. A file without a recognised kind counts as a map of hits,
    whose reader says what it lacks.

    Raises:
        ResultError: the file is missing, is damaged, or is of another kind.
    """
    kind = kind_of(path)
    for allowed in wanted:
        if kind is not None and kind.name == allowed.name:
            return allowed
    if kind is not None:
        raise ResultError(kind.told(path, wanted[0].name))
    if not kinds.is_netcdf(path):
        raise ResultError(f"{path}: cannot be read as a netCDF file")
    if RESULT in wanted:
        return RESULT
    raise ResultError(f"{path}: not {wanted[0].name} of warpimpact")


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise errors of opening a file as a ResultError. An altered file leads the libraries into errors of any class."""
    try:
        yield
    except Exception as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error


def _joined(path: Path) -> xarray.Dataset:
    """The root of a file with the contents of its groups as coordinates. The cache has room for some chunks per
    variable instead of tens of megabytes.

    Numbers of hits have no index, because the whole index would be in memory.
    """
    import xarray

    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * FILE_CHUNK, slots, preemption)
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


def _loaded(path: Path) -> xarray.DataTree:
    """The groups of a file in memory, read one after the other.

    Each group is closed before the next one is opened. Python would close an open tree when it collects it, in the
    middle of another access, which crashes netCDF.
    """
    import xarray

    with netCDF4.Dataset(path) as file:
        names = list(file.groups)
    groups = {name: xarray.load_dataset(path, group=name, engine="netcdf4") for name in names}
    return xarray.DataTree.from_dict({"/": xarray.load_dataset(path, engine="netcdf4"), **groups})
