"""Files that a scene names: where they are, and tables of numbers in them."""

import csv
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from .model import Array
from .units import quoted


def input_file(name: object, info: ValidationInfo) -> Path:
    """Absolute path of an existing file; a relative name counts from the validation context's `folder`, if any, else
    from the working directory."""
    if not isinstance(name, str | Path):
        raise ValueError(f"got {quoted(name)}, which is not a file name")
    path = Path((info.context or {}).get("folder", "")) / name
    if not path.is_file():
        raise ValueError(f"got {quoted(name)}, but there is no file {path}")
    return path.absolute()


InputFile = Annotated[Path, BeforeValidator(input_file)]


def read_table(path: Path, columns: tuple[str, ...]) -> Array:
    """Numbers of a CSV file with exactly this header line, shape [rows, columns], read-only.

    Raises:
        ValueError: names the file, the line and what is wrong with it.
    """
    header, reader = _open_table(path)
    if header != columns:
        raise ValueError(f'{path.name}, line 1: got "{",".join(header)}", but the header must be {",".join(columns)}')
    return _rows(path, columns, reader)


def read_columns(path: Path, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, Array]:
    """Columns of a CSV file by their names: the required ones first in its header, then any of the optional ones.

    Returns:
        Arrays of shape [rows], read-only.

    Raises:
        ValueError: names the file, the line and what is wrong with it.
    """
    header, reader = _open_table(path)
    more = header[len(required) :]
    if header[: len(required)] != required or not set(more) <= set(optional) or len(set(more)) < len(more):
        raise ValueError(
            f'{path.name}, line 1: got "{",".join(header)}", but the header must be {",".join(required)} '
            f"and then any of {', '.join(optional)}"
        )
    return dict(zip(header, _rows(path, header, reader).T, strict=True))


def _open_table(path: Path) -> tuple[tuple[str, ...], Any]:
    """Header of a CSV file, and the reader of what follows."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} cannot be read as text: {error}") from None
    reader = csv.reader(lines, skipinitialspace=True)
    return tuple(name.strip() for name in next(reader, [])), reader


def _rows(path: Path, columns: tuple[str, ...], reader: Any) -> Array:
    rows = [_numbers(row, columns, f"{path.name}, line {reader.line_num}") for row in reader if row]
    if not rows:
        raise ValueError(f"{path.name} has no rows below its header")
    table = np.array(rows)
    table.setflags(write=False)
    return table


def _numbers(row: list[str], columns: tuple[str, ...], place: str) -> list[float]:
    if len(row) != len(columns):
        raise ValueError(f'{place}: got "{",".join(row)}", but a row has {len(columns)} finite numbers')
    return [_finite(text, f"{place}: {name}") for text, name in zip(row, columns, strict=True)]


def _finite(text: str, place: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{place}: got "{text}", but it must be a finite number')
    return number
