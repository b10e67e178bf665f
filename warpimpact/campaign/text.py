"""The text of a campaign, TOML or JSON, read and parsed within bounds but not validated."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..results.files import is_netcdf, kind_of
from ..results.kinds import text_kind
from ..scene import input_files
from .removed_keys import check_removed


class CampaignError(ValueError):
    """A campaign that cannot be run: one sentence naming file, field, value and what is allowed."""


@contextmanager
def _as_campaign() -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise CampaignError(str(error)) from None


def parsed(text: str, name: str, kind: str = "") -> dict[str, Any]:
    """The tables of a campaign, TOML or JSON, not yet validated.

    Raises:
        CampaignError: the text is neither, or is another kind of file; `name` is its name in the message.
    """
    with _as_campaign():
        tables = input_files.parsed(text, name)
        check_removed(tables, name)
    other, use = text_kind(tables, kind)
    if kind and other not in ("", kind):
        raise CampaignError(f"{name}: is {other}, not {kind}; {use}")
    return tables


def read_text(path: Path) -> str:
    """The text of a campaign file.

    Raises:
        CampaignError: the file is missing, cannot be read, or is a netCDF file.
    """
    with _as_campaign():
        try:
            return input_files.read_text(path)
        except input_files.NoTextError:
            if not is_netcdf(path):
                raise
            kind = kind_of(path)
            raise CampaignError(f"{path}: is {kind.name}, not a TOML file; {kind.use}") from None
