"""Files that a user names: their paths, the tables of TOML or JSON, and columns of numbers."""

import csv
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from .model import Array
from .units import UnitError, number_and_unit, quantity, quoted, shorten

_LONGEST_PATH = 255
"""Characters of a path that a message quotes."""
_NAME_AND_UNIT = re.compile(r"(\w+)\s*(?:[\[(]\s*([^\[\]]*?)\s*[\])])?")
_SPREADSHEET_ERROR = re.compile(r"#(?:N/A|NV|[^\W\d_]+(?:/0)?[!?])")
_WITH_A_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?(?: .*)?")
_BARE_VALUE = re.compile(r"""([\w.-]+)\s*=\s*([^"'\[{\s](?:[^,}\]#]|,(?=\d))*)""")
_BARE_LIST = re.compile(r"""([\w.-]+)\s*=\s*[(\[]([^"'\[\]{}()]+)[)\]]""")
_NUMERAL = re.compile(r"[-+]?[\d.,_' ]+(?:e[-+]?\d+)?")
_TYPOGRAPHIC = "“”„‟«»‘’‚;, "
"""Quotes of word processors, and what ends a line in other languages."""
_PLAIN_NUMBER = re.compile(r"[-+]?(?:0|[1-9][0-9_]*)(?:\.[0-9_]+)?(?:e[-+]?[0-9]+)?")
_TRUTHS = {"true": "true", "yes": "true", "on": "true", "false": "false", "no": "false", "off": "false"}
FILE_KEYS = ("file", "catalogue")
"""Keys of a campaign that name files."""
_MOST_TEXT = 2**20
"""Most characters of TOML or JSON."""


def input_file(name: object, info: ValidationInfo) -> Path:
    """Absolute path of an existing file. A relative name starts at the validation context's `folder`, if given, or at
    the working directory."""
    if not isinstance(name, str | Path):
        raise ValueError(f"got {quoted(name)}, which is not a file name")
    path = Path((info.context or {}).get("folder", "")) / name
    if not os.path.isfile(path):
        got, place = (shorten(str(text), _LONGEST_PATH) for text in (name, path))
        raise ValueError(f'got "{got}", but there is no file {place}')
    return path.absolute()


def check_file(path: Path) -> None:
    """Refuse, before it is read, a pipe or a device, which may have no end.

    Raises:
        ValueError: the message names the file and its fault.
    """
    reason = None
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            reason = f"it is {'a folder' if path.is_dir() else 'no file'}"
        elif not os.access(path, os.R_OK):
            reason = "Permission denied"
    except (OSError, ValueError) as error:
        reason = "it is not there" if isinstance(error, FileNotFoundError) else getattr(error, "strerror", str(error))
    if reason is not None:
        raise ValueError(f"{shorten(str(path), _LONGEST_PATH)}: cannot be read ({reason})")


InputFile = Annotated[Path, BeforeValidator(input_file)]


def files_of(part: Any, keys: tuple[str, ...] = FILE_KEYS) -> dict[str, str]:
    """Names of files in tables, by their places; `keys` are those that name a file."""
    inner = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    names = {}
    for key, value in inner:
        if key in keys and isinstance(value, str):
            names[str(key)] = value
        names |= {f"{key}.{place}": name for place, name in files_of(value, keys).items()}
    return names


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
    while header and not header[-1]:  # an empty column of a spreadsheet
        header.pop()
    columns = _header(path.name, header, kinds, required, exported)
    numbers = []
    for line, row in rows:
        if len(row) < len(header) or any(row[len(header) :]):
            raise ValueError(
                f'{path.name}, line {line}: got "{shorten(",".join(row))}", but a row has {len(header)} finite '
                "numbers; decimal commas need semicolons between columns"
            )
        numbers.append([_number(row[at], f"{path.name}, line {line}: {header[at]}") for at, _ in columns.values()])
    if not numbers:
        raise ValueError(f"{path.name} has no rows below its header")
    table = {}
    for (name, (_, unit)), values in zip(columns.items(), np.array(numbers).T, strict=True):
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
    names = [(match[1].lower(), match[2] or "") if match else ("", "") for match in matches]
    if is_exported := header[:1] == ["hit"]:
        names = [(exported.get(name, name), unit) for name, unit in names]
    if "degradation_length" in dict(names):
        raise ValueError(f"{file}, line 1: degradation_length: cannot differ from hit to hit; give one in the campaign")
    columns = {name: (place, unit) for place, (name, unit) in enumerate(names) if name in kinds}
    in_order = tuple(columns)[: len(required)] == required and len(columns) == len(header)
    if not (columns.keys() >= set(required) if is_exported else in_order):
        text = ",".join(header)
        got = f'got "{shorten(text)}", but ' if set(re.findall(r"\w+", text)) & set(kinds) else ""  # no unrelated file
        optional = [name for name in kinds if name not in required]
        parts = [",".join(required)] * bool(required) + [f"any of {', '.join(optional)}"] * bool(optional)
        raise ValueError(
            f"{file}, line 1: {got}the header must be {' and then '.join(parts)}, separated by commas, semicolons or "
            'tabs; a unit follows its name, as in "hit_y [mm]"'
        )
    return columns


def _number(cell: str, place: str) -> float:
    try:
        value, unit = number_and_unit(cell)
    except UnitError as error:
        raise ValueError(f'{place}: got "{shorten(cell)}", {error}') from None
    if unit or not math.isfinite(value):
        raise ValueError(f'{place}: got "{shorten(cell)}", but it must be a finite number; units belong to the header')
    return value


def read_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line of a CSV file with something in it, the header first.

    Columns are separated by commas, semicolons or tabs, or as a first line such as "sep=;" says. With semicolons, a
    comma in a number is the decimal sign and becomes a point. Lines that begin with # are comments.

    Raises:
        ValueError: the message names the file, the line and its fault.
    """
    check_file(path)
    try:
        lines = [f"{line}\n" for line in path.read_text(encoding="utf-8-sig").split("\n")]
        given = next((line[4:5] for line in lines if line.lower().startswith("sep=")), "")
        header = next((line for line in lines if line.strip() and not line.lower().startswith(("#", "sep="))), "")
        separator = given or next((mark for mark in ";\t" if mark in header), ",")
        reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        for row in reader:
            if any(_SPREADSHEET_ERROR.fullmatch(cell.strip()) for cell in row[:1]):
                raise ValueError(f'{path.name}, line {reader.line_num}: got "{row[0]}", an error of the spreadsheet')
            if any(map(str.strip, row)) and not row[0].lower().startswith(("#", "sep=")):
                is_decimal = [separator == ";" and _WITH_A_COMMA.fullmatch(cell.strip()) for cell in row]
                cells = [cell.replace(",", ".") if comma else cell for cell, comma in zip(row, is_decimal, strict=True)]
                yield reader.line_num, [cell.strip() for cell in cells]
    except UnicodeDecodeError:
        raise ValueError(f"{path.name} cannot be read as a table: it is not UTF-8; save it as CSV UTF-8") from None
    except (OSError, TypeError, csv.Error) as error:  # a TypeError of a separator that is a line's end
        raise ValueError(f"{path.name} cannot be read as a table: {error}") from None


def is_netcdf(path: Path) -> bool:
    """Whether a regular file begins as netCDF files do."""
    with path.open("rb") as file:
        return file.read(4).startswith((b"\x89HDF", b"CDF"))


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, with or without a byte order mark, cut after the length that `parsed` refuses.

    Raises:
        ValueError: the file is missing, cannot be read, or is no such text.
    """
    check_file(path)
    try:
        with path.open(encoding="utf-8-sig") as file:
            return file.read(_MOST_TEXT + 1)
    except UnicodeDecodeError as error:
        is_utf_16 = error.object[:2] in (b"\xff\xfe", b"\xfe\xff")
        encoding = "UTF-16" if is_utf_16 else "not UTF-8, perhaps Windows-1252"
        raise ValueError(f"{path}: is not valid TOML: its encoding is {encoding}; save it as UTF-8") from None
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
        raise ValueError(f"{name}: is not valid TOML: {shorten(str(error))}{_advice(text, str(error))}") from None
    except RecursionError:
        raise ValueError(f"{name}: its tables and arrays are nested too deep") from None
    return data


def _advice(text: str, error: str) -> str:
    """What to type in the place of a line that is not TOML."""
    place = re.search(r"at line (\d+)", error)
    line = (text.splitlines() or [""])[int(place[1]) - 1] if place else ""
    if not line.replace("\t", "").isprintable():
        return "; it has a character that cannot be seen, such as a space copied from a web page"
    if line.count("{") > line.count("}"):
        return "; write a table { … } in one line"
    if "\\" in line:
        return "; write single quotes around a text with \\"
    if line.count('"') % 2:
        return "; close the quotes"
    for key, items in _BARE_LIST.findall(line):
        listed = ", ".join(f'"{item.strip(_TYPOGRAPHIC)}"' for item in re.split(r"[,;]\s", items))
        return f"; write quotes around numbers with a unit: {key} = [{shorten(listed)}]"
    for key, value in _BARE_VALUE.findall(line):
        word = value.strip().strip(_TYPOGRAPHIC)
        if word == _TRUTHS.get(word) or _PLAIN_NUMBER.fullmatch(word):
            continue
        if word.lower() in _TRUTHS:
            return f"; write {key} = {_TRUTHS[word.lower()]}"
        if _NUMERAL.fullmatch(word):
            return "; write a number as 4096 or 0.5: with digits before and behind a point, and no other mark"
        if value.startswith("("):
            return f"; write a list in square brackets: {key} = [ … ]"
        return f'; write quotes around a text or a number with a unit: {key} = "{shorten(word)}"'
    if error.startswith("Unclosed array"):
        return "; write commas between the items, and ] behind the last"
    if error.startswith("Expected newline"):
        return "; remove what follows the value; a comment begins with #"
    return "; write a value behind the =" if line.strip().endswith("=") else ""
