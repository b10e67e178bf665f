"""The one way from tasks to a result: what a store lacks is computed by a computer, saved, and written as one file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import xarray

from warpimpact.measures.references import with_references
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.computer import Computer, Task, Tick
from warpimpact.runs.options import RunOptions
from warpimpact.runs.store import Chunks, Key, Store


@dataclass(frozen=True)
class Answer:
    """A result before it is written.

    Attributes:
        chunks: Datasets of consecutive hits, one of which at a time needs memory; iterated once.
        attributes: attributes of the whole, which replace those of the first chunk.
        references: Datasets of its references, by name.
    """

    chunks: Iterable[xarray.Dataset]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    references: Mapping[str, xarray.Dataset] = field(default_factory=dict)

    def map(self) -> xarray.Dataset:
        """All hits, in memory."""
        return files.with_meanings(joined(self.chunks).assign_attrs(self.attributes))

    def result(self) -> xarray.DataTree:
        """The whole, in memory."""
        return with_references(self.map(), self.references)


@dataclass(frozen=True)
class Pipeline:
    """What a computation needs: `computer.map` computes what `chunks` lack, and saves it there.

    Attributes:
        computer: what computes.
        chunks: what is computed already.
        options: who follows it.
    """

    computer: Computer
    chunks: Chunks
    options: RunOptions

    def compute(self, key: Key, function: Task, *arguments: Any, tick: Tick = lambda reports: None) -> xarray.Dataset:
        """The result of one task, which is a chunk."""
        if (saved := self.chunks.load(key)) is not None:
            return saved
        result: xarray.Dataset = self.computer.call(function, *arguments, tick=tick)
        self.chunks.save(key, result)
        return result

    def write(self, answer: Answer | xarray.DataTree, store: Store) -> None:
        """Write the result file of the store."""
        assert store.path is not None
        attributes = {attr.FINGERPRINT: self.chunks.fingerprint}
        if isinstance(answer, Answer):
            attributes = {**answer.attributes, **attributes}
            files.write(answer.chunks, store.path, attributes=attributes, references=answer.references)
        else:
            files.write(answer, store.path, attributes=attributes)


@contextmanager
def open_pipeline(
    store: Store, content: Mapping[str, Any], options: RunOptions, *, replaces: bool = False
) -> Iterator[Pipeline]:
    """A computation while it runs, unless its `chunks.is_complete`.

    Args:
        content: what determines the bits of its chunks, but for versions and kind of device.
        replaces: as in `Store.open`.

    Raises:
        DeviceError, ClusterError: as in `RunOptions.computer`.
        OutputError, Interrupted: as in `Store.open`.
    """
    with (
        options.computer() as computer,
        store.open({**content, **computer.made_by}, warn=options.warn, replaces=replaces) as chunks,
    ):
        yield Pipeline(computer, chunks, options)
