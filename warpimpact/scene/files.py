"""Files that a scene names: where they are, and tables of numbers in them."""

import csv
import math
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from .model import Array
from .units import quoted


def input_file(name: object, info: ValidationInfo) -> Path:
    """Path of an existing file; a relative name counts from the validation context's `folder`, if any."""
    if not isinstance(name, str | Path):
        raise ValueError(f"got {quoted(name)}, which is not a file name")
    path = Path((info.context or {}).get("folder", "")) / name
    if not path.is_file():
        raise ValueError(f"got {quoted(name)}, but there is no file {path}")
    return path


InputFile = Annotated[Path, BeforeValidator(input_file)]


def read_table(path: Path, columns: tuple[str, ...]) -> Array:
    """Numbers of a CSV file with exactly this header line, shape [rows, columns], read-only.

    Raises:
        ValueError: names the file, the line and what is wrong with it.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} cannot be read as text: {error}") from None
    reader = csv.reader(lines, skipinitialspace=True)
    header = next(reader, [])
    if tuple(name.strip() for name in header) != columns:
        raise ValueError(f'{path.name}, line 1: got "{",".join(header)}", but the header must be {",".join(columns)}')
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
