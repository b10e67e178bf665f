"""Where a computation is kept until its result file is complete: a folder beside this file, or memory.

Beside RESULT.nc the folder RESULT.nc.parts holds chunks as netCDF files, and a manifest of everything that determines
their bits. A file is written under another name, flushed and renamed, so a file with its final name is whole. Its name
has a checksum; a chunk with another one is computed again. A lock keeps a second process away.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray
from filelock import FileLock, Timeout

from warpimpact.campaign.inputs import digest, first_difference
from warpimpact.errors import FileExists, Interrupted, OutputError
from warpimpact.records import attributes as attr
from warpimpact.results import files

Key = tuple[str, int]
"""Part and number of a chunk. A part is a name for chunks of one kind, such as "map" and "free_surface"; it says what
determines their bits beside the content."""
_CLASSIC = ("i1", "i2", "i4", "f4", "f8", "b1")
"""Types that a netCDF-3 file has, or for which xarray has a code there."""
HELD_SECONDS, HELD_BYTES = 2.0, 2**26
"""Time from which on each chunk is written when it comes, and most bytes that are kept in memory. A shorter computation
writes none."""
PILOT = "pilot"
"""Part of the resolution that the hits of a computation get."""


@dataclass(frozen=True)
class Store:
    """A result file, and what becomes of an earlier one or of an unfinished computation.

    Attributes:
        path: the netCDF file, which appears when it is complete; None keeps the result in memory.
        resume: continue what is in `path`.parts; begin if there is nothing.
        overwrite: replace an existing file, and begin anew in place of an unfinished computation.
    """

    path: Path | None = None
    resume: bool = False
    overwrite: bool = False

    @classmethod
    def at(cls, place: Store | str | Path) -> Store:
        """The store of a new file, by its name; a store as it is."""
        return place if isinstance(place, Store) else cls(Path(place))

    @property
    def folder(self) -> Path:
        """Folder with the chunks."""
        path = Path("memory") if self.path is None else self.path
        return path.with_name(f"{path.name}.parts")

    @property
    def is_begun(self) -> bool:
        """Whether a computation has left anything on the disk, complete or not."""
        return self.path is not None and (self.path.exists() or self.folder.exists())

    @contextmanager
    def open(
        self,
        content: Mapping[str, Any],
        *,
        warn: Callable[[str], object] = warnings.warn,
        replaces: bool = False,
    ) -> Iterator[Chunks]:
        """The chunks of a computation while it runs.

        The block writes the result file, with the fingerprint of the chunks; then they are removed. If it ends before,
        they can be resumed.

        Args:
            content: what determines the bits of the chunks.
            warn: called with a sentence for damaged chunks.
            replaces: whether the file is an earlier result of the computation, which its block replaces.

        Raises:
            OutputError: a file cannot be written, must not be overwritten or belongs to another computation, or another
                run is at work on it.
            Interrupted: the user interrupted the block; what is saved can be resumed.
        """
        chunks = Chunks(self, content)
        if self.path is None:
            yield chunks
            return
        lock, begun = FileLock(self.folder / "lock", timeout=0), False
        try:
            self.folder.mkdir(exist_ok=True)
            lock.acquire()
        except Timeout:
            raise OutputError(
                f"{self.path}: another run is writing it; wait for its end or name another file"
            ) from None
        except OSError as error:
            raise OutputError(f"{self.folder}: cannot be written into ({error.strerror})") from None
        try:
            files.check_writable(self.path)
            begun = chunks.begin(self.path, warn, replaces=replaces)
            yield chunks
            if begun:
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
                (self.folder / "lock").unlink(missing_ok=True)
                self.folder.rmdir()
            lock.release()


class Chunks:
    """Datasets by their keys, in memory and in the folder of a store, which is locked.

    Attributes:
        fingerprint: short hash of the content. Results with the same hash have the same bits.
        is_complete: whether the result file has this content already. Nothing is left to compute then.
    """

    def __init__(self, store: Store, content: Mapping[str, Any]) -> None:
        self._content = json.loads(json.dumps(content))
        self.fingerprint = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
        self._store, self.is_complete = store, False
        self._saved, self._held, self._begin = dict[Key, Path](), dict[Key, xarray.Dataset](), time.monotonic()
        self._bytes = 0  # of those in memory

    def begin(self, output: Path, warn: Callable[[str], object], *, replaces: bool) -> bool:
        """Take the folder, with its chunks if they are to be resumed; whether anything is left to compute."""
        folder, store, has_content = self._store.folder, self._store, False
        with suppress(OSError, RuntimeError), netCDF4.Dataset(output) as file:
            has_content = getattr(file, attr.FINGERPRINT, None) == self.fingerprint
        begun, may_replace = self._begun()
        self.is_complete = has_content and store.resume and begun != self._content
        if self.is_complete:
            if not begun:
                self.discard()  # of a kill while chunks were removed
            return False
        if store.overwrite or (has_content and not store.resume):
            begun, may_replace = {}, store.overwrite
        elif any(folder.glob("[cm]*")):
            if not store.resume:
                how = "continue it with --resume or begin anew with --overwrite"
                raise OutputError(f"{folder}: contains an unfinished computation; {how}")
            if not begun and not replaces:
                raise OutputError(f"{folder}/manifest.json: is missing or damaged; begin anew with --overwrite")
        if begun and (difference := first_difference(begun, self._content)):
            changed = "{} was {} and is {}".format(*difference)
            raise OutputError(f"{folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite")
        if output.exists() and not (replaces or may_replace or (has_content and begun)):
            other = ", and --resume adds no hits to what is complete" if store.resume else ""
            raise FileExists(f"{output}: exists already{other}; name another file or give --overwrite")
        if not begun:
            self.discard()
            with files.atomic_path(folder / "manifest.json") as file:
                file.write_text(json.dumps({**self._content, "replaces": may_replace}, indent=1), encoding="utf-8")
        for path in sorted(folder.glob("chunk_*_*_*.nc")):
            part, number, checksum = path.stem.removeprefix("chunk_").rsplit("_", 2)
            if digest(path).endswith(checksum):
                self._saved[part, int(number)] = path
            else:
                warn(f"{path}: damaged; computed again")
                path.unlink()
        return True

    def numbers(self, part: str) -> set[int]:
        """Numbers of the computed chunks of a part."""
        return {number for name, number in (*self._saved, *self._held) if name == part}

    def load(self, key: Key) -> xarray.Dataset | None:
        """A chunk; None if it is not computed."""
        if key in self._held or key not in self._saved:
            return self._held.get(key)
        path = self._saved[key]
        with files.delay_interrupts(), path.open("rb") as file:
            return xarray.load_dataset(path, engine="scipy" if file.read(3) == b"CDF" else "netcdf4")

    def save(self, key: Key, dataset: xarray.Dataset) -> None:
        """Take in a chunk, which is on the disk from HELD_SECONDS on.

        Raises:
            OutputError: it cannot be written.
        """
        self._held[key] = dataset
        self._bytes += dataset.nbytes
        too_many = self._bytes > HELD_BYTES
        if too_many or time.monotonic() - self._begin > HELD_SECONDS:
            self._flush()
        if too_many and self._store.path is not None:
            self._held.clear()
            self._bytes = 0

    def _flush(self) -> None:
        """Put all chunks on the disk."""
        new = set[Key]() if self._store.path is None else self._held.keys() - self._saved.keys()
        for key in sorted(new):
            dataset, folder, (part, number) = self._held[key], self._store.folder, key
            with files.delay_interrupts(), files.atomic_path(folder / ".chunk.part") as file:
                dataset.to_netcdf(file, engine="scipy" if _is_classic(dataset) else "netcdf4")
            path = folder / f"chunk_{part}_{number:08d}_{digest(folder / '.chunk.part')[-16:]}.nc"
            os.replace(folder / ".chunk.part", path)
            self._saved[key] = path

    def keep(self) -> str:
        """Save what can be saved of an interrupted computation; returns a sentence about it, empty if nothing can."""
        with suppress(OutputError, KeyboardInterrupt), files.delay_interrupts():  # a second Ctrl-C loses nothing
            self._flush()
        if self._saved:
            only_pilot = {part for part, _ in self._saved} == {PILOT}
            what = "no hit is saved yet, but their resolution is" if only_pilot else "what is computed is"
            return f"{what} saved in {self._store.folder}; continue with --resume"
        self.discard()
        return ""

    def discard(self) -> None:
        """Empty the folder, but for its lock; chunks without a manifest are not resumed."""
        folder = self._store.folder
        for path in (*folder.glob("m*"), *sorted(folder.glob("c*")), *folder.glob(".*.part")):
            path.unlink(missing_ok=True)

    def _begun(self) -> tuple[dict[str, Any], bool]:
        """The content of the unfinished computation in the folder, and whether it may replace a file; empty without."""
        with suppress(OSError, TypeError, ValueError):
            begun = dict(json.loads((self._store.folder / "manifest.json").read_bytes()))
            return begun, bool(begun.pop("replaces", False))
        return {}, False


def _is_classic(dataset: xarray.Dataset) -> bool:
    """Whether a netCDF-3 file, which takes a fifth of the time of netCDF-4, holds every bit of a Dataset."""
    whole = (int, np.integer)  # of 32 bits at most in such a file
    return all(of.dtype.str[1:] in _CLASSIC for of in dataset.variables.values()) and not any(
        isinstance(value, whole) for value in dataset.attrs.values()
    )
