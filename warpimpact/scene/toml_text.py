"""The text of a TOML or JSON file that a user names, read and parsed within bounds but not validated."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from .input_files import check_file
from .units import brief

_MOST_TEXT, _MOST_DOTS, _MOST_DEEP = 2**20, 16, 16
_BESIDE_A_KEY = re.compile("([#=\n,])")


class NoTextError(ValueError):
    """A file that is no text; the message is one sentence."""


def read_text(path: Path) -> str:
    """The text of a file, cut after the length that `parsed` refuses.

    Raises:
        ValueError: the file is missing or cannot be read; NoTextError if it is no text.
    """
    check_file(path)
    try:
        with path.open(encoding="utf-8") as file:
            return file.read(_MOST_TEXT + 1)
    except UnicodeDecodeError as error:
        raise NoTextError(f"{path}: is not valid TOML: {error}") from None
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None


def parsed(text: str, name: str) -> dict[str, Any]:
    """The tables of a text, TOML or JSON.

    Raises:
        ValueError: the text is neither; `name` is its name in the message.
    """
    if len(text) > _MOST_TEXT or (not text.startswith("{") and _has_long_key(text)):
        raise ValueError(f"{name}: at most {_MOST_TEXT} characters are read, with {_MOST_DOTS} dots in a key")
    try:
        data: dict[str, Any] = _from_json(text) if text.startswith("{") else tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{name}: is not valid TOML: {brief(str(error))}") from None
    except RecursionError:
        nested = True
    else:
        nested = _is_nested(data)
    if nested:
        raise ValueError(f"{name}: its tables and arrays are nested more than {_MOST_DEEP} deep")
    return data


def _has_long_key(text: str) -> bool:
    """Whether a key or a table has more than _MOST_DOTS dots. The parser's time grows with the square of the dots."""
    _, *parts = _BESIDE_A_KEY.split(f"\n{text}\n")
    around = zip(parts[::2], parts[1::2], parts[2::2], strict=False)
    return any((before == "\n" or behind == "=") and key.count(".") > _MOST_DOTS for before, key, behind in around)


def _from_json(text: str) -> Any:
    """The tables of a JSON text.

    Raises:
        ValueError: the text is not JSON, or escapes half of a surrogate pair, which cannot be written as text.
    """
    data = json.loads(text)
    json.dumps(data, ensure_ascii=False).encode()
    return data


def _is_nested(data: Any) -> bool:
    """Whether tables and arrays are nested more than _MOST_DEEP deep."""
    level = [data]
    for _ in range(_MOST_DEEP):
        containers = [value for value in level if isinstance(value, dict | list)]
        level = [inner for value in containers for inner in (value.values() if isinstance(value, dict) else value)]
    return bool(level)
