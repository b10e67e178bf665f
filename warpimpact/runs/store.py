"""The results of a fit or a search on the disk: batches as parts beside its result (`parts.py`).

A batch depends only on the content and on earlier batches, so a resumed computation equals an undisturbed one.
"""

from __future__ import annotations

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
from warpimpact.runs.manifests import digest
from warpimpact.runs.parts import Form, Parts, claimed, telling


def content_of(text: str, name: str, folder: Path, made_by: Mapping[str, str]) -> dict[str, Any]:
    """What determines every bit of a result: the tables of a design or fit file, the contents of the files that it
    names, versions and kind of device. `name` is that of the file in errors; names in it count from `folder`."""
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
    """The `Store` of a computation while it runs; None if its result is already complete. The store is emptied when the
    result is written. If the computation ends before, the store can be resumed.

    Raises:
        OutputError: something there must be neither resumed nor overwritten, another computation is at work, or the
            disk is full; the message says what is saved.
        Interrupted: the user interrupted the computation; the message says what is saved.
    """
    with claimed(output):
        store = Store(output, content, kind, tell)
        if not store.parts.begin(resume=resume, overwrite=overwrite):
            yield None
            return
        with telling(store.parts.kept):
            yield store
        store.parts.discard()


class Store:
    """Batches of one computation as `Parts`, in a folder that is `claimed`."""

    def __init__(
        self, output: Path, content: Mapping[str, Any], kind: str, tell: Callable[[str], object] = warnings.warn
    ) -> None:
        def counted(count: int) -> str:
            return f"{count} batch{'' if count == 1 else 'es'}"

        self.parts = Parts(output, content, kind, Form("batch", ".npz"), counted, tell)

    def load(self, batch: int) -> dict[str, NDArray[Any]] | None:
        """The results of a batch; None if it was not computed.

        Raises:
            OutputError: its file is gone or was damaged.
        """
        if batch not in self.parts.saved:
            return None
        with np.load(self.parts.path(batch), allow_pickle=False) as file:
            return dict(file)

    def save(self, batch: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put a batch on the disk.

        Raises:
            OutputError: the batch cannot be written.
        """

        def write(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)

        self.parts.save(batch, write)
