"""The one way from tasks to a result: what a store lacks is computed by a computer, saved, and written as one file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import xarray

from warpimpact.measures.references import nodes_of, with_nodes, with_references
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.results.dataset import joined
from warpimpact.runs.computer import Computer, Task, Tick
from warpimpact.runs.options import RunOptions
from warpimpact.runs.store import Chunks, Key, Store


@dataclass(frozen=True)
class Computed:
    """A result before it is written.

    Attributes:
        chunks: Datasets of consecutive hits, one of which at a time needs memory.
        attributes: attributes of the whole, which replace those of the first chunk.
        references: Datasets of its references, by name.
        nodes: chunks of further nodes, by their paths.
    """

    chunks: Iterable[xarray.Dataset]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    references: Mapping[str, xarray.Dataset] = field(default_factory=dict)
    nodes: Mapping[str, Iterable[xarray.Dataset]] = field(default_factory=dict)

    def map(self) -> xarray.Dataset:
        """All hits, in memory."""
        return files.with_meanings(joined(self.chunks).assign_attrs(self.attributes))

    def first_hits(self, most: int) -> xarray.Dataset:
        """The first hits, at most so many, in memory."""
        parts, count = list[xarray.Dataset](), 0
        for chunk in self.chunks:
            parts.append(chunk)
            count += chunk.sizes[v.HIT]
            if count >= most:
                break
        return joined(parts).isel(hit=slice(most))

    def result(self) -> xarray.DataTree:
        """The whole, in memory."""
        tree = with_references(self.map(), self.references)
        return with_nodes(tree.to_dataset(), nodes_of(tree) | {path: _whole(of) for path, of in self.nodes.items()})


def _whole(chunks: Iterable[xarray.Dataset]) -> xarray.Dataset:
    """Chunks of a node as one."""
    first, *others = chunks
    return joined([first, *others]) if others else first


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

    def write(self, result: Computed, store: Store) -> None:
        """Write the result file of the store."""
        assert store.path is not None
        attributes = {**result.attributes, attr.FINGERPRINT: self.chunks.fingerprint}
        references, nodes = result.references, result.nodes
        files.write(result.chunks, store.path, attributes=attributes, references=references, nodes=nodes)


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
