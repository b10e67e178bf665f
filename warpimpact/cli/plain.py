"""Printed text without control characters, whatever a title or a file contains, because a terminal would obey them."""

import sys
from typing import IO, Any

_MOST_SAID = 2000
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
    cut = line if len(line) <= _MOST_SAID else f"{line[: _MOST_SAID - 1]}…"
    print(f"warpimpact: {cut}", file=Plain(sys.stderr), flush=True)
