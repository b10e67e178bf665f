"""Chunks of an unfinished computation: a folder beside the result file, or memory.

Beside RESULT.nc the folder RESULT.nc.parts holds chunks as netCDF files, and a manifest of everything that determines
the bits of the result. A file is written under another name, flushed and renamed, so a file with its final name is
whole. Its name has a checksum; a chunk with another one is computed again. A lock keeps a second process away.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray
from filelock import FileLock, Timeout

from warpimpact.errors import FileExists, Interrupted, OutputError
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.runs.compute import digest, first_difference

_CLASSIC = ("i1", "i2", "i4", "f4", "f8", "b1")
"""Types that a netCDF-3 file has, or for which xarray has a code there."""
HELD_SECONDS, HELD_BYTES = 2.0, 2**26
"""Longest time for which chunks are only in memory, and most bytes that are kept there. A shorter computation writes
none."""


def folder_of(output: Path) -> Path:
    """Folder with the chunks of a result file."""
    return output.with_name(f"{output.name}.parts")


def is_begun(output: Path) -> bool:
    """Whether a computation of a result file has left anything on the disk, complete or not."""
    return output.exists() or folder_of(output).exists()


@contextmanager
def open_chunks(
    output: Path | None,
    content: Mapping[str, Any],
    *,
    resume: bool = False,
    overwrite: bool = False,
    warn: Callable[[str], object] = warnings.warn,
) -> Iterator[Chunks | None]:
    """The chunks of a computation while it runs; None if its result is already complete.

    The block writes the result file, with the fingerprint of the chunks; then they are removed. If it ends before, they
    can be resumed. Arguments and errors are those of `run_to_file`.

    Args:
        output: the result file; None keeps the chunks in memory.
        content: what determines the bits of the result.
    """
    chunks = Chunks(output, content)
    if output is None:
        yield chunks
        return
    folder = folder_of(output)
    lock, begun = FileLock(folder / "lock", timeout=0), False
    try:
        folder.mkdir(exist_ok=True)
        lock.acquire()
    except Timeout:
        raise OutputError(f"{output}: another run is writing it; wait for its end or name another file") from None
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None
    try:
        files.check_writable(output)
        begun = chunks.begin(output, resume=resume, overwrite=overwrite, warn=warn)
        yield chunks if begun else None
        chunks.discard()
    except BaseException as error:
        if not begun:
            raise
        saved = chunks.keep()
        if isinstance(error, OutputError | Interrupted):
            error.saved = saved
        elif isinstance(error, KeyboardInterrupt):
            raise Interrupted(str(error) or "interrupted", saved=saved) from None
        raise
    finally:
        with suppress(OSError):  # the folder holds what can be resumed
            (folder / "lock").unlink(missing_ok=True)
            folder.rmdir()
        lock.release()


class Chunks:
    """Datasets by their numbers, in memory and in a folder that is locked.

    Attributes:
        fingerprint: short hash of the content. Results with the same hash have the same bits.
    """

    def __init__(self, output: Path | None, content: Mapping[str, Any]) -> None:
        self._content = json.loads(json.dumps(content))
        self.fingerprint = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
        self._folder, self._on_disk = folder_of(output or Path("memory")), output is not None
        self._saved, self._held, self._written = dict[int, Path](), dict[int, xarray.Dataset](), time.monotonic()
        self._bytes = 0  # of those in memory

    def begin(self, output: Path, *, resume: bool, overwrite: bool, warn: Callable[[str], object]) -> bool:
        """Take the folder, with its chunks if they are to be resumed; whether anything is left to compute."""
        folder, is_complete, begun = self._folder, False, dict[str, Any]()
        with suppress(OSError, RuntimeError), netCDF4.Dataset(output) as file:
            is_complete = getattr(file, attr.FINGERPRINT, None) == self.fingerprint
        if is_complete and resume:
            return False
        if any(folder.glob("[cm]*")) and not (is_complete or overwrite):
            if not resume:
                how = "continue it with --resume or begin anew with --overwrite"
                raise OutputError(f"{folder}: contains an unfinished computation; {how}")
            with suppress(OSError, TypeError, ValueError):
                begun = dict(json.loads((folder / "manifest.json").read_bytes()))
            if not begun:
                raise OutputError(f"{folder}/manifest.json: is missing or damaged; begin anew with --overwrite")
        replaces = overwrite or begun.pop("replaces", False)
        if begun and (difference := first_difference(begun, self._content)):
            changed = "{} was {} and is {}".format(*difference)
            raise OutputError(f"{folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite")
        if output.exists() and not replaces:
            other = ", and --resume adds no hits to what is complete" if resume else ""
            raise FileExists(f"{output}: exists already{other}; name another file or give --overwrite")
        if not begun:
            self.discard()
            with files.atomic_path(folder / "manifest.json") as file:
                file.write_text(json.dumps({**self._content, "replaces": replaces}, indent=1), encoding="utf-8")
        for path in sorted(folder.glob("chunk_*_*.nc")):
            _, number, checksum = path.stem.split("_")
            if digest(path).endswith(checksum):
                self._saved[int(number)] = path
            else:
                warn(f"{path}: damaged; computed again")
                path.unlink()
        return True

    @property
    def numbers(self) -> set[int]:
        """Numbers of the computed chunks."""
        return {*self._saved, *self._held}

    def load(self, number: int) -> xarray.Dataset | None:
        """A chunk; None if it is not computed."""
        if number in self._held or number not in self._saved:
            return self._held.get(number)
        path = self._saved[number]
        with files.delay_interrupts(), path.open("rb") as file:
            return xarray.load_dataset(path, engine="scipy" if file.read(3) == b"CDF" else "netcdf4")

    def save(self, number: int, dataset: xarray.Dataset) -> None:
        """Take in a chunk, which is on the disk after HELD_SECONDS at most.

        Raises:
            OutputError: it cannot be written.
        """
        self._held[number] = dataset
        self._bytes += dataset.nbytes
        too_many = self._bytes > HELD_BYTES
        if too_many or time.monotonic() - self._written > HELD_SECONDS:
            self._flush()
        if too_many and self._on_disk:
            self._held.clear()
            self._bytes = 0

    def _flush(self) -> None:
        """Put all chunks on the disk."""
        for number in sorted(self._held.keys() - self._saved.keys()) if self._on_disk else ():
            with files.delay_interrupts(), files.atomic_path(self._folder / ".chunk.part") as file:
                self._held[number].to_netcdf(file, engine="scipy" if _is_classic(self._held[number]) else "netcdf4")
            path = self._folder / f"chunk_{number:08d}_{digest(self._folder / '.chunk.part')[-16:]}.nc"
            os.replace(self._folder / ".chunk.part", path)
            self._saved[number] = path
        self._written = time.monotonic()

    def keep(self) -> str:
        """Save what can be saved of an interrupted computation; returns a sentence about it, empty if nothing can."""
        with suppress(OutputError, KeyboardInterrupt), files.delay_interrupts():  # a second Ctrl-C loses nothing
            self._flush()
        if self._saved:
            what = "what is computed is" if max(self._saved) >= 0 else "no hit is saved yet, but their resolution is"
            return f"{what} saved in {self._folder}; continue with --resume"
        self.discard()
        return ""

    def discard(self) -> None:
        """Empty the folder, but for its lock."""
        for path in (*sorted(self._folder.glob("[cm]*")), *self._folder.glob(".*.part")):
            path.unlink(missing_ok=True)


def _is_classic(dataset: xarray.Dataset) -> bool:
    """Whether a netCDF-3 file, which takes a fifth of the time of netCDF-4, holds every bit of a Dataset."""
    whole = (int, np.integer)  # of 32 bits at most in such a file
    return all(of.dtype.str[1:] in _CLASSIC for of in dataset.variables.values()) and not any(
        isinstance(value, whole) for value in dataset.attrs.values()
    )
