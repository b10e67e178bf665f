"""The text of a campaign, TOML or JSON, read and parsed but not validated."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpimpact.records.kinds import text_kind

from ..errors import CampaignError, ClusterError, DeviceError, OutputError, ResultError
from ..scene import input_files
from ..scene.model import sentence


@contextmanager
def as_campaign_error(place: str = "", tables: Mapping[str, Any] | None = None, *, file: str = "") -> Iterator[None]:
    """Raise a ValueError, as of a model of tables, as a CampaignError, with file and place before its sentence.

    Errors of a device, a cluster or a file are none of the campaign.
    """
    try:
        yield
    except (ClusterError, DeviceError, OutputError, ResultError):
        raise
    except ValueError as error:
        text = sentence(error, dict(tables or {})) if isinstance(error, ValidationError) else error
        raise CampaignError(f"{place}{text}", file) from None


def parsed(text: str, name: str, kind: str = "") -> dict[str, Any]:
    """The tables of a campaign, TOML or JSON, not yet validated.

    Raises:
        CampaignError: the text is neither, or is another kind of file; `name` is its name in the message.
    """
    with as_campaign_error():
        tables = input_files.parsed(text, name)
    other, use = text_kind(tables, kind)
    if kind and other not in ("", kind):
        raise CampaignError(f"is {other}, not {kind}; {use}", name)
    return tables


def read_text(path: Path) -> str:
    """The text of a campaign file.

    Raises:
        CampaignError: the file is missing, cannot be read, or is a netCDF file.
    """
    with as_campaign_error():
        input_files.check_file(path)
        if input_files.is_netcdf(path):
            raise ValueError(f"{path}: is a netCDF file, not a TOML file; warpimpact inspect {path} says what it holds")
        return input_files.read_text(path)
