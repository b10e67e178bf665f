"""Errors that the user can correct, what their messages add, and printed text without control characters.

A title or a file may contain control characters, which a terminal would obey.
"""

import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any


def message_of(error: Exception) -> str | None:
    """The message for an error that the user can correct; None of a bug."""
    if isinstance(error, _user_errors()):
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


def _user_errors() -> tuple[type[Exception], ...]:
    """Classes of errors whose message is for the user."""
    from warpimpact.campaign.text import CampaignError
    from warpimpact.results.files import OutputError, ResultError
    from warpimpact.runs.executor import ClusterError
    from warpimpact.solver.device import DeviceError
    from warpimpact.solver.resolution import TooManySteps

    return CampaignError, ClusterError, OutputError, ResultError, DeviceError, TooManySteps


@contextmanager
def show_warnings() -> Iterator[None]:
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
def suggest_campaign_folder(more: str = "") -> Iterator[None]:
    """Add the option that may help to an error of the campaign that a result contains; `more` follows it."""
    from warpimpact.campaign.text import CampaignError

    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; give the folder of the campaign's files with --campaign-folder{more}") from None


_LONGEST_SENTENCE = 2000
"""Most characters of a sentence on the error stream."""


class Plain:
    """A stream that spells out control characters, except ends of lines and tabulators.

    Args:
        stream: stream to which the text goes.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write the text. Characters that the stream's encoding lacks are spelt out, too."""
        encoding = getattr(self._stream, "encoding", None) or "utf-8"
        self._stream.write(plain(text, "\n\t").encode(encoding, "backslashreplace").decode(encoding))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Take all other attributes from the stream."""
        return getattr(self._stream, name)


def plain(text: str, keep: str = "") -> str:
    """The text with its control characters spelt out, except those in `keep`."""
    return "".join(
        character if character.isprintable() or character in keep else ascii(character)[1:-1] for character in text
    )


def say(sentence: str) -> None:
    """Write one sentence for the user, on one line of the error stream."""
    line = plain(sentence)
    cut = line if len(line) <= _LONGEST_SENTENCE else f"{line[: _LONGEST_SENTENCE - 1]}…"
    print(f"warpimpact: {cut}", file=Plain(sys.stderr), flush=True)
