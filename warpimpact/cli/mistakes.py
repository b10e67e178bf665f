"""Errors that the user can correct, and what their messages add."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def mistakes() -> tuple[type[Exception], ...]:
    """Classes of errors whose message is for the user."""
    from warpimpact.campaign.campaign import CampaignError
    from warpimpact.campaign.team import ClusterError
    from warpimpact.results.files import OutputError, ResultError
    from warpimpact.solver.device import DeviceError

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError


@contextmanager
def memory_told(campaign: Path) -> Iterator[None]:
    """Report a lack of memory as an error of the campaign that needs it."""
    from warpimpact.campaign.campaign import CampaignError

    try:
        yield
    except MemoryError as error:
        raise CampaignError(f"{campaign}: {error}") from None


@contextmanager
def folder_told(more: str = "") -> Iterator[None]:
    """Add the option that may help to an error of the campaign that a result contains; `more` follows it."""
    from warpimpact.campaign.campaign import CampaignError

    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; give the folder of the campaign's files with --campaign-folder{more}") from None
