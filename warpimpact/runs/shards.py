"""A run on its way to the disk: shards beside the result file, which appears when all of them are there.

Beside RESULT.nc the folder RESULT.nc.parts holds a manifest, which says what is being computed, and the shards, each
the result of a fixed range of shots. A file is written under another name, flushed and renamed, so that whatever has
its name is whole; a process that is killed loses what it was computing and what came in the last HELD seconds. The name
of a shard ends with a checksum of its bytes, its place and the campaign: a shard that was damaged, moved or taken from
another run does not have it, and is computed again. The result file grows beside the shards meanwhile; it is worth
nothing before it is complete. A lock in the folder keeps a second run away; the system lets go of it when a process
ends, however it ends.

Long because all that may befall a run on the disk stands together.
"""

from __future__ import annotations

import hashlib
import json
import logging
import re
import shutil
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.files import OutputError
from warpimpact.results.incremental import IncrementalFile
from warpimpact.results.netcdf import attribute, read_table
from warpimpact.results.table import Table

_logger = logging.getLogger(__name__)

_MANIFEST = "manifest.json"
_SHARDS = "hits_*.nc"
_LOCK = "lock"
_GROWING = ".growing.part"
FEWEST, MOST, SHARDS = 2**11, 2**16, 32
"""Shots per shard, and how many shards are aimed at between these. A shard costs some 10 ms beside its computing."""
HELD = 1.0
"""Seconds for which shards are held before they are on the disk, if they are few: a run that is that short needs none
there."""


def extent(count: int, at_a_plate: int = 1) -> int:
    """Shots per shard of a campaign of so many, which follows from the campaign alone: a power of two plates, each with
    so many shots."""
    shots = min(MOST, max(FEWEST, 1 << (count // SHARDS).bit_length()))
    return at_a_plate << max(0, (shots // at_a_plate).bit_length() - 1)


def manifest(campaign: Campaign, made_by: Mapping[str, str]) -> dict[str, Any]:
    """What decides every bit of a result: the campaign with the contents of its files, versions and kind of device."""
    contents = json.loads(json.dumps(campaign.model_dump(), default=_digest))
    dealt = {"replicates": campaign.replicates, "extent": extent(len(campaign.sampler()), campaign.at_a_plate)}
    return {"campaign": contents, **dealt, **made_by}


def _digest(path: Path) -> str:
    return f"{path.name}, sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}"


def fingerprint(content: Mapping[str, Any]) -> str:
    """Short name of a manifest: results with the same have the same bits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def difference(begun: Any, now: Any) -> str | None:
    """The first difference between two manifests as a phrase, None if there is none."""
    found = first_difference(begun, now)
    return found and "{} was {} and is {}".format(*found)


def first_difference(one: Any, other: Any, place: str = "") -> tuple[str, str, str] | None:
    """Where two nested dictionaries differ first, and what is there in each; None if they do not."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in sorted(one.keys() | other.keys()):
            inner = f"{place}.{name}".removeprefix("campaign.").strip(".")
            if found := first_difference(one.get(name), other.get(name), inner):
                return found
        return None
    return None if one == other else (place, _brief(one), _brief(other))


def _brief(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}..."


def folder_of(output: Path) -> Path:
    """Where the shards of a result file are."""
    return output.with_name(f"{output.name}.parts")


@contextmanager
def claimed(output: Path) -> Iterator[None]:
    """Keep other runs away from a result file and its shards, whose folder is there meanwhile.

    Raises:
        OutputError: another run is at it, or the folder cannot be written into.
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


class Shards:
    """The shards of one run, each the results of `extent` shots."""

    def __init__(self, extent: int) -> None:
        self.extent = extent
        self._held: dict[int, Table] = {}

    def there(self) -> Collection[int]:
        """Numbers of the shards that are there."""
        return self._held.keys()

    def save(self, index: int, table: Table) -> None:
        """Take in a shard."""
        self._held[index] = table

    def shard(self, index: int) -> Table:
        """A shard that is there."""
        return self._held[index]


class ShardsOnDisk(Shards):
    """The shards of one run on the disk, in a folder that is `claimed`. Those that came last are held in memory.

    Args:
        grows: whether the result file grows beside the shards as they come, so that no more than its end is left to do
            when they are there; that needs to know how many there will be.

    Attributes:
        output: the result file.
        folder: where the shards are.
        saved: the shards on the disk, by their numbers.
    """

    def __init__(
        self,
        output: Path,
        content: Mapping[str, Any],
        total: int,
        tell: Callable[[str], object] = warnings.warn,
        *,
        grows: bool = False,
    ) -> None:
        super().__init__(content["extent"])
        self.output, self.content, self.total, self._tell = output, content, total, tell
        self.folder = folder_of(output)
        self.saved: dict[int, Path] = {}
        self._fingerprint = fingerprint(content)
        self._written = time.monotonic()
        self._grows, self._grown = grows, 0
        self._growing: IncrementalFile | None = None

    @property
    def count(self) -> int:
        """Number of shards of the whole campaign."""
        return -(-self.total // self.extent)

    def begin(self, *, resume: bool, overwrite: bool) -> bool:
        """Take the folder, with what is in it if that is to be resumed.

        Returns:
            Whether there is anything to do: the result of this very campaign may be complete already.

        Raises:
            OutputError: something is there that must be neither resumed nor overwritten.
        """
        begun = self._read_manifest()
        if begun is not None and resume:
            self._take_up(begun, overwrite=overwrite)
            return True
        if begun is not None and not overwrite:
            raise OutputError(
                f"{self.folder}: contains an unfinished run ({len(self._shards())} of {self.count} shards); "
                "continue it with --resume or begin anew with --overwrite"
            )
        if self.output.exists() and not overwrite:
            if resume and self._is_complete():
                self.discard()
                return False
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        self._start_anew(overwrite=overwrite)
        return True

    def _read_manifest(self) -> dict[str, Any] | None:
        """What was begun here; None if nothing was, which a missing manifest means; empty if that cannot be known."""
        if (self.folder / _MANIFEST).is_fifo():  # it would be waited for
            return {}
        try:
            begun = json.loads((self.folder / _MANIFEST).read_bytes())
            replaces, known = begun.pop("replaces"), begun.pop("fingerprint")
            damaged = not isinstance(replaces, bool) or known != fingerprint(begun)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError, AttributeError, KeyError, TypeError):
            return {}
        return {} if damaged else {"content": begun, "replaces": replaces}

    def _take_up(self, begun: dict[str, Any], *, overwrite: bool) -> None:
        changed = begun and difference(begun["content"], json.loads(json.dumps(self.content)))
        if changed:
            raise OutputError(
                f"{self.folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite"
            )
        replaces = overwrite or begun.get("replaces", False)
        if self.output.exists() and not (replaces or self._is_complete()):
            raise OutputError(f"{self.output}: exists already; name another file or give --overwrite")
        for leftover in self.folder.glob(".*.part"):
            _remove(leftover)
        if not begun:
            self._tell(f"{self.folder / _MANIFEST}: is damaged; it is written again")
            self._write_manifest(replaces=replaces)
        damaged = [path for path in self._shards() if not self._take(path)]
        for path in damaged:
            _remove(path)
        if damaged:
            more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
            self._tell(
                f"{self.folder}: {damaged[0].name}{more}: damaged, or not of this place or campaign; computed again"
            )

    def _take(self, path: Path) -> bool:
        """Count a shard as saved if it is what its name says, and no other is there for its place."""
        first = re.match(r"hits_(\d{10})_", path.name)
        index = int(first[1]) // self.extent if first else 0
        if index in self.saved or not self._is_whole(index, path):
            return False
        self.saved[index] = path
        return True

    def _is_complete(self) -> bool:
        """Whether the result file is that of this very campaign."""
        try:
            return bool(attribute(self.output, attr.FINGERPRINT) == self._fingerprint)
        except (OSError, RuntimeError, ValueError):
            return False

    def _is_whole(self, index: int, path: Path) -> bool:
        try:
            return path == self._named(index, path)
        except OSError:  # a folder, for instance
            return False

    def _start_anew(self, *, overwrite: bool) -> None:
        try:
            self.discard()
            self._write_manifest(replaces=overwrite)
        except OutputError:
            self.discard()
            raise

    def _write_manifest(self, *, replaces: bool) -> None:
        content = {**self.content, "replaces": replaces, "fingerprint": self._fingerprint}
        if (self.folder / _MANIFEST).is_dir():
            _remove(self.folder / _MANIFEST)
        with files.aside(self.folder / _MANIFEST) as file:
            file.write_text(json.dumps(content, indent=1), encoding="utf-8")

    def _shards(self) -> list[Path]:
        return sorted(path for path in self.folder.glob(_SHARDS) if not path.is_fifo())

    def _stem(self, index: int) -> str:
        return f"hits_{index * self.extent:010d}"

    def _path(self, index: int) -> Path:
        """The shard of a place.

        Raises:
            OutputError: it is gone or damaged.
        """
        path = self.saved[index]
        if not self._is_whole(index, path):
            raise OutputError(f"{path}: this shard is missing or damaged")
        return path

    def _named(self, index: int, written: Path) -> Path:
        """The name of a shard with these bytes at this place."""
        with written.open("rb") as file:
            bits = hashlib.file_digest(file, "sha256").hexdigest()
        seal = hashlib.sha256(f"{self._fingerprint} {index} {bits}".encode()).hexdigest()[:16]
        return self.folder / f"{self._stem(index)}_{seal}.nc"

    def there(self) -> Collection[int]:
        """Numbers of the shards that are there."""
        return self._held.keys() | self.saved.keys()

    def save(self, index: int, table: Table) -> None:
        """Take in a shard. It is on the disk after HELD seconds at most, if the run goes on.

        Raises:
            OutputError: what was held cannot be written.
        """
        super().save(index, table)
        if self._grows:
            try:
                self._grow()
            except OutputError:  # as the disk is full, for instance: the shards are worth more
                self._stop_growing()
                self._grows = False
        if time.monotonic() - self._written >= HELD or len(self._held) * self.extent >= files.CHUNK:
            self.flush()

    def flush(self) -> None:
        """Put all shards on the disk.

        Raises:
            OutputError: one cannot be written; it is held, like those behind it.
        """
        while self._held:
            index = min(self._held)
            self._write(index, self._held[index])
            del self._held[index]
        self._written = time.monotonic()

    def _write(self, index: int, table: Table) -> None:
        placed: dict[int, Path] = {}

        def named(written: Path) -> Path:
            return placed.setdefault(index, self._named(index, written))

        files.write_shard(table, self.folder / f"{self._stem(index)}.nc", named)
        self.saved |= placed
        _logger.info("shard %d of %d saved: %d hits", index + 1, self.count, table.sizes["hit"])

    def kept(self) -> int:
        """Shards on the disk when a run breaks off, one included that an interrupt has kept from being counted."""
        self._stop_growing()
        with suppress(OutputError):
            self.flush()
        return len(self._shards())

    def shard(self, index: int) -> Table:
        """A shard that is there.

        Raises:
            OutputError: it is gone or damaged meanwhile.
        """
        return super().shard(index) if index in self._held else read_table(self._path(index))

    def _grow(self, count: int | None = None) -> None:
        """Add the shards to the result file that are there and follow those in it, or the first `count` shards."""
        if self._growing is None:
            hits = min(self.total, (self.count if count is None else count) * self.extent)
            self._growing = IncrementalFile(self.output, self.folder / _GROWING, hits)
        there = self.there()
        while self._grown in there if count is None else self._grown < count:
            self._growing.add(self.shard(self._grown))
            self._grown += 1

    def _stop_growing(self) -> None:
        if self._growing is not None:
            with suppress(OSError, RuntimeError):
                self._growing.close()
        self._growing, self._grown = None, 0
        (self.folder / _GROWING).unlink(missing_ok=True)

    def finish(self, count: int, attributes: Callable[[Table], Mapping[str, Any]]) -> None:
        """Join the first `count` shards into the result file, and remove them.

        Args:
            attributes: global attributes from the first shard.

        Raises:
            OutputError: the file cannot be written, or a shard is damaged meanwhile; the others are still there.
        """
        told = {**attributes(self.shard(0)), attr.FINGERPRINT: self._fingerprint}
        self._grow(count)
        assert self._growing is not None  # there are hits
        self._growing.complete(told)
        self._held.clear()
        _logger.info("%d shards joined into %s", count, self.output)
        self.discard()

    def discard(self) -> None:
        """Empty the folder: first of its manifest, without which the rest means nothing."""
        for path in (self.folder / _MANIFEST, *self.folder.glob(_SHARDS), *self.folder.glob(".*.part")):
            _remove(path)


def _remove(path: Path) -> None:
    """Remove a file, or a folder of that name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
