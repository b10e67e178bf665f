"""The parts of an unfinished computation on the disk: a folder beside the result file.

Beside RESULT.nc the folder RESULT.nc.parts holds the parts and a manifest: everything that determines the bits of the
result. A file is written under another name, flushed and renamed, so a file with its final name is whole. The name of
a part has a checksum. A part whose bytes have another one is computed again. A lock in the folder keeps a second
process away. The system releases it when the process ends, however it ends.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
from filelock import FileLock, Timeout

from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.files import OutputError


def digest(path: Path) -> str:
    """The name and the contents of a file, for a manifest."""
    with path.open("rb") as file:
        return f"{path.name}, sha256 {hashlib.file_digest(file, 'sha256').hexdigest()}"


def fingerprint(content: Mapping[str, Any]) -> str:
    """Short hash of a manifest. Results with the same hash have the same bits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def difference(begun: Any, now: Any) -> str | None:
    """The first difference between two manifests as a phrase, None if there is none."""
    where = first_difference(begun, now)
    return where and "{} was {} and is {}".format(*where)


def first_difference(left: Any, right: Any, place: str = "") -> tuple[str, str, str] | None:
    """Place and both values of the first difference between two nested dictionaries; None if they are equal."""
    if _are_tables(left) and _are_tables(right) and len(left) == len(right):
        left, right = ({str(place): table for place, table in enumerate(tables)} for tables in (left, right))
    if isinstance(left, dict) and isinstance(right, dict):
        for name in sorted(left.keys() | right.keys()):
            inner = f"{place}.{name}".removeprefix("campaign.").strip(".")
            if inner_difference := first_difference(left.get(name), right.get(name), inner):
                return inner_difference
        return None
    return None if left == right else (place, _brief(left), _brief(right))


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(entry, dict) for entry in value)


def _brief(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}..."


_MANIFEST = "manifest.json"
_LOCK = "lock"


class Interrupted(KeyboardInterrupt):
    """A computation was interrupted; the message says what is saved."""


def folder_of(output: Path) -> Path:
    """Folder with the parts of a result file."""
    return output.with_name(f"{output.name}.parts")


def is_begun(output: Path) -> bool:
    """Whether a computation of a result file has left anything on the disk, complete or not."""
    return output.exists() or folder_of(output).exists()


@contextmanager
def claimed(output: Path) -> Iterator[None]:
    """Lock a result file and the folder of its parts, which exists meanwhile, against other processes.

    Raises:
        OutputError: another process has locked it, or the folder cannot be written into.
    """
    folder = folder_of(output)
    lock = FileLock(folder / _LOCK, timeout=0)
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
        try:
            (folder / _LOCK).unlink(missing_ok=True)
            with suppress(OSError):  # it holds what can be resumed
                folder.rmdir()
        finally:
            lock.release()


@contextmanager
def telling(kept: Callable[[], str]) -> Iterator[None]:
    """Report what is kept of a computation that breaks off.

    Args:
        kept: saves what can be saved; returns a sentence about it.

    Raises:
        Interrupted: the user interrupted it.
        OutputError: a file cannot be written.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; {kept()}") from None
    except OutputError as error:
        raise OutputError(f"{error}; {kept()}") from None
    except BaseException:
        kept()
        raise


class Form(NamedTuple):
    """Names of parts: what they hold, the number of its first item, and a checksum.

    Attributes:
        holds: the items of a part, such as "hits".
        suffix: suffix of the files.
        extent: number of items in a part.
    """

    holds: str
    suffix: str
    extent: int = 1

    @property
    def pattern(self) -> str:
        """Glob pattern of the names of parts."""
        return f"{self.holds}_*{self.suffix}"

    def stem(self, number: int) -> str:
        """Name of a part before its checksum."""
        return f"{self.holds}_{number * self.extent:010d}"

    def number_in(self, name: str) -> int:
        """Number of the part with this name; 0 for a name that no part has."""
        first = re.match(rf"{self.holds}_(\d{{10}})_", name)
        return int(first[1]) // self.extent if first else 0


class Parts:
    """The parts of one computation, in a folder that is `claimed`.

    Args:
        content: everything that determines the bits of the result.
        kind: the computation in messages: "run", "search" or "fit".
        counted: returns words for a number of parts, for example "3 of 32 shards".
        tell: called with a sentence for each damaged part, which is computed again.

    Attributes:
        saved: parts on the disk, by their numbers.
        fingerprint: short hash of the content.
    """

    def __init__(
        self,
        output: Path,
        content: Mapping[str, Any],
        kind: str,
        form: Form,
        counted: Callable[[int], str],
        tell: Callable[[str], object] = warnings.warn,
    ) -> None:
        self.output, self._kind, self._form, self._counted, self._tell = output, kind, form, counted, tell
        self.folder = folder_of(output)
        self.saved: dict[int, Path] = {}
        self.fingerprint = fingerprint(content)
        self._content = json.loads(json.dumps(content))
        self._manifest = self.folder / _MANIFEST

    def begin(self, *, resume: bool, overwrite: bool) -> bool:
        """Take the folder, and the parts in it if they shall be resumed.

        Returns:
            Whether anything is left to compute. The result of this computation may already be complete.

        Raises:
            OutputError: something there must be neither resumed nor overwritten.
        """
        complete = not overwrite and self.is_complete()
        if complete and resume:
            self.discard()
            return False
        begun = None if complete else self._begun()
        if begun is not None and resume:
            self._take_up(begun, overwrite=overwrite)
            return True
        if begun is not None and not overwrite:
            raise OutputError(
                f"{self.folder}: contains an unfinished {self._kind} ({self.counted}); "
                "continue it with --resume or begin anew with --overwrite"
            )
        if self.output.exists() and not overwrite:
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        try:
            self.discard()
            self._write_manifest(replaces=overwrite)
        except OutputError:
            self.discard()
            raise
        return True

    def is_complete(self) -> bool:
        """Whether the result file is the complete result of this computation."""
        try:
            return (
                self.output.is_file() and netCDF4.Dataset(self.output).getncattr(attr.FINGERPRINT) == self.fingerprint
            )
        except (AttributeError, OSError, RuntimeError, ValueError):
            return False

    def _begun(self) -> dict[str, Any] | None:
        """The manifest in the folder; None without one; empty if it cannot be read."""
        try:
            return dict(json.loads(self._manifest.read_bytes()))
        except FileNotFoundError:
            return {} if self.paths() else None
        except (OSError, TypeError, ValueError):
            return {}

    def _take_up(self, begun: dict[str, Any], *, overwrite: bool) -> None:
        if not begun:
            raise OutputError(f"{self._manifest}: is missing or damaged; begin anew with --overwrite")
        replaces = begun.pop("replaces", False) or overwrite
        if changed := difference(begun, self._content):
            raise OutputError(
                f"{self.folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite"
            )
        if self.output.exists() and not (replaces or self.is_complete()):
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        for leftover in self.folder.glob(".*.part"):
            remove(leftover)
        damaged = []
        for path in self.paths():
            number = self._form.number_in(path.name)
            if number in self.saved or not self._is_whole(number, path):
                damaged.append(path)
                remove(path)
            else:
                self.saved[number] = path
        if damaged:
            more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
            self._tell(f"{self.folder}: {damaged[0].name}{more}: damaged; computed again")

    def _write_manifest(self, *, replaces: bool) -> None:
        with files.aside(self._manifest) as file:
            file.write_text(json.dumps({**self._content, "replaces": replaces}, indent=1), encoding="utf-8")

    def _is_whole(self, number: int, path: Path) -> bool:
        try:
            return path == self._named(number, path)
        except OSError:  # it may be a folder
            return False

    def _named(self, number: int, written: Path) -> Path:
        """Path of the part with this number and these bytes."""
        with written.open("rb") as file:
            checksum = hashlib.file_digest(file, "sha256").hexdigest()[:16]
        return self.folder / f"{self._form.stem(number)}_{checksum}{self._form.suffix}"

    def path(self, number: int) -> Path:
        """Path of a saved part.

        Raises:
            OutputError: the part is gone or damaged.
        """
        path = self.saved[number]
        if not self._is_whole(number, path):
            raise OutputError(f"{path}: this part is missing or damaged")
        return path

    def save(self, number: int, write: Callable[[Path], object]) -> None:
        """Put a part on the disk, whole or not at all, in place of an older part with this number.

        Raises:
            OutputError: the part cannot be written.
        """
        before = self.saved.get(number)

        def named(written: Path) -> Path:
            self.saved[number] = self._named(number, written)
            return self.saved[number]

        with files.aside(self.folder / f"{self._form.stem(number)}", named=named) as file:
            write(file)
        if before not in (None, self.saved[number]):
            remove(before)

    def paths(self) -> list[Path]:
        """Paths of the saved parts."""
        return sorted(self.folder.glob(self._form.pattern))

    @property
    def counted(self) -> str:
        """Words for the number of saved parts."""
        return self._counted(len(self.paths()))

    def kept(self) -> str:
        """A sentence about what an interrupted computation leaves. If it leaves nothing, the folder is emptied."""
        if not self.paths():
            self.discard()
            return "nothing is saved"
        return f"{self.counted} are saved in {self.folder}; continue with --resume"

    def discard(self) -> None:
        """Empty the folder."""
        for path in (*self.folder.glob(self._form.pattern), *self.folder.glob(".*.part"), self._manifest):
            remove(path)


def remove(path: Path) -> None:
    """Remove a file or a folder."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
