"""The shards of a run: parts beside the result file (`parts.py`), which appears when all of them are there.

A shard is the result of a fixed range of shots. A process that is killed loses the shots in progress and the shards of
the last HELD seconds.
"""

from __future__ import annotations

import json
import logging
import time
import warnings
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.files import OutputError
from warpimpact.results.netcdf import FILE_CHUNK, read_table, write_joined, write_table
from warpimpact.results.table import HitTable
from warpimpact.runs.parts import Form, Parts, digest

_logger = logging.getLogger(__name__)

FEWEST, MOST, SHARDS = 2**11, 2**16, 32
"""Fewest and most shots per shard, and the number of shards within these bounds. A shard costs some 10 ms."""
HELD = 1.0
"""Seconds for which a few shards may be held in memory before they are written. A run shorter than this writes none."""


def extent(count: int) -> int:
    """Shots per shard of a campaign of `count` shots: a power of two. It depends on the campaign alone."""
    return min(MOST, max(FEWEST, 1 << (count // SHARDS).bit_length()))


def manifest(campaign: Campaign, made_by: Mapping[str, str]) -> dict[str, Any]:
    """What determines every bit of a result: the campaign with the contents of its files, versions and kind of
    device."""
    contents = json.loads(json.dumps(campaign.model_dump(), default=digest))
    dealt = {"replicates": campaign.replicates, "extent": extent(len(campaign.sampler()))}
    return {"campaign": contents, **dealt, **made_by}


class Shards:
    """The shards of one run of `total` shots in memory. Each holds the results of `extent` shots."""

    def __init__(self, total: int, extent: int) -> None:
        self.total, self.extent = total, extent
        self.count = -(-total // extent)
        self._held: dict[int, HitTable] = {}

    def there(self) -> Collection[int]:
        """Numbers of the finished shards."""
        return self._held.keys()

    def save(self, index: int, table: HitTable) -> None:
        """Take in a shard."""
        self._held[index] = table

    def shard(self, index: int) -> HitTable:
        """A finished shard."""
        return self._held[index]


class ShardsOnDisk(Shards):
    """The shards of one run on the disk, in a folder that is `claimed`. The latest shards are held in memory."""

    def __init__(
        self, output: Path, content: Mapping[str, Any], total: int, tell: Callable[[str], object] = warnings.warn
    ) -> None:
        super().__init__(total, content["extent"])
        form = Form("hits", ".nc", self.extent)
        self.parts = Parts(output, content, "run", form, lambda count: f"{count} of {self.count} shards", tell)
        self._written = time.monotonic()

    def there(self) -> Collection[int]:
        """Numbers of the finished shards."""
        return self._held.keys() | self.parts.saved.keys()

    def save(self, index: int, table: HitTable) -> None:
        """Take in a shard. In a continuing run it is on the disk after HELD seconds at most.

        Raises:
            OutputError: the held shards cannot be written.
        """
        super().save(index, table)
        if time.monotonic() - self._written >= HELD or len(self._held) * self.extent >= FILE_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Put all shards on the disk.

        Raises:
            OutputError: a shard cannot be written. It stays in memory, as do those behind it.
        """
        while self._held:
            index = min(self._held)
            table = self._held[index]
            self.parts.save(index, partial(write_table, table, compressed=False))
            del self._held[index]
            _logger.info("shard %d of %d saved: %d hits", index + 1, self.count, table.sizes["hit"])
        self._written = time.monotonic()

    def kept(self) -> str:
        """A sentence about what an interrupted run leaves."""
        with suppress(OutputError):
            self.flush()
        return self.parts.kept()

    def shard(self, index: int) -> HitTable:
        """A finished shard.

        Raises:
            OutputError: its file is gone or was damaged.
        """
        return super().shard(index) if index in self._held else read_table(self.parts.path(index))

    def finish(
        self, count: int, attributes: Callable[[HitTable], Mapping[str, Any]], groups: Mapping[str, HitTable]
    ) -> None:
        """Join the first `count` shards into the result file, and remove them.

        Args:
            attributes: computes global attributes from the first shard.
            groups: hits of the references, by their names.

        Raises:
            OutputError: the file cannot be written, or a shard was damaged; the other shards are kept.
        """
        complete = {**attributes(self.shard(0)), attr.FINGERPRINT: self.parts.fingerprint}
        hits, tables = min(self.total, count * self.extent), map(self.shard, range(count))
        with files.aside(self.parts.output, self.parts.folder) as file:
            write_joined(tables, hits, file, complete, groups)
        self._held.clear()
        _logger.info("%d shards joined into %s", count, self.parts.output)
        self.parts.discard()
