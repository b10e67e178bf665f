"""A result file that is written part by part during a run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warpimpact.results.files import FILE_CHUNK, aside, told_as
from warpimpact.results.netcdf import append, open_to_append, write_groups, write_table
from warpimpact.results.table import HitTable, joined


class IncrementalFile:
    """A result file of this number of hits in all. Parts are `written` to a file on the same disk, which is renamed to
    `path` when it is complete. Existing files are replaced."""

    def __init__(self, path: Path, written: Path, hits: int) -> None:
        self._path, self._written, self._chunk = path, written, min(hits, FILE_CHUNK)
        self._waiting: list[HitTable] = []
        self._file: Any = None
        self._at = 0

    def add(self, table: HitTable) -> None:
        """Add the next hits. A few hits are held back, because every access to the file costs some time.

        Raises:
            OutputError: they cannot be written. The file cannot be used then.
        """
        self._waiting.append(table)
        if sum(table.sizes["hit"] for table in self._waiting) >= FILE_CHUNK // 2:
            with told_as(self._path):
                self._write()

    def complete(self, attributes: Mapping[str, Any], groups: Mapping[str, HitTable]) -> None:
        """Rename the file, with tables as its groups, to its final name, which replaces an existing file. The
        attributes replace global attributes of the first part.

        Raises:
            OutputError: The file cannot be written; what was there before is untouched.
        """
        with aside(self._path, self._written.parent) as file:
            self._write()
            self._file.setncatts(dict(attributes))
            write_groups(groups, self._file)
            self.close()
            os.replace(self._written, file)

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file, file = None, self._file
            file.close()

    def _write(self) -> None:
        if not self._waiting:
            return
        table, self._waiting = joined(self._waiting), []
        if self._at == 0:
            write_table(table, self._written, chunk=self._chunk)
            self._file = open_to_append(self._written)
        else:
            append(table, self._file, self._at)
        self._at += table.sizes["hit"]
