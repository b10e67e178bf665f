"""Errors that the user can correct, and what their messages add."""

import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .plain import say


def message_of(error: Exception) -> str | None:
    """The message for an error that the user can correct; None of a bug."""
    if isinstance(error, mistakes()):
        return str(error)
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        return f"{ascii(error.object)[1:200]}: the name contains bytes that are not UTF-8; rename the file"
    if isinstance(error, MemoryError):
        return f"not enough memory: {error}" if str(error) else "not enough memory"
    if isinstance(error, OSError):  # from the system: a name that is too long, a full disk
        name = f"{os.fsdecode(error.filename)[:200]}: " if isinstance(error.filename, str | bytes) else ""
        return f"{name}{error.strerror or str(error) or type(error).__name__}"
    return None


def bug_report(error: Exception) -> str:
    """Write the details of a bug to a file; returns a phrase with the error and the path of the file."""
    from warpimpact import __version__

    what = f"{type(error).__name__}: {str(error)[:200]}"
    details = [f"warpimpact {__version__}, Python {sys.version}, {sys.platform}\n", f"{sys.argv[1:]}\n"]
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="warpimpact_bug_", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.writelines([*details, *traceback.format_exception(error)])
    except OSError as failure:
        return f"{what}; no file of details could be written ({failure.strerror})"
    return f"{what}; details are in {file.name}"


def mistakes() -> tuple[type[Exception], ...]:
    """Classes of errors whose message is for the user."""
    from warpimpact.campaign.text import CampaignError
    from warpimpact.results.files import OutputError, ResultError
    from warpimpact.runs.executor import ClusterError
    from warpimpact.solver.device import DeviceError
    from warpimpact.solver.resolution import TooManySteps

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError, TooManySteps


@contextmanager
def implausible_told() -> Iterator[None]:
    """Report implausible values and long computations, each once, as a line on stderr."""
    with warnings.catch_warnings():
        show, shown = warnings.showwarning, set[str]()

        def show_once(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if category.__name__ not in ("Implausible", "Costly"):  # their modules take a while to import
                show(message, category, *place, **more)
            elif str(message) not in shown:
                shown.add(str(message))
                say(f"warning: {message}")

        warnings.showwarning = show_once
        yield


@contextmanager
def memory_told(campaign: Path) -> Iterator[None]:
    """Report a lack of memory, or of time, as an error of the campaign that needs it."""
    from warpimpact.campaign.text import CampaignError
    from warpimpact.solver.resolution import TooManySteps

    try:
        yield
    except (MemoryError, TooManySteps) as error:
        raise CampaignError(f"{campaign}: {error}") from None


@contextmanager
def folder_told(more: str = "") -> Iterator[None]:
    """Add the option that may help to an error of the campaign that a result contains; `more` follows it."""
    from warpimpact.campaign.text import CampaignError

    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; give the folder of the campaign's files with --campaign-folder{more}") from None
