"""The text of a campaign, TOML or JSON, read and parsed but not validated."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..results.files import is_netcdf, kind_of
from ..results.kinds import text_kind
from ..scene import input_files


class CampaignError(ValueError):
    """A campaign that cannot be run: one sentence naming file, field, value and what is allowed."""


@contextmanager
def as_campaign_error(place: str = "") -> Iterator[None]:
    """Raise a ValueError as a CampaignError, with the place before its sentence."""
    try:
        yield
    except ValueError as error:
        raise CampaignError(f"{place}{error}") from None


def parsed(text: str, name: str, kind: str = "") -> dict[str, Any]:
    """The tables of a campaign, TOML or JSON, not yet validated.

    Raises:
        CampaignError: the text is neither, or is another kind of file; `name` is its name in the message.
    """
    with as_campaign_error():
        tables = input_files.parsed(text, name)
    other, use = text_kind(tables, kind)
    if kind and other not in ("", kind):
        raise CampaignError(f"{name}: is {other}, not {kind}; {use}")
    return tables


def read_text(path: Path) -> str:
    """The text of a campaign file.

    Raises:
        CampaignError: the file is missing, cannot be read, or is a netCDF file.
    """
    with as_campaign_error():
        try:
            return input_files.read_text(path)
        except input_files.NoTextError:
            if not is_netcdf(path):
                raise
            kind = kind_of(path)
            raise CampaignError(f"{path}: is {kind.name}, not a TOML file; {kind.use}") from None
