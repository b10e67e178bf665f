"""Mistakes that a person can put right, and what they are told."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def mistakes() -> tuple[type[Exception], ...]:
    """Errors whose message is for the user."""
    from warpimpact.campaign.campaign import CampaignError
    from warpimpact.campaign.team import ClusterError
    from warpimpact.results.files import OutputError, ResultError
    from warpimpact.solver.device import DeviceError

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError


@contextmanager
def implausible_told() -> Iterator[None]:
    """A value that is probably not what was meant gets a line on stderr, once."""
    with warnings.catch_warnings():
        show, told = warnings.showwarning, set[str]()

        def show_once(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if category.__name__ != "Implausible":  # its module takes a while to import
                show(message, category, *place, **more)
            elif str(message) not in told:
                told.add(str(message))
                print(f"warpimpact: warning: {message}", file=sys.stderr)

        warnings.showwarning = show_once
        yield


@contextmanager
def memory_told(campaign: Path) -> Iterator[None]:
    """Memory that cannot be had is a mistake of the campaign that asks for it."""
    from warpimpact.campaign.campaign import CampaignError

    try:
        yield
    except MemoryError as error:
        raise CampaignError(f"{campaign}: {error}") from None


@contextmanager
def folder_told(more: str = "") -> Iterator[None]:
    """What is wrong with the campaign that a result carries, with the option that may help, and more."""
    from warpimpact.campaign.campaign import CampaignError

    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; --campaign-folder tells where the campaign's files are{more}") from None
