"""What a fit or a search has computed, on the disk: batches as parts beside its result (`parts.py`).

Batches follow from what is computed and from earlier batches alone, so a resumed computation equals an undisturbed one.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.places import files_in
from warpimpact.campaign.text import parsed
from warpimpact.results import files
from warpimpact.results.files import OutputError
from warpimpact.runs.parts import Interrupted, Parts, claimed, digest


def content_of(text: str, name: str, folder: Path, made_by: Mapping[str, str]) -> dict[str, Any]:
    """What decides every bit of a result: the tables of a design or fit file, the contents of the files that it names,
    versions and kind of device.

    Args:
        name: what errors call the file.
        folder: from which file names in it count.
    """
    tables = json.loads(json.dumps(parsed(text, name), default=str))
    named = {file: folder / file for file in files_in(tables)}
    return {**tables, "files": {file: digest(path) for file, path in named.items() if path.is_file()}, **made_by}


@contextmanager
def stored(
    output: Path,
    content: Mapping[str, Any],
    kind: str,
    *,
    resume: bool,
    overwrite: bool,
    tell: Callable[[str], object] = warnings.warn,
) -> Iterator[Store | None]:
    """The `Store` of a computation while it runs; None if its result is complete already. The store is empty when the
    result is written; whatever ends the computation before leaves what can be resumed.

    Args:
        content, kind, tell: as in `Parts`.

    Raises:
        OutputError: something is there that must be neither resumed nor overwritten, another computation is at work, or
            the disk is full; the message says what is saved.
        Interrupted: by the keyboard; the message says what is saved.
    """
    with claimed(output):
        store = Store(output, content, kind, tell)
        if not store.begin(resume=resume, overwrite=overwrite):
            yield None
            return
        try:
            yield store
        except KeyboardInterrupt:
            raise Interrupted(f"interrupted; {store.parts.kept()}") from None
        except OutputError as error:
            raise OutputError(f"{error}; {store.parts.kept()}") from None
        except BaseException:
            store.parts.kept()
            raise
        store.parts.discard()


class Store:
    """Batches of one computation, in a folder that is `claimed`.

    Args:
        output: the file of the result.
        content, kind, tell: as in `Parts`.
    """

    def __init__(
        self, output: Path, content: Mapping[str, Any], kind: str, tell: Callable[[str], object] = warnings.warn
    ) -> None:
        def counted(count: int) -> str:
            return f"{count} batch{'' if count == 1 else 'es'}"

        self.parts = Parts(output, content, kind, "batch_*.npz", counted, tell)

    def begin(self, *, resume: bool, overwrite: bool) -> bool:
        """See `Parts.begin`."""
        return self.parts.begin(lambda path: self._read(path) is not None, resume=resume, overwrite=overwrite)

    def _path(self, batch: int) -> Path:
        return self.parts.folder / f"batch_{batch:06d}.npz"

    def load(self, batch: int) -> dict[str, NDArray[Any]] | None:
        """A batch that was computed; None if it is not there, is damaged or is of another place or computation."""
        return self._read(self._path(batch))

    def _read(self, path: Path) -> dict[str, NDArray[Any]] | None:
        try:
            if not path.is_file():  # a pipe would be waited for
                return None
            with np.load(path, allow_pickle=False) as file:
                arrays = dict(file)
        except Exception:  # a bit that was flipped leads zipfile into errors of many classes
            return None
        return arrays if str(arrays.pop("seal", "")) == self._seal_of(path, arrays) else None

    def _seal_of(self, path: Path, arrays: Mapping[str, NDArray[Any]]) -> str:
        """Seal of a batch: zipfile leaves out a member whose entry is damaged, without an error."""
        seal = hashlib.sha256(f"{self.parts.fingerprint} {path.name}".encode())
        for name, array in sorted(arrays.items()):
            seal.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
        return seal.hexdigest()

    def save(self, batch: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put a batch on the disk.

        Raises:
            OutputError: it cannot be written.
        """
        path = self._path(batch)
        with files.aside(path) as written, written.open("wb") as file:
            np.savez(file, allow_pickle=False, **{"seal": np.array(self._seal_of(path, arrays)), **arrays})
