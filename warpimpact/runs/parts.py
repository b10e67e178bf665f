"""What a computation has on the disk before its result is complete: a folder of parts beside the result file.

Beside RESULT.nc the folder RESULT.nc.parts holds a manifest, which says what is being computed, and the parts. A file
is written under another name, flushed and renamed, so that whatever has its name is whole. A part carries a seal of its
bytes, its place and the manifest's content: a part that was damaged, moved or taken from another computation does not
have it, and is computed again. Parts that are there without a manifest, or with a damaged one, are kept for the same
reason. A lock in the folder keeps a second process away; the system lets go of it when a process ends, however it ends.
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

from filelock import FileLock, Timeout

from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.files import OutputError
from warpimpact.results.interrupts import uninterrupted
from warpimpact.results.netcdf import attribute
from warpimpact.runs.manifests import difference, fingerprint

_MANIFEST = "manifest.json"
_LOCK = "lock"


class Interrupted(KeyboardInterrupt):
    """A computation was interrupted; the message says what is saved."""


def folder_of(output: Path) -> Path:
    """Where the parts of a result file are."""
    return output.with_name(f"{output.name}.parts")


def is_begun(output: Path) -> bool:
    """Whether a computation of a result file has left anything on the disk, complete or not."""
    return output.exists() or folder_of(output).exists()


@contextmanager
def claimed(output: Path) -> Iterator[None]:
    """Keep other processes away from a result file and its parts, whose folder is there meanwhile.

    Raises:
        OutputError: another process is at it, or the folder cannot be written into.
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
    """Say what is kept of a computation that does not come to its end.

    Args:
        kept: saves what can be saved, and says what that is.

    Raises:
        Interrupted: by the keyboard.
        OutputError: something cannot be written.
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
    """How parts are named: with what they hold, the number of the first of it, and their seal.

    Attributes:
        holds: what they hold, such as "hits".
        suffix: of their files.
        extent: how many of it a part holds.
    """

    holds: str
    suffix: str
    extent: int = 1

    @property
    def pattern(self) -> str:
        """Of the names of parts."""
        return f"{self.holds}_*{self.suffix}"

    def stem(self, number: int) -> str:
        """The name of a part before its seal."""
        return f"{self.holds}_{number * self.extent:010d}"

    def number_in(self, name: str) -> int:
        """Number of the part of a name; 0 of a name that no part has."""
        first = re.match(rf"{self.holds}_(\d{{10}})_", name)
        return int(first[1]) // self.extent if first else 0


class Parts:
    """The parts of one computation, in a folder that is `claimed`.

    Args:
        output: the result file.
        content: what decides every bit of the result.
        kind: what messages call the computation: "run", "search" or "fit".
        form: how the parts are named.
        counted: says how much a number of parts is, for example "3 of 32 shards".
        tell: called with a sentence for what was damaged and is computed again.

    Attributes:
        folder: where they are.
        saved: the parts on the disk, by their numbers.
        fingerprint: short name of the content.
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
        """Take the folder, with the parts in it if they are to be resumed.

        Returns:
            Whether there is anything to do: the result of this very computation may be complete already.

        Raises:
            OutputError: something is there that must be neither resumed nor overwritten.
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
        """Whether the result file is that of this very computation."""
        try:
            return self.output.is_file() and bool(attribute(self.output, attr.FINGERPRINT) == self.fingerprint)
        except (OSError, RuntimeError, ValueError):
            return False

    def _begun(self) -> dict[str, Any] | None:
        """What was begun here; None if nothing was; empty if that cannot be known."""
        if self._manifest.is_fifo():  # it would be waited for
            return {}
        try:
            begun = json.loads(self._manifest.read_bytes())
            replaces, known = begun.pop("replaces"), begun.pop("fingerprint")
            damaged = not isinstance(replaces, bool) or known != fingerprint(begun)
        except FileNotFoundError:
            return {} if self.paths() else None
        except (OSError, ValueError, RecursionError, AttributeError, KeyError, TypeError):
            return {}
        return {} if damaged else {"content": begun, "replaces": replaces}

    def _take_up(self, begun: dict[str, Any], *, overwrite: bool) -> None:
        if begun and (changed := difference(begun["content"], self._content)):
            raise OutputError(
                f"{self.folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite"
            )
        replaces = overwrite or begun.get("replaces", False)
        if self.output.exists() and not (replaces or self.is_complete()):
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        for leftover in self.folder.glob(".*.part"):
            remove(leftover)
        if not begun:
            self._tell(f"{self._manifest}: is missing or damaged; it is written again")
            self._write_manifest(replaces=replaces)
        damaged = [path for path in self.paths() if not self._take(path)]
        for path in damaged:
            remove(path)
        if damaged:
            more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
            self._tell(
                f"{self.folder}: {damaged[0].name}{more}: damaged, or not of this place or {self._kind}; computed again"
            )

    def _write_manifest(self, *, replaces: bool) -> None:
        if self._manifest.is_dir():
            remove(self._manifest)
        with files.aside(self._manifest) as file:
            content = {**self._content, "replaces": replaces, "fingerprint": self.fingerprint}
            file.write_text(json.dumps(content, indent=1), encoding="utf-8")

    def _take(self, path: Path) -> bool:
        """Count a part as saved if it is what its name says, and no other is there for its place."""
        number = self._form.number_in(path.name)
        if number in self.saved or not self._is_whole(number, path):
            return False
        self.saved[number] = path
        return True

    def _is_whole(self, number: int, path: Path) -> bool:
        try:
            return path == self._named(number, path)
        except OSError:  # a folder, for instance
            return False

    def _named(self, number: int, written: Path) -> Path:
        """The name of a part with these bytes at this place."""
        with written.open("rb") as file:
            bits = hashlib.file_digest(file, "sha256").hexdigest()
        seal = hashlib.sha256(f"{self.fingerprint} {number} {bits}".encode()).hexdigest()[:16]
        return self.folder / f"{self._form.stem(number)}_{seal}{self._form.suffix}"

    def path(self, number: int) -> Path:
        """A part that is saved.

        Raises:
            OutputError: it is gone or damaged.
        """
        path = self.saved[number]
        if not self._is_whole(number, path):
            raise OutputError(f"{path}: this part is missing or damaged")
        return path

    def save(self, number: int, write: Callable[[Path], object]) -> None:
        """Put a part on the disk, whole or not at all, in place of one of this number.

        Args:
            write: writes the file of a name.

        Raises:
            OutputError: it cannot be written.
        """
        before = self.saved.get(number)

        def named(written: Path) -> Path:
            self.saved[number] = self._named(number, written)
            return self.saved[number]

        with uninterrupted(), files.aside(self.folder / f"{self._form.stem(number)}", named=named) as file:
            write(file)
        if before not in (None, self.saved[number]):
            remove(before)

    def paths(self) -> list[Path]:
        """The parts that are there."""
        return sorted(path for path in self.folder.glob(self._form.pattern) if not path.is_fifo())

    @property
    def counted(self) -> str:
        """How many parts are there, in words."""
        return self._counted(len(self.paths()))

    def kept(self) -> str:
        """What a computation that breaks off leaves behind; the folder is emptied if that is nothing."""
        if not self.paths():
            self.discard()
            return "nothing is saved"
        return f"{self.counted} are saved in {self.folder}; continue with --resume"

    def discard(self) -> None:
        """Empty the folder."""
        for path in (*self.folder.glob(self._form.pattern), *self.folder.glob(".*.part"), self._manifest):
            remove(path)


def remove(path: Path) -> None:
    """Remove a file, or a folder of that name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
