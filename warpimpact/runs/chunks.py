"""Chunks of an unfinished computation: a folder beside the result file, or memory.

Beside RESULT.nc the folder RESULT.nc.parts holds chunks as netCDF files, and a manifest of everything that determines
the bits of the result. A file is written under another name, flushed and renamed, so a file with its final name is
whole. Its name has a checksum; a chunk with another one is computed again. A lock keeps a second process away.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import netCDF4
import xarray
from filelock import FileLock, Timeout

from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.files import OutputError

HELD_SECONDS, HELD_BYTES = 2.0, 2**23
"""Longest time for which chunks are only in memory, and most bytes that are kept there. A shorter computation writes
none."""
_NAME = re.compile(r"chunk_(\d{8})_([0-9a-f]{16})\.nc")


class Interrupted(KeyboardInterrupt):
    """A computation was interrupted; the message says what is saved."""


def digest(path: Path) -> str:
    """The name and the checksum of a file, for a manifest."""
    return f"{path.name}, sha256 {_checksum(path)}"


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def first_difference(left: Any, right: Any, place: str = "") -> tuple[str, str, str] | None:
    """Place and both values of the first difference between two nested dictionaries; None if they are equal."""
    if _is_tables(left) and _is_tables(right) and len(left) == len(right):
        left, right = ({str(number): table for number, table in enumerate(side)} for side in (left, right))
    if isinstance(left, dict) and isinstance(right, dict):
        for name in sorted(left.keys() | right.keys()):
            inner = f"{place}.{name}".removeprefix("campaign.").strip(".")
            if difference := first_difference(left.get(name), right.get(name), inner):
                return difference
        return None
    return None if left == right else (place, _brief(left), _brief(right))


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(entry, dict) for entry in value)


def _brief(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}..."


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
    can be resumed.

    Args:
        output: the result file; None keeps the chunks in memory.
        content: what determines the bits of the result.
        resume: take the chunks of an earlier computation.
        overwrite: replace an existing result and an unfinished computation.
        warn: called with a sentence about damaged chunks, which are computed again.

    Raises:
        OutputError: a file cannot be written, or something there must be neither resumed nor overwritten. The message
            says what is saved.
        Interrupted: the user interrupted the computation. The message says what is saved.
    """
    if output is None:
        yield Chunks(None, content)
        return
    with _claimed(output):
        chunks = Chunks(output, content)
        if not chunks.begin(resume=resume, overwrite=overwrite, warn=warn):
            yield None
            return
        try:
            yield chunks
        except KeyboardInterrupt:
            raise Interrupted(f"interrupted; {chunks.keep()}") from None
        except OutputError as error:
            raise OutputError(f"{error}; {chunks.keep()}") from None
        except BaseException:
            chunks.keep()
            raise
        chunks.discard()


@contextmanager
def _claimed(output: Path) -> Iterator[None]:
    """Lock a result file and the folder of its chunks against other processes."""
    folder = folder_of(output)
    lock = FileLock(folder / "lock", timeout=0)
    try:
        folder.mkdir(exist_ok=True)
        lock.acquire()
    except Timeout:
        raise OutputError(f"{output}: another run is writing it; wait for its end or name another file") from None
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None
    try:
        yield
    finally:
        with suppress(OSError):  # the folder holds what can be resumed
            (folder / "lock").unlink(missing_ok=True)
            folder.rmdir()
        lock.release()


class Chunks:
    """Datasets by their numbers, in memory and in a folder that is claimed.

    Attributes:
        fingerprint: short hash of the content. Results with the same hash have the same bits.
    """

    def __init__(self, output: Path | None, content: Mapping[str, Any]) -> None:
        self.output, self._content = output, json.loads(json.dumps(content))
        self.fingerprint = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
        self._saved, self._held, self._unsaved = dict[int, Path](), dict[int, xarray.Dataset](), set[int]()
        self._written = time.monotonic()
        self._folder = Path() if output is None else folder_of(output)
        self._manifest = self._folder / "manifest.json"

    def begin(self, *, resume: bool, overwrite: bool, warn: Callable[[str], object]) -> bool:
        """Take the folder, with its chunks if they are to be resumed; whether anything is left to compute."""
        assert self.output is not None
        complete = not overwrite and self._is_complete(self.output)
        if complete and resume:
            self.discard()
            return False
        begun = None if complete else self._begun()
        if begun is not None and resume:
            self._resume(begun, overwrite=overwrite, warn=warn)
            return True
        if begun is not None and not overwrite:
            raise OutputError(
                f"{self._folder}: contains an unfinished computation ({self._count()}); continue it with --resume or "
                "begin anew with --overwrite"
            )
        if self.output.exists() and not overwrite:
            other = ", and --resume adds no hits to what is complete" if resume else ""
            raise OutputError(f"{self.output}: exists already{other}; name another file or give --overwrite")
        self.discard()
        with files.aside(self._manifest) as file:
            file.write_text(json.dumps({**self._content, "replaces": overwrite}, indent=1), encoding="utf-8")
        return True

    def _is_complete(self, output: Path) -> bool:
        """Whether the result file is the complete result of this computation."""
        with suppress(OSError, RuntimeError), netCDF4.Dataset(output) as file:
            return bool(getattr(file, attr.FINGERPRINT, None) == self.fingerprint)
        return False

    def _begun(self) -> dict[str, Any] | None:
        """The manifest in the folder; None without one; empty if it cannot be read."""
        try:
            return dict(json.loads(self._manifest.read_bytes()))
        except FileNotFoundError:
            return {} if self._paths() else None
        except (OSError, TypeError, ValueError):
            return {}

    def _resume(self, begun: dict[str, Any], *, overwrite: bool, warn: Callable[[str], object]) -> None:
        if not begun:
            raise OutputError(f"{self._manifest}: is missing or damaged; begin anew with --overwrite")
        replaces = begun.pop("replaces", False) or overwrite
        if difference := first_difference(begun, self._content):
            changed = "{} was {} and is {}".format(*difference)
            raise OutputError(
                f"{self._folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite"
            )
        if self.output is not None and self.output.exists() and not (replaces or self._is_complete(self.output)):
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        damaged = []
        for path in self._paths():
            name = _NAME.fullmatch(path.name)
            if name and path.is_file() and _checksum(path).startswith(name[2]):
                self._saved[int(name[1])] = path
            else:
                damaged.append(path.name)
                _remove(path)
        if damaged:
            more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
            warn(f"{self._folder}: {damaged[0]}{more}: damaged; computed again")

    @property
    def numbers(self) -> set[int]:
        """Numbers of the computed chunks."""
        return {*self._saved, *self._held}

    def load(self, number: int) -> xarray.Dataset | None:
        """A chunk; None if it is not computed.

        Raises:
            OutputError: its file is gone or was damaged.
        """
        if number in self._held:
            return self._held[number]
        if number not in self._saved:
            return None
        try:
            return files.call_in_thread(xarray.load_dataset, self._saved[number], engine="netcdf4")
        except (OSError, ValueError, RuntimeError) as error:
            raise OutputError(f"{self._saved[number]}: this chunk is missing or damaged ({error})") from None

    def save(self, number: int, dataset: xarray.Dataset) -> None:
        """Take in a chunk, which is on the disk after HELD_SECONDS at most.

        Raises:
            OutputError: it cannot be written.
        """
        self._held[number] = dataset
        self._unsaved.add(number)
        too_many = sum(held.nbytes for held in self._held.values()) > HELD_BYTES
        if too_many or time.monotonic() - self._written > HELD_SECONDS:
            self.flush()
        if too_many and self.output is not None:
            self._held.clear()

    def flush(self) -> None:
        """Put all chunks on the disk.

        Raises:
            OutputError: a chunk cannot be written. It stays in memory.
        """
        while self.output is not None and self._unsaved:
            number = min(self._unsaved)
            before = self._saved.get(number)
            with files.aside(self._folder / "chunk", named=partial(self._path, number)) as file:
                files.call_in_thread(self._held[number].to_netcdf, file, engine="netcdf4")
            if before not in (None, self._saved[number]):
                _remove(before)
            self._unsaved.remove(number)
        self._written = time.monotonic()

    def _path(self, number: int, written: Path) -> Path:
        """Path of a chunk with these bytes."""
        self._saved[number] = self._folder / f"chunk_{number:08d}_{_checksum(written)[:16]}.nc"
        return self._saved[number]

    def keep(self) -> str:
        """Save what can be saved of an interrupted computation; returns a sentence about it."""
        with suppress(OutputError):
            self.flush()
        if self._saved:
            are = "is" if len(self._saved) == 1 else "are"
            return f"{self._count()} {are} saved in {self._folder}; continue with --resume"
        self.discard()
        return "nothing is saved"

    def _count(self) -> str:
        return "1 chunk" if (count := len(self._paths())) == 1 else f"{count} chunks"

    def _paths(self) -> list[Path]:
        return sorted(self._folder.glob("chunk_*"))

    def discard(self) -> None:
        """Empty the folder."""
        for path in (*self._paths(), *self._folder.glob(".*.part"), self._manifest):
            _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
