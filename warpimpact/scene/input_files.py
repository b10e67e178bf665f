"""Files that a user names: their paths, the tables of TOML or JSON, and columns of numbers."""

import csv
import json
import math
import re
import stat
import tomllib
from array import array
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from .model import Array
from .units import brief, quantity, quoted

_LONGEST_PATH = 255
"""Characters of a path that a message quotes."""
_NAME_AND_UNIT = re.compile(r"(\w+)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_MOST_BYTES, _MOST_ROWS = 2**28, 2**22
"""Largest size and number of rows of a table."""
_WITH_A_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?(?: .*)?")
_THOUSANDS = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")
_BARE_VALUE = re.compile(r"""([\w.-]+)\s*=\s*([^"'\[{\s](?:[^,}\]#]|,(?=\d))*)""")
_PLAIN_NUMBER = re.compile(r"[-+]?[0-9_]+(?:\.[0-9_]+)?(?:e[-+]?[0-9]+)?|true|false")
_TRUTHS = {"true": "true", "yes": "true", "on": "true", "false": "false", "no": "false", "off": "false"}
_MOST_TEXT = 2**20
"""Most characters of TOML or JSON."""


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


def read_columns(
    path: Path, kinds: Mapping[str, Any], required: tuple[str, ...], exported: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Array]:
    """Columns of a CSV file by name, shape [rows] each, in SI and radians, read-only.

    A unit may follow a name, as in "hit_y [mm]"; without it numbers are in SI and angles in degrees. The required
    columns come first in the header, then any of the others. A file whose first column is "hit" comes from
    `warpimpact export`: its columns may have any order and names as keys of `exported`, and unknown ones are ignored.

    Args:
        kinds: type of the quantity of every column.

    Raises:
        ValueError: the message names the file, the line and its fault.
    """
    rows = read_rows(path)
    _, header = next(rows, (0, []))
    columns = _header(path.name, header, kinds, required, exported)
    values_by_column = _numbers(path.name, header, rows, [place for place, _ in columns.values()]).T
    table = {}
    for (name, (_, unit)), values in zip(columns.items(), values_by_column, strict=True):
        kind = quantity(kinds[name])
        try:
            factor = kind(f"1 {unit}") if unit else math.radians(1.0) if kind.unit == "rad" else 1.0
        except ValueError as error:
            raise ValueError(f"{path.name}, line 1: {name}: {error}") from None
        table[name] = values * factor
        table[name].setflags(write=False)
    return table


def _header(
    file: str, header: list[str], kinds: Mapping[str, Any], required: tuple[str, ...], exported: Mapping[str, str]
) -> dict[str, tuple[int, str]]:
    """Place and unit of each column by name."""
    matches = [_NAME_AND_UNIT.fullmatch(column) for column in header]
    columns = [
        (match[1], (place, match[2] or "")) if match else ("", (place, "")) for place, match in enumerate(matches)
    ]
    if header[:1] == ["hit"]:
        columns = [(exported.get(name, name), column) for name, column in columns]
        columns = [(name, column) for name, column in columns if name in kinds]
        first: list[str] = [name for name in required if name in dict(columns)]
    else:
        first = [name for name, _ in columns[: len(required)]]
    if first != list(required) or not dict(columns).keys() <= kinds.keys() or len(dict(columns)) < len(columns):
        got = f'got "{brief(",".join(header))}", but ' if set(header) & set(kinds) else ""  # no unrelated file
        optional = [name for name in kinds if name not in required]
        parts = [",".join(required)] * bool(required) + [f"any of {', '.join(optional)}"] * bool(optional)
        raise ValueError(f"{file}, line 1: {got}the header must be {' and then '.join(parts)}")
    return dict(columns)


def _numbers(file: str, header: list[str], rows: Iterator[tuple[int, list[str]]], places: list[int]) -> Array:
    """Numbers of the columns at these places, shape [rows, columns]."""
    numbers = array("d")
    for number, row in rows:
        line = f"{file}, line {number}:"
        if len(row) != len(header):
            got = f'{line} got "{brief(",".join(row))}", but a row has {len(header)} finite numbers'
            raise ValueError(got + ", separated by commas" * (len(row) > len(header)))
        for place in places:
            try:
                value = float(row[place])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise ValueError(f'{line} {header[place]}: got "{brief(row[place])}", but it must be a finite number')
            numbers.append(value)
        if len(numbers) > _MOST_ROWS * len(places):
            raise ValueError(f"{file} has more than {_MOST_ROWS} rows")
    if not numbers:
        raise ValueError(f"{file} has no rows below its header")
    return np.array(numbers).reshape(-1, len(places))


def read_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line of a CSV file with something in it, the header first.

    Columns are separated by commas, semicolons or tabs, or as a first line such as "sep=;" says. With semicolons or
    tabs, a comma in a number is the decimal sign and becomes a point. Lines that begin with # are comments.

    Raises:
        ValueError: the message names the file, the line and its fault.
    """
    check_file(path, _MOST_BYTES)
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            top, before = "#", 0
            separator = ""
            while top and (top.startswith(("#", "sep=")) or not top.strip()):
                separator = top.strip("\r\n")[4:] if top.startswith("sep=") else separator
                top, before = next(lines, ""), before + 1
            separator = separator or next((mark for mark in ";\t" if mark in top), ",")
            reader = csv.reader(chain([top], lines), delimiter=separator, skipinitialspace=True)
            for row in reader:
                if any(map(str.strip, row)) and not row[0].startswith("#"):
                    number = before + reader.line_num - 1
                    yield number, [_with_a_point(cell.strip(), separator, path.name, number) for cell in row]
    except UnicodeDecodeError:
        raise ValueError(f"{path.name} cannot be read as a table: it is not UTF-8; save it as CSV UTF-8") from None
    except (OSError, TypeError, csv.Error) as error:  # a TypeError of a separator of several characters
        raise ValueError(f"{path.name} cannot be read as a table: {error}") from None


def _with_a_point(cell: str, separator: str, file: str, line: int) -> str:
    """A cell whose number has a point in the place of a decimal comma."""
    if separator == "," or not _WITH_A_COMMA.fullmatch(cell):
        return cell
    if separator != ";" and _THOUSANDS.fullmatch(cell):
        raise ValueError(f'{file}, line {line}: got "{cell}", whose comma may stand for thousands; write a point')
    return cell.replace(",", ".")


class NoTextError(ValueError):
    """A file that is no text; the message is one sentence."""


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, with or without a byte order mark, cut after the length that `parsed` refuses.

    Raises:
        ValueError: the file is missing or cannot be read; NoTextError if it is no such text.
    """
    check_file(path)
    try:
        with path.open(encoding="utf-8-sig") as file:
            return file.read(_MOST_TEXT + 1)
    except UnicodeDecodeError as error:
        is_utf_16 = error.object[:2] in (b"\xff\xfe", b"\xfe\xff")
        encoding = "UTF-16" if is_utf_16 else "not UTF-8, perhaps Windows-1252"
        raise NoTextError(f"{path}: is not valid TOML: its encoding is {encoding}; save it as UTF-8") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None


def parsed(text: str, name: str) -> dict[str, Any]:
    """The tables of a text, TOML or JSON.

    Raises:
        ValueError: the text is neither; `name` is its name in the message.
    """
    if len(text) > _MOST_TEXT:
        raise ValueError(f"{name}: at most {_MOST_TEXT} characters are read")
    try:
        data: dict[str, Any] = json.loads(text) if text.startswith("{") else tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{name}: is not valid TOML: {brief(str(error))}{_advice(text, str(error))}") from None
    except RecursionError:
        raise ValueError(f"{name}: its tables and arrays are nested too deep") from None
    return data


def _advice(text: str, error: str) -> str:
    """What to type in the place of a line that is not TOML."""
    place = re.search(r"at line (\d+)", error)
    line = (text.splitlines() or [""])[int(place[1]) - 1] if place else ""
    if line.count("{") > line.count("}"):
        return "; write a table { … } in one line"
    for key, value in _BARE_VALUE.findall(line):
        if (word := value.strip().lower()) in _TRUTHS:
            return f"; write {key} = {_TRUTHS[word]}"
        if not _PLAIN_NUMBER.fullmatch(word):
            return f'; write quotes around a text or a number with a unit: {key} = "{brief(value.strip())}"'
    return ""
