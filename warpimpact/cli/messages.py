"""What the command prints next to its output: errors, warnings and its log, without control characters.

A title or a file may contain control characters, which a terminal would obey.
"""

import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

from warpimpact.errors import WarpImpactError, WarpImpactWarning

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
        self._stream.write(_plain(text, "\n\t").encode(encoding, "backslashreplace").decode(encoding))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Take all other attributes from the stream."""
        return getattr(self._stream, name)


def _plain(text: str, keep: str = "") -> str:
    """Spell out the control characters of a text, except those in `keep`."""
    return "".join(one if one.isprintable() or one in keep else ascii(one)[1:-1] for one in text)


def say(sentence: str) -> None:
    """Write one sentence for the user, on one line of the error stream."""
    print(f"warpimpact: {_plain(sentence)[:_LONGEST_SENTENCE]}", file=Plain(sys.stderr), flush=True)


def warn(sentence: str) -> None:
    """Warn the user while the command goes on."""
    say(f"warning: {sentence}")


@contextmanager
def show_warnings() -> Iterator[None]:
    """Report the package's own warnings, each once, as a line on stderr."""
    with warnings.catch_warnings():
        show, shown = warnings.showwarning, set[str]()

        def show_once(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if not issubclass(category, WarpImpactWarning):
                show(message, category, *place, **more)
            elif str(message) not in shown:
                shown.add(str(message))
                warn(str(message))

        warnings.showwarning = show_once
        yield


def show_log(verbose: int) -> None:
    """Show the log of the package: from INFO on at 1, from DEBUG on at 2."""
    logger = logging.getLogger("warpimpact")
    logger.handlers.clear()
    if verbose:
        handler = logging.StreamHandler(Plain(sys.stderr))
        handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s", "%H:%M:%S"))
        logger.addHandler(handler)
        logger.setLevel(logging.INFO if verbose == 1 else logging.DEBUG)


def message_of(error: Exception) -> str | None:
    """Return the message for an error that the user can correct; None for a bug."""
    if isinstance(error, WarpImpactError):
        return str(error)
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        return f"{ascii(error.object)[1:200]}: the name contains bytes that are not UTF-8; rename the file"
    if isinstance(error, MemoryError):
        return f"not enough memory: {error}" if str(error) else "not enough memory"
    if isinstance(error, OSError):  # from the system: a name that is too long, a full disk
        name = f"{os.fsdecode(error.filename)[:200]}: " if isinstance(error.filename, str | bytes) else ""
        return f"{name}{error.strerror or str(error) or type(error).__name__}"
    return None
