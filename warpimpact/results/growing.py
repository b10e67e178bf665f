"""A result file on its way: it grows with the parts of a run."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4

from warpimpact.results.files import CHUNK, aside, told_as
from warpimpact.results.interrupts import uninterrupted
from warpimpact.results.netcdf import write_table
from warpimpact.results.table import Table, joined


class Growing:
    """A result file that grows part by part under another name, and gets its own when it is complete.

    Args:
        path: the file.
        written: where it grows, on the same disk; an existing file is replaced.
        hits: how many there will be.
    """

    def __init__(self, path: Path, written: Path, hits: int) -> None:
        self._path, self._written, self._chunk = path, written, min(hits, CHUNK)
        self._waiting: list[Table] = []
        self._file: Any = None
        self._at = 0

    def add(self, table: Table) -> None:
        """Add the next hits. Few of them wait for others: every access to the file costs some time.

        Raises:
            OutputError: they cannot be written; the file is of no use then.
        """
        self._waiting.append(table)
        if sum(one.sizes["hit"] for one in self._waiting) >= CHUNK // 2:
            with told_as(self._path):
                self._write()

    def complete(self, attributes: Mapping[str, Any]) -> None:
        """Give the file its name; an existing one is replaced.

        Args:
            attributes: global attributes over those of the first part.

        Raises:
            OutputError: The file cannot be written; what was there before is untouched.
        """
        with aside(self._path, self._written.parent) as file:
            self._write()
            self._file.setncatts(dict(attributes))
            self.close()
            os.replace(self._written, file)

    def close(self) -> None:
        """Let go of the file."""
        if self._file is not None:
            self._file, file = None, self._file
            file.close()

    def _write(self) -> None:
        """Write what waits."""
        if not self._waiting:
            return
        table, self._waiting = joined(self._waiting), []
        with uninterrupted():
            if self._at == 0:
                write_table(table, self._written, chunk=self._chunk)
                self._file = netCDF4.Dataset(self._written, "a")
                self._file.set_auto_maskandscale(False)
                for variable in self._file.variables.values():
                    if variable.chunking() != "contiguous":  # of the megabytes that it may keep, two chunks will do
                        size = 2 * math.prod(variable.chunking()) * variable.dtype.itemsize
                        variable.set_var_chunk_cache(size=size)
            end = self._at + table.sizes["hit"]
            for name, variable in self._file.variables.items() if self._at else ():
                if "hit" in variable.dimensions:
                    variable[self._at : end] = table[name].values
            self._at = end
