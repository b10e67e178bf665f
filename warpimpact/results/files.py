"""Result files: written whole or not at all, joined from parts, read and checked."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Collection, Hashable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import netCDF4

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.kinds import HIT_MAP, KINDS, SWEEP, Kind, text_kind
from warpimpact.results.layers import in_a_file, in_memory
from warpimpact.results.netcdf import FILE_CHUNK, write_table
from warpimpact.results.references import NAMES, references_of, with_references
from warpimpact.results.table import HitTable
from warpimpact.scene.input_files import check_file, parsed, read_text

if TYPE_CHECKING:
    import xarray


class OutputError(OSError):
    """A result file cannot be written; the message is one sentence for the user."""


class ResultError(ValueError):
    """A file cannot be read as a warpimpact result; the message is one sentence for the user."""


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the Dataset, with its references, to a netCDF file, whole or not at all; an existing file is replaced.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    with aside(path) as file:
        references = {name: HitTable.from_xarray(of_reference) for name, of_reference in references_of(dataset).items()}
        write_table(in_a_file(HitTable.from_xarray(dataset)), file, references=references)


@contextmanager
def aside(path: Path, folder: Path | None = None, *, named: Callable[[Path], Path] | None = None) -> Iterator[Path]:
    """A temporary path on the same disk to write to. After the block the file is flushed and renamed to `path`, or to
    `named(file)` if that is given. `folder` is where the temporary file lies; by default that of `path`.

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
    except OutputError:
        raise
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
    """The cause of an error of the disk in words: netCDF does not say that the disk is full."""
    is_full = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
    with suppress(OSError):
        is_full = is_full or shutil.disk_usage(path.parent).free < 2**16
    return "the disk is full" if is_full else getattr(error, "strerror", None) or str(error)


def read(path: Path, kind: Kind = HIT_MAP) -> xarray.Dataset:
    """Read a file of a kind into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not of this kind.
    """
    with opened(path, kind) as dataset, readable(path):
        loaded = dataset.load()
    return loaded.set_xindex(v.HIT) if kind in (HIT_MAP, SWEEP) else loaded


def open_result(path: str | Path, group: str | None = None) -> xarray.Dataset:
    """Open a result file. Values are read when they are used. ``with open_result(path) as result:`` closes the file.

    Args:
        path: a file of ``warpimpact run``, of `run_to_file`, or of ``to_netcdf`` of a result.
        group: "solid" or "base_alone", for the result of that reference.

    Returns:
        The Dataset of `run`, one entry per hit.

    Raises:
        ResultError: the file is missing, is not netCDF, or is not a warpimpact result.
    """
    dataset = _open(Path(path), HIT_MAP, group=group)
    result = dataset.set_xindex(v.HIT)
    result.set_close(dataset.close)
    return result


@contextmanager
def opened(path: Path, *kinds: Kind) -> Iterator[xarray.Dataset]:
    """Open a file of one of these kinds (by default a map of hits). Values are read when they are used.

    Damage that the library finds, now or when values are read, is raised as a sentence.

    Raises:
        ResultError: The file is missing, is not netCDF, or is of no such kind.
    """
    try:
        with _open(path, *(kinds or (HIT_MAP,))) as dataset:
            yield dataset
    except RuntimeError as error:
        if not str(error).startswith("NetCDF"):
            raise
        raise ResultError(f"{path}: damaged, it cannot be read ({error})") from error


def _open(path: Path, *kinds: Kind, group: str | None = None) -> xarray.Dataset:
    kind = check_kind(path, *kinds)
    with readable(path):
        dataset = _joined(path) if group is None else _part(path, group)
    if group is not None:
        return dataset
    try:
        _check_needed(path, {*dataset.variables, *dataset.attrs}, kind)
        if kind is HIT_MAP:
            _check_hits(path, dataset)
    except ResultError:
        dataset.close()
        raise
    return dataset


def _check_needed(path: Path, there: Collection[Hashable], kind: Kind) -> None:
    if missing := [name for name in kind.needed if name not in there]:
        raise ResultError(f'{path}: is no whole file of {kind.name}, it has no "{missing[0]}"')


def _check_hits(path: Path, dataset: xarray.Dataset) -> None:
    """Refuse hits that were chosen from a result in a way that no command can use."""
    for dim, what, example in ((v.HIT, "hit", "isel(hit=[5])"), (v.STANDOFF, "stand-off", "isel(standoff=[0])")):
        if dim not in dataset.sizes:
            raise ResultError(
                f"{path}: holds one {what} without its dimension; choose {what}s as a list, as in {example}"
            )
    status = dataset[v.STATUS]
    if status.dtype.kind == "f" and bool(status.isnull().any()):
        raise ResultError(
            f"{path}: has hits without a status, as where(...) leaves them; choose hits with where(..., drop=True)"
        )
    if not dataset.sizes[v.HIT]:
        raise ResultError(f"{path}: has no hits, so there is nothing to show")


def is_history(dataset: xarray.Dataset) -> bool:
    """Whether a Dataset is the history of one hit, not a map of hits."""
    return v.TIME in dataset.variables


def is_netcdf(path: Path) -> bool:
    """Whether a regular file begins as netCDF files do."""
    with path.open("rb") as file:
        return file.read(4).startswith((b"\x89HDF", b"CDF"))


def kind_of(path: Path) -> Kind:
    """The kind of a netCDF file.

    Raises:
        ResultError: the file is missing, is no regular file, is damaged, or is no netCDF file of this version of
            warpimpact; a TOML file is named as what it is.
    """
    try:
        check_file(path)
    except ValueError as error:
        raise ResultError(str(error)) from None
    if not is_netcdf(path):
        try:
            name, use = text_kind(parsed(read_text(path), path.name))
        except ValueError:
            name = use = ""
        raise ResultError(
            f"{path}: " + (f"is {name}, not a result; {use}" if name else "cannot be read as a netCDF file")
        )
    with readable(path), netCDF4.Dataset(path) as file:
        mark = str(file.getncattr(attr.KIND)) if attr.KIND in file.ncattrs() else ""
        is_point = v.STATUS in file.variables and file.variables[v.STATUS].dimensions == (v.HIT,)
    if not mark:
        raise ResultError(
            f'{path}: is no file of this version of warpimpact, it has no attribute "{attr.KIND}"; if it was chosen '
            "from a result, keep the attributes"
        )
    kind = next((kind for kind in KINDS if kind.mark == mark), None)
    if kind is None:
        raise ResultError(
            f'{path}: is "{mark}", but this version of warpimpact reads {", ".join(kind.mark for kind in KINDS)}'
        )
    return HIT_MAP if kind is SWEEP and is_point else kind


def check_kind(path: Path, *wanted: Kind) -> Kind:
    """The kind of a file, if it is one of the wanted ones.

    Raises:
        ResultError: the file is missing, is damaged, or is of another kind.
    """
    kind = kind_of(path)
    if kind not in wanted:
        raise ResultError(f"{path}: is {kind.name}, as {kind.maker} writes, not {wanted[0].name}; {kind.use}")
    return kind


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise errors of opening a file as a ResultError. An altered file leads the libraries into errors of any class."""
    try:
        yield
    except Exception as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error


def _joined(path: Path) -> xarray.Dataset:
    """The root of a file with its references, and with the contents of its other groups as coordinates."""
    import xarray

    root = _part(path)
    dataset = root.copy()
    with netCDF4.Dataset(path) as file:
        groups = list(file.groups)
    for group in v.GROUPS.keys() & {*groups}:
        with xarray.open_dataset(path, engine="netcdf4", group=group) as inner:
            dataset = dataset.assign_coords({name: array.variable for name, array in inner.load().data_vars.items()})
    references = dict[str, xarray.Dataset]()
    for name in {*NAMES} & {*groups}:
        with _part(path, name) as inner:  # a file that stays open until Python collects it crashes netCDF
            references[name] = inner.load()
    dataset = with_references(in_memory(dataset), references)
    dataset.set_close(root.close)
    return dataset


def _part(path: Path, group: str | None = None) -> xarray.Dataset:
    """The root or a group of a file. The cache has room for some chunks per variable instead of tens of megabytes.

    Numbers of hits have no index, because the whole index would be in memory.
    """
    import xarray

    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * FILE_CHUNK, slots, preemption)
    try:
        root = xarray.open_dataset(path, engine="netcdf4", group=group, create_default_indexes=False)
    finally:
        netCDF4.set_chunk_cache(*kept)
    dataset = root.copy()  # its `close` is another one
    for name in root.dims:
        if name != v.HIT and name in root.coords:
            dataset = dataset.set_xindex(str(name))
    dataset.set_close(root.close)
    return dataset
