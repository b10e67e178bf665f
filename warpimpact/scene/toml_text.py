"""The text of a TOML or JSON file that a user names, read and parsed but not validated."""

import json
import tomllib
from pathlib import Path
from typing import Any

from .input_files import check_file
from .units import brief

_MOST_TEXT = 2**20


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
        raise ValueError(f"{name}: is not valid TOML: {brief(str(error))}") from None
    except RecursionError:
        raise ValueError(f"{name}: its tables and arrays are nested too deep") from None
    return data
