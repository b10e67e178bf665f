"""What a fit or a search has computed, on the disk: a folder beside its result, from which a later call goes on.

RESULT.nc.parts holds a manifest, which says what is computed, and a file per batch with a checksum of the manifest and
of the batch in it. Batches follow from what is computed and from earlier batches alone, so a resumed computation equals
an undisturbed one.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.results import files
from warpimpact.results.files import OutputError
from warpimpact.runs.run import Interrupted
from warpimpact.runs.shards import claimed, difference, fingerprint, folder_of

_MANIFEST = "manifest.json"


@contextmanager
def stored(output: Path, content: Mapping[str, Any], kind: str, *, resume: bool, overwrite: bool) -> Iterator[Store]:
    """The `Store` of a computation while it runs. It is empty when the result is written; whatever ends the computation
    before leaves what can be resumed.

    Raises:
        OutputError: something is there that must be neither resumed nor overwritten, or another computation is at work.
        Interrupted: by the keyboard; the message says what is saved.
    """
    with claimed(output):
        store = Store(output, content, kind)
        store.begin(resume=resume, overwrite=overwrite)
        try:
            yield store
        except KeyboardInterrupt:
            kept = f"{store.count} batches are saved in {store.folder}; continue with --resume"
            raise Interrupted(f"interrupted; {kept if store.count else 'nothing is saved'}") from None
        except Exception:
            if not store.count:
                store.discard()
            raise
        store.discard()


class Store:
    """Batches of one computation, in a folder that is `claimed`.

    Args:
        output: the file of the result.
        content: what decides every number of it.
        kind: what messages call the computation.
    """

    def __init__(self, output: Path, content: Mapping[str, Any], kind: str) -> None:
        self._output, self._content, self._kind = output, json.loads(json.dumps(content)), kind
        self.folder = folder_of(output)
        self._seal = fingerprint(self._content)

    def begin(self, *, resume: bool, overwrite: bool) -> None:
        """Take the folder, with what is in it if that is to be resumed.

        Raises:
            OutputError: something is there that must be neither resumed nor overwritten.
        """
        begun = self._begun()
        if begun is not None and resume:
            if changed := difference(begun, self._content):
                raise OutputError(
                    f"{self.folder}: cannot be resumed: {changed}; put it back, or begin anew with --overwrite"
                )
            return
        if begun is not None and not overwrite:
            raise OutputError(
                f"{self.folder}: contains an unfinished {self._kind} ({self.count} batches); continue it with --resume "
                "or begin anew with --overwrite"
            )
        if self._output.exists() and not overwrite:
            raise OutputError(f"{self._output}: exists already; name another file or give --overwrite")
        self.discard()
        with files.aside(self.folder / _MANIFEST) as file:
            file.write_text(json.dumps(self._content, indent=1), encoding="utf-8")

    def _begun(self) -> Any:
        """What was begun here, None if nothing was; a damaged manifest is nothing."""
        manifest = self.folder / _MANIFEST
        try:
            return json.loads(manifest.read_bytes()) if manifest.is_file() else None
        except (OSError, ValueError):
            return None

    def _batches(self) -> list[Path]:
        return sorted(path for path in self.folder.glob("batch_*.npz") if not path.is_fifo())

    def _path(self, batch: int) -> Path:
        return self.folder / f"batch_{batch:06d}.npz"

    def load(self, batch: int) -> dict[str, NDArray[Any]] | None:
        """A batch that was computed; None if it is not there, is damaged or is of another computation."""
        try:
            if not self._path(batch).is_file():  # a pipe would be waited for
                return None
            with np.load(self._path(batch), allow_pickle=False) as file:
                arrays = dict(file)
        except Exception:  # a bit that was flipped leads zipfile into errors of many classes
            return None
        return arrays if str(arrays.pop("seal", "")) == self._seal_of(arrays) else None

    def _seal_of(self, arrays: Mapping[str, NDArray[Any]]) -> str:
        """Of a batch of this computation: zipfile leaves out a member whose entry is damaged, without an error."""
        seal = hashlib.sha256(self._seal.encode())
        for name, array in sorted(arrays.items()):
            seal.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
        return seal.hexdigest()

    def save(self, batch: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put a batch on the disk.

        Raises:
            OutputError: it cannot be written.
        """
        with files.aside(self._path(batch)) as path, path.open("wb") as file:
            np.savez(file, allow_pickle=False, **{"seal": np.array(self._seal_of(arrays)), **arrays})

    @property
    def count(self) -> int:
        return len(self._batches())

    def discard(self) -> None:
        """Empty the folder."""
        for path in (self.folder / _MANIFEST, *self._batches(), *self.folder.glob(".*.part")):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
