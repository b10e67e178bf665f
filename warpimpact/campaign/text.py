"""The text of a campaign, TOML or JSON: read and parsed within bounds, not yet validated."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from ..scene.units import brief

_MOST_TEXT, _MOST_DOTS, _MOST_DEEP = 2**20, 16, 16
_LONG_KEY = re.compile(rf"^[^#=\n,.]*(?:\.[^#=\n,.]*){{{_MOST_DOTS + 1}}}", re.MULTILINE)


class CampaignError(ValueError):
    """A campaign that cannot be run: one sentence naming file, field, value and what is allowed."""


def parsed(text: str, name: str) -> dict[str, Any]:
    """The tables of a campaign, TOML or JSON, not yet validated.

    Raises:
        CampaignError: the text, which errors call `name`, is neither.
    """
    if len(text) > _MOST_TEXT or (not text.startswith("{") and _LONG_KEY.search(text)):
        raise CampaignError(
            f"{name}: is not a campaign: at most {_MOST_TEXT} characters are read, with {_MOST_DOTS} dots in a key"
        )
    try:
        data: dict[str, Any] = _from_json(text) if text.startswith("{") else tomllib.loads(text)
    except ValueError as error:
        raise CampaignError(f"{name}: is not valid TOML: {brief(str(error))}") from None
    except RecursionError:
        data = {}
        nested = True
    else:
        nested = _is_nested(data)
    if nested:
        raise CampaignError(f"{name}: is not a campaign: its tables and arrays are nested more than {_MOST_DEEP} deep")
    return data


def _from_json(text: str) -> Any:
    """The tables of a JSON text. It may escape half a character, which is no text and cannot be told or written.

    Raises:
        ValueError: it is not JSON, or has such a half.
    """
    data = json.loads(text)
    json.dumps(data, ensure_ascii=False).encode()
    return data


def _is_nested(data: Any) -> bool:
    """Whether tables and arrays lie in each other more than _MOST_DEEP deep."""
    level = [data]
    for _ in range(_MOST_DEEP):
        level = [
            inner
            for one in level
            if isinstance(one, dict | list)
            for inner in (one.values() if isinstance(one, dict) else one)
        ]
    return bool(level)


def read_text(path: Path) -> str:
    """The text of a campaign file.

    Raises:
        CampaignError: it is missing or cannot be read.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe or a device may have no end
            raise CampaignError(f"{path}: is no file")
        with path.open(encoding="utf-8") as file:
            return file.read(_MOST_TEXT + 1)
    except FileNotFoundError:
        raise CampaignError(f"{path}: there is no such file") from None
    except OSError as error:
        raise CampaignError(f"{brief(str(path), 255)}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise CampaignError(f"{path}: is not valid TOML: {error}") from None
