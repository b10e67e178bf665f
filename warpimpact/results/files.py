"""Result files: written whole or not at all, joined from parts, read and checked."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import netCDF4
import xarray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.checks import fault
from warpimpact.results.interrupts import uninterrupted


class OutputError(OSError):
    """A result file that cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file that cannot be read as a warpimpact result; the message is one sentence for the user."""


def write(dataset: xarray.Dataset, path: Path, *, named: Callable[[Path], Path] | None = None) -> None:
    """Write the Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Args:
        named: gives the name of what was written, by its contents, in place of `path`.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with uninterrupted(), aside(path, named=named) as file:
        dataset.to_netcdf(file, format="NETCDF4", engine="netcdf4", encoding=_encoding(dataset))


CHUNK = 2**15
"""Hits per chunk of a joined file: 256 KiB of one variable."""


def join(parts: Sequence[Path], path: Path, attributes: Mapping[str, Any]) -> None:
    """Write results one after the other into one file, whole or not at all, with one of them in memory at a time.

    Args:
        parts: results of the same campaign, in the order of their hits, on the disk of `path`.
        path: the file; an existing one is replaced.
        attributes: global attributes over those of the first part.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    hits = 0
    for part in parts:
        with netCDF4.Dataset(part) as source:
            hits += len(source.dimensions["hit"])
    with aside(path, parts[0].parent) as file:
        with uninterrupted():
            dataset = read(parts[0]).assign_attrs(attributes).drop_encoding()
            encoding = _encoding(dataset, chunk=min(hits, CHUNK))
            dataset.to_netcdf(file, format="NETCDF4", engine="netcdf4", encoding=encoding, unlimited_dims=["hit"])
        at = dataset.sizes["hit"]
        with netCDF4.Dataset(file, "a") as joined:
            joined.set_auto_maskandscale(False)
            for variable in joined.variables.values():
                if variable.chunking() != "contiguous":  # of the megabytes that a variable may keep, two chunks will do
                    variable.set_var_chunk_cache(size=2 * math.prod(variable.chunking()) * variable.dtype.itemsize)
            for part in parts[1:]:
                at = _append(joined, part, at)


def _append(joined: Any, part: Path, at: int) -> int:
    """Copy the hits of a part behind those that are there; returns how many there are then."""
    with netCDF4.Dataset(part) as source:
        source.set_auto_maskandscale(False)
        end = at + len(source.dimensions["hit"])
        for name, variable in joined.variables.items():
            if "hit" in variable.dimensions:
                variable[at:end] = source[name][:]
    return end


def _encoding(dataset: xarray.Dataset, *, chunk: int | None = None) -> dict[str, dict[str, Any]]:
    """How variables are stored: compressed, and with `chunk` hits per chunk if that is given."""
    encoding: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1}
        for name, array in dataset.variables.items()
        if array.dtype.kind in "if"  # netCDF compresses no strings
    }
    for name in dataset.coords:
        encoding.setdefault(str(name), {})["_FillValue"] = None  # CF: a coordinate has no missing values
    for name, array in dataset.variables.items():
        if chunk and "hit" in array.dims:
            encoding[str(name)]["chunksizes"] = (chunk, *array.shape[1:])
    return encoding


@contextmanager
def aside(path: Path, folder: Path | None = None, *, named: Callable[[Path], Path] | None = None) -> Iterator[Path]:
    """A name in a folder of the same disk, if not given that of `path`, to write to; what was written there is on the
    disk before it gets its own name, which is `path` or, where there is `named`, what that makes of the file.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    written = (folder or path.parent) / f".{path.name}.{os.getpid()}.part"
    try:
        yield written
        _flush(written, os.O_RDWR)
        os.replace(written, named(written) if named else path)
        if os.name == "posix":  # elsewhere a folder cannot be opened, and needs no flushing
            _flush(path.parent, os.O_RDONLY)
    except (OSError, RuntimeError) as error:  # netCDF reports a full disk as RuntimeError
        raise OutputError(f"{path}: cannot be written ({_cause(error, path)})") from error
    finally:
        with suppress(OSError):
            written.unlink()


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
        return file.load()


@contextmanager
def opened(path: Path) -> Iterator[xarray.Dataset]:
    """A result file of which only what is used is read.

    Raises:
        ResultError: as in `read`.
    """
    with opened_either(path) as dataset:
        if is_history(dataset):
            raise ResultError(f"{path}: is the history of a single hit, not a map of hits")
        yield dataset


@contextmanager
def opened_either(path: Path) -> Iterator[xarray.Dataset]:
    """A result file, or the history of one of its hits, of which only what is used is read.

    Raises:
        ResultError: The file is missing, is not netCDF, or is neither.
    """
    with _netcdf(path) as dataset:
        missing = {*v.COORDINATES, *v.VARIABLES} - dataset.variables.keys()
        if missing:
            raise ResultError(f'{path}: not a warpimpact result, it has no variable "{min(missing)}"')
        if attr.PLATE_PERIOD not in dataset.attrs:
            raise ResultError(f'{path}: not a warpimpact result, it has no attribute "{attr.PLATE_PERIOD}"')
        if not is_history(dataset):
            optional = (
                *v.SCATTER_VARIABLES,
                *v.BURST_VARIABLES,
                *v.ESTIMATE_VARIABLES,
                *v.LAYER_VARIABLES,
                *v.LAYER_FACES,
            )
            _check(dataset, path, (*v.COORDINATES, *v.VARIABLES, *optional))
        yield dataset


def read_study(path: Path) -> xarray.Dataset:
    """Read a study of speed and accuracy into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not a study.
    """
    with _netcdf(path) as dataset:
        missing = {*v.STUDY_COORDINATES, *v.STUDY_VARIABLES} - dataset.variables.keys()
        if missing:
            raise ResultError(f'{path}: not a study of warpimpact, it has no variable "{min(missing)}"')
        _check(dataset, path, (*v.STUDY_COORDINATES, *v.STUDY_VARIABLES))
        return dataset.load()


def _check(dataset: xarray.Dataset, path: Path, known: Collection[v.Variable]) -> None:
    if 0 in dataset.sizes.values() and dataset.sizes.get("hit") == 0:
        raise ResultError(f"{path}: not a result of warpimpact, it has no hits")
    if found := fault(dataset, known):
        raise ResultError(f"{path}: not a result of warpimpact, or damaged: {found}")


def is_history(dataset: xarray.Dataset) -> bool:
    """Whether a Dataset is the history of one hit, not a map of hits."""
    return "hit" not in dataset.sizes


_MOST_PACKED = 2000
"""How many times its size a file may hold: zlib packs a thousand bytes into one at best."""


@contextmanager
def _netcdf(path: Path) -> Iterator[xarray.Dataset]:
    """An open netCDF file; what the library finds damaged in it, now or when it is read, is told in a sentence."""
    try:
        with _opened(path) as dataset:
            needed, size = dataset.nbytes, path.stat().st_size
            if needed > 2**20 + _MOST_PACKED * size:
                raise ResultError(f"{path}: damaged: it has {size} bytes, but declares {needed} of data")
            yield dataset
    except RuntimeError as error:
        if not str(error).startswith("NetCDF"):
            raise
        raise ResultError(f"{path}: damaged, it cannot be read ({error})") from error


def _opened(path: Path) -> xarray.Dataset:
    """An open netCDF file, with room for some chunks of a variable instead of for tens of megabytes."""
    if not path.is_file():  # a pipe or a device may have no end
        raise ResultError(f"{path}: cannot be read (it {'is no file' if path.exists() else 'is not there'})")
    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * CHUNK, slots, preemption)
    try:
        return xarray.open_dataset(path, engine="netcdf4")
    except Exception as error:  # a file that was altered leads xarray into errors of any class
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error
    finally:
        netCDF4.set_chunk_cache(*kept)
