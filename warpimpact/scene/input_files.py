"""Files that a scene names: their paths, and tables of numbers in them."""

import csv
import math
import re
import stat
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from .model import Array
from .units import brief, quoted

_LONGEST_PATH = 255
"""Characters of a path that a message quotes."""
_NAME_AND_UNIT = re.compile(r"(\w+)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_MOST_BYTES, _MOST_ROWS = 2**28, 2**22
"""Largest size and number of rows of a table."""


def input_file(name: object, info: ValidationInfo) -> Path:
    """Absolute path of an existing file. A relative name starts at the validation context's `folder`, if given, or at
    the working directory."""
    if not isinstance(name, str | Path):
        raise ValueError(f"got {quoted(name)}, which is not a file name")
    path = Path((info.context or {}).get("folder", "")) / name
    try:
        exists = path.is_file()
    except (OSError, ValueError) as error:  # the name may be too long, or have a character that no name can have
        raise ValueError(f"got {quoted(name)}, which is no file name ({_reason(error)})") from None
    if not exists:
        got, place = (brief(str(text), _LONGEST_PATH) for text in (name, path))
        raise ValueError(f'got "{got}", but there is no file {place}')
    return path.absolute()


def _reason(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def check_file(path: Path, most: int | None = None) -> None:
    """Refuse, before it is read, a pipe or a device, which may have no end, and a file of more than `most` bytes.

    Raises:
        ValueError: the message names the file and its fault.
    """
    name = brief(str(path), _LONGEST_PATH)
    try:
        status = path.stat()
    except FileNotFoundError:
        raise ValueError(f"{name}: cannot be read (it is not there)") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{name}: cannot be read ({_reason(error)})") from None
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"{name}: cannot be read (it is {'a folder' if path.is_dir() else 'no file'})")
    if most is not None and status.st_size > most:
        raise ValueError(f"{name}: has {status.st_size / 2**20:.4g} MiB, but at most {most / 2**20:g} MiB are read")


InputFile = Annotated[Path, BeforeValidator(input_file)]


def read_table(path: Path, columns: tuple[str, ...]) -> Array:
    """Numbers of a CSV file with exactly this header line, shape [rows, columns], read-only.

    Raises:
        ValueError: the message names the file, the line and its fault.
    """
    with _open_table(path) as (header, reader):
        if header != columns:
            raise ValueError(f"{path.name}, line 1: {_got(header, columns)}the header must be {','.join(columns)}")
        return _rows(path, columns, reader, range(len(columns)))


class CsvColumn(NamedTuple):
    """A column of numbers, shape [rows], read-only; `unit` is the unit in brackets in its header, or empty."""

    values: Array
    unit: str


def read_columns(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...], exported: Mapping[str, str]
) -> dict[str, CsvColumn]:
    """Columns of a CSV file by name: the required ones first in its header, then any of the optional ones.

    A unit may follow a name, as in "hit_y [mm]". A file whose first column is "hit" comes from `warpimpact export`: its
    columns may have any order and names as keys of `exported`, and columns that are neither required nor optional are
    ignored.

    Raises:
        ValueError: the message names the file, the line and its fault.
    """
    with _open_table(path) as (header, reader):
        matches = [_NAME_AND_UNIT.fullmatch(column) for column in header]
        names, units = ([match[group] or "" if match else "" for match in matches] for group in (1, 2))
        if names[:1] == ["hit"]:
            names = [exported.get(name, name) for name in names]
            wanted = [place for place, name in enumerate(names) if name in (*required, *optional)]
            present = [names[place] for place in wanted]
            is_known = set(required) <= set(present)
        else:
            wanted, present = list(range(len(header))), names
            is_known = tuple(names[: len(required)]) == required and set(names[len(required) :]) <= set(optional)
        if not is_known or len(set(present)) < len(present):
            first = f"{','.join(required)} and then " if required else ""
            raise ValueError(
                f"{path.name}, line 1: {_got(header, (*required, *optional))}the header must be {first}any of "
                f"{', '.join(optional)}"
            )
        rows = _rows(path, header, reader, wanted).T
        return {name: CsvColumn(row, units[place]) for name, row, place in zip(present, rows, wanted, strict=True)}


def _got(header: tuple[str, ...], known: tuple[str, ...]) -> str:
    """The start of a message that quotes the header; empty if it has no known column, because an unrelated file is not
    quoted."""
    return f'got "{brief(",".join(header))}", but ' if set(header) & set(known) else ""


@contextmanager
def _open_table(path: Path) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Header of a CSV file, and the reader of its rows."""
    check_file(path, _MOST_BYTES)
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            reader = csv.reader(lines, skipinitialspace=True)
            yield tuple(name.strip() for name in next(reader, [])), reader
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path.name} cannot be read as a table: {error}") from None


def _rows(path: Path, columns: tuple[str, ...], reader: Any, wanted: Sequence[int]) -> Array:
    """Numbers of the columns at the places `wanted`."""
    rows = array("d")
    for row in reader:
        if row:
            rows.extend(_numbers(row, columns, f"{path.name}, line {reader.line_num}", wanted))
        if len(rows) > _MOST_ROWS * len(wanted):
            raise ValueError(f"{path.name} has more than {_MOST_ROWS} rows")
    if not rows:
        raise ValueError(f"{path.name} has no rows below its header")
    table = np.array(rows).reshape(-1, len(wanted))
    table.setflags(write=False)
    return table


def _numbers(row: list[str], columns: tuple[str, ...], place: str, wanted: Sequence[int]) -> list[float]:
    if len(row) != len(columns):
        raise ValueError(f'{place}: got "{brief(",".join(row))}", but a row has {len(columns)} finite numbers')
    return [_finite(row[column], f"{place}: {columns[column]}") for column in wanted]


def _finite(text: str, place: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{place}: got "{brief(text)}", but it must be a finite number')
    return number
