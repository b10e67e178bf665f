"""Result files: written whole or not at all, appended from chunks, read and checked."""

from __future__ import annotations

import errno
import itertools
import json
import math
import os
import shutil
import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray

from warpimpact.errors import OutputError, ResultError
from warpimpact.measures.references import Node, Result, as_dataset, as_tree, nodes_of, with_nodes
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import HIT_MAP, KINDS, SWEEP, Kind, text_kind
from warpimpact.scene.input_files import check_file, is_netcdf, parsed, read_text

FILE_CHUNK = 2**15
"""Most hits per chunk of a variable in a file: 256 KiB."""
_CHUNK_BYTES = 2**22
"""Most memory of a chunk: that of some pictures."""
_NODE_PART = 2**12
"""Hits of a node that are written at a time."""
_IN_NETCDF = threading.RLock()


def write(
    chunks: Result | Iterable[xarray.Dataset],
    path: Path,
    *,
    attributes: Mapping[str, Any] | None = None,
    references: Mapping[str, xarray.Dataset] | None = None,
    nodes: Mapping[str, Iterable[xarray.Dataset]] | None = None,
) -> None:
    """Write a result or a Dataset to a netCDF file, whole or not at all; an existing file is replaced.

    Args:
        chunks: the result, with its nodes; or Datasets of consecutive hits, which become one; one of them at a time is
            in memory.
        attributes: global attributes, which replace those of the first one.
        references: as in `with_references`, beside chunks.
        nodes: chunks of further nodes, by their paths, such as "draws".

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    tree = as_tree(chunks) if isinstance(chunks, xarray.DataTree | xarray.Dataset) else xarray.DataTree()
    parts = iter([as_dataset(chunks)] if isinstance(chunks, xarray.DataTree | xarray.Dataset) else chunks)
    first = next(parts)
    with delay_interrupts(), atomic_path(path) as file:
        _write_parts(itertools.chain([first.assign_attrs(attributes or {})], parts), file)
        for name, node in nodes_of(tree).items():
            _write_parts(iter([node]), file, name)
        for name, reference in (references or {}).items():
            with xarray.open_dataset(file, engine="netcdf4", create_default_indexes=False) as dataset:
                node_parts = Node.of(dataset, name, reference).parts(_NODE_PART)
            _write_parts(node_parts, file, name)
        for path_in_file, of in (nodes or {}).items():
            _write_parts(iter(of), file, path_in_file)


def _write_parts(parts: Iterator[xarray.Dataset], file: Path, group: str | None = None) -> None:
    """Write Datasets of consecutive hits one after the other into a group of a file, by default a new file."""
    first, second = next(parts), next(parts, None)
    unlimited = [] if second is None else [v.HIT]
    encoding = _encoding(first, FILE_CHUNK if unlimited else 0)
    mode: Any = "w" if group is None else "a"
    described = with_meanings(first)
    described.to_netcdf(file, mode=mode, engine="netcdf4", group=group, encoding=encoding, unlimited_dims=unlimited)
    if second is None:
        return
    with netCDF4.Dataset(file, "a") as opened:
        target = opened[group] if group else opened
        target.set_auto_maskandscale(False)
        for stored in target.variables.values():
            if stored.chunking() != "contiguous":  # the cache of a variable has megabytes by default
                two_chunks = 2 * math.prod(stored.chunking()) * stored.dtype.itemsize
                stored.set_var_chunk_cache(size=two_chunks)
        for part in itertools.chain([second], parts):
            done = target.dimensions[v.HIT].size
            for name, column in part.variables.items():
                if v.HIT in column.dims:
                    missing = column.encoding.get("_FillValue")
                    values = column.values if missing is None else np.where(np.isnan(column), missing, column)
                    target[str(name)][done : done + len(values)] = values.astype(target[str(name)].dtype)


def with_meanings(dataset: xarray.Dataset) -> xarray.Dataset:
    """A Dataset with an attribute on the units and flags that it has now, in which its numbers will be read."""
    return dataset.assign_attrs({attr.MEANINGS: json.dumps(_meanings(dataset), sort_keys=True)})


def _meanings(dataset: xarray.Dataset) -> dict[str, str]:
    """Attributes that say what numbers mean, by their places; xarray puts units of times into the encoding."""
    places = {name: value for name, value in dataset.attrs.items() if name.endswith("_units")}
    for name, of in dataset.variables.items():
        known = of.encoding | of.attrs
        places |= {f"{name}.{key}": known[key] for key in ("units", "flag_values", "flag_meanings") if key in known}
    return {place: str(value) for place, value in places.items()}


def _check_meanings(path: Path, dataset: xarray.Dataset) -> None:
    """Refuse numbers whose units or flags were changed after they were written."""
    written, now = json.loads(dataset.attrs.get(attr.MEANINGS, "{}")), _meanings(dataset)
    for place, value in written.items():
        if now.get(place, value) != value:
            raise ResultError(
                f'{path}: {place} is "{now[place]}", but its numbers are read as "{value}"; put the attribute back'
            )


def _encoding(dataset: xarray.Dataset, chunk: int = 0) -> dict[Any, dict[str, Any]]:
    """Compression of a Dataset, with chunks of so many hits; 0 stands for all hits, FILE_CHUNK at most."""
    encoding: dict[Any, dict[str, Any]] = {}
    for name, column in dataset.variables.items():
        encoding[name] = {"_FillValue": None} if name in dataset.coords else {}  # CF: a coordinate misses no value
        if column.dtype.kind == "f" and np.dtype(column.encoding.get("dtype", float)).kind == "i":
            stored = ("dtype", "scale_factor", "_FillValue")
            encoding[name] |= {key: column.encoding[key] for key in stored if key in column.encoding}
        if column.ndim and column.size and column.dtype.kind in "ifb":
            encoding[name] |= {"zlib": True, "complevel": 1}
            hits = chunk if chunk and column.dims[0] == v.HIT else min(FILE_CHUNK, column.shape[0])
            most = max(1, _CHUNK_BYTES // (column.dtype.itemsize * math.prod(column.shape[1:])))
            encoding[name]["chunksizes"] = (min(hits, most), *column.shape[1:])
    return encoding


@contextmanager
def delay_interrupts() -> Iterator[None]:
    """Raise interrupts by signals when the block has ended, and let one thread at a time into such blocks.

    Amid a call they could leave a lock of xarray taken for ever. netCDF crashes in two threads at once.
    """
    arrived: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # no other one is interrupted
        handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    try:
        for number in handlers:
            signal.signal(number, lambda number, frame: arrived.append(number))
        with _IN_NETCDF:
            yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in arrived:
            handlers[number](number, None)


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path next to `path`. After the block the file is flushed and renamed to it.

    Where `path` is a symbolic link, the file that it leads to is written, and the link stays.

    Raises:
        OutputError: The file cannot be written; what was there before is untouched.
    """
    target, written = _places(path)
    try:
        yield written
        _flush(written, os.O_RDWR)
        os.replace(written, target)
        if os.name == "posix":  # elsewhere a folder cannot be opened, and needs no flushing
            _flush(target.parent, os.O_RDONLY)
    except OutputError:
        raise
    except (OSError, RuntimeError) as error:  # netCDF reports a full disk as RuntimeError
        is_full = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
        with suppress(OSError):  # netCDF does not say that the disk is full
            is_full = is_full or shutil.disk_usage(path.parent).free < 2**16
        cause = "the disk is full" if is_full else getattr(error, "strerror", None) or str(error)
        raise OutputError(f"{path}: cannot be written ({cause})") from error
    finally:
        with suppress(OSError):
            written.unlink()


def _places(path: Path) -> tuple[Path, Path]:
    """The file that a path leads to, and the one that is written and renamed to it.

    Raises:
        OutputError: the path leads to a folder or a device, whose place a renamed file would take.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise OutputError(f"{path}: is a folder or a device, but the output is one file")
    return target, target.parent / f".{target.name}.{os.getpid()}.part"


def check_writable(path: Path) -> None:
    """Refuse, before anything is computed, a file that `atomic_path` could not write.

    Raises:
        OutputError: as of `atomic_path`.
    """
    _, written = _places(path)
    try:
        written.touch()
        written.unlink()
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None


def _flush(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read(path: Path, kind: Kind = HIT_MAP) -> xarray.DataTree:
    """Read a file of a kind into memory.

    Raises:
        ResultError: The file is missing, is not netCDF, or is not of this kind.
    """
    with opened(path, kind) as tree:
        loaded = tree.load()
    return _indexed(loaded) if kind in (HIT_MAP, SWEEP) else loaded


def open_result(path: str | Path) -> xarray.DataTree:
    """Open a result file. Values are read when they are used. ``with open_result(path) as result:`` closes the file.

    Args:
        path: a file of ``warpimpact run``, of `run_to_file`, or of ``to_netcdf`` of a result.

    Returns:
        The result as `run` gives it, one entry per hit.

    Raises:
        ResultError: the file is missing, is not netCDF, or is not a warpimpact result.
    """
    return _indexed(_open(Path(path), HIT_MAP))


def _indexed(tree: xarray.DataTree) -> xarray.DataTree:
    """A result whose hits are found by their numbers."""
    return _with_map(tree, tree.to_dataset().set_xindex(v.HIT))


@contextmanager
def opened(path: Path, *kinds: Kind) -> Iterator[xarray.DataTree]:
    """Open a file of one of these kinds (by default a map of hits). Values are read when they are used.

    Raises:
        ResultError: The file is missing, is damaged, or is of no such kind.
    """
    try:
        with _open(path, *(kinds or (HIT_MAP,))) as tree:
            yield tree
    except RuntimeError as error:
        if not str(error).startswith("NetCDF"):  # netCDF4 has no error of its own for values that it cannot read
            raise
        raise ResultError(f"{path}: damaged, it cannot be read ({error})") from error


def _open(path: Path, *kinds: Kind) -> xarray.DataTree:
    if (kind := kind_of(path)) not in kinds:
        raise ResultError(f"{path}: is {kind.name}, as {kind.maker} writes, not {kinds[0].name}; {kind.use}")
    with _readable(path), ExitStack() as parts:
        whole = _tree(path)
        parts.callback(whole.close)
        for node in whole.subtree:
            _check_meanings(path, node.to_dataset(inherit=False))
        dataset = whole.to_dataset()
        if kind is HIT_MAP and attr.PLATE_PERIOD in dataset.variables:  # a point of a sweep of periods
            period = dataset[attr.PLATE_PERIOD].values
            dataset = dataset.drop_vars(attr.PLATE_PERIOD).assign_attrs({attr.PLATE_PERIOD: period})
        there = {*dataset.variables, *dataset.attrs}
        if missing := [name for name in kind.needed if name not in there]:
            raise ResultError(f'{path}: is no whole file of {kind.name}, it has no "{missing[0]}"')
        if kind is HIT_MAP and not dataset.sizes.get(v.HIT):
            raise ResultError(f'{path}: has no hits along "hit"; choose hits as a list, as in isel(hit=[5])')
        for name in dataset.dims:
            if name != v.HIT and name in dataset.coords:
                dataset = dataset.set_xindex(str(name))
        parts.pop_all()
    return _with_map(whole, dataset)


def _with_map(tree: xarray.DataTree, dataset: xarray.Dataset) -> xarray.DataTree:
    """An opened result with its map in another form, which closes its file."""
    other = with_nodes(dataset, nodes_of(tree))
    other.set_close(tree.close)
    return other


def kind_of(path: Path) -> Kind:
    """The kind of a netCDF file.

    Raises:
        ResultError: the file is missing, is damaged, or is no netCDF file of this version of warpimpact; a TOML file is
            named as what it is.
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
    # By xarray, because netCDF crashes where both have handles of a file with groups.
    with _readable(path), xarray.open_dataset(path, decode_cf=False, create_default_indexes=False) as file:
        mark = str(file.attrs.get(attr.KIND, ""))
        is_point = v.STATUS in file.variables and file[v.STATUS].dims == (v.HIT,)
    kind = next((kind for kind in KINDS if kind.mark == mark), None)
    if kind is None and mark.rpartition(" ")[0] in {one.mark.rpartition(" ")[0] for one in KINDS}:
        raise ResultError(f'{path}: was written by another version of warpimpact ("{mark}"); compute it again')
    if kind is None:
        why = f'its attribute "{attr.KIND}" is "{mark}"' if mark else f'it has no attribute "{attr.KIND}"'
        known = ", ".join(kind.mark for kind in KINDS)
        raise ResultError(f"{path}: is no file of this version of warpimpact: {why}; this version reads {known}")
    return HIT_MAP if kind is SWEEP and is_point else kind


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Raise errors of opening a file as a ResultError."""
    try:
        yield
    except ResultError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise ResultError(f"{path}: cannot be read as a netCDF file ({str(error)[:200]})") from error


def _tree(path: Path) -> xarray.DataTree:
    """The root and the groups of a file, by one handle, with a cache of some chunks per variable instead of tens of
    megabytes.

    Numbers of hits have no index, because the whole index would be in memory. With a handle for each group, netCDF
    crashes when Python collects them.
    """
    _, slots, preemption = kept = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * 8 * FILE_CHUNK, slots, preemption)
    try:
        return xarray.open_datatree(path, engine="netcdf4", create_default_indexes=False)
    finally:
        netCDF4.set_chunk_cache(*kept)
