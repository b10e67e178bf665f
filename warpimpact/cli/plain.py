"""What is printed: text alone, whatever a title or a file holds; a terminal would obey control characters."""

import sys
from typing import IO, Any

_MOST_SAID = 2000
"""Characters of a sentence on the error stream."""


class Plain:
    """A stream that spells control characters out, but for ends of lines and tabulators.

    Args:
        stream: where the text goes.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write the text; what the stream's encoding lacks is spelt out, too."""
        encoding = getattr(self._stream, "encoding", None) or "utf-8"
        self._stream.write(plain(text, "\n\t").encode(encoding, "backslashreplace").decode(encoding))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """All else is the stream's own."""
        return getattr(self._stream, name)


def plain(text: str, keep: str = "") -> str:
    """The text with its control characters, but for those in `keep`, spelt out."""
    return "".join(
        character if character.isprintable() or character in keep else ascii(character)[1:-1] for character in text
    )


def say(sentence: str) -> None:
    """Tell a person one sentence, on one line of the error stream."""
    line = plain(sentence)
    cut = line if len(line) <= _MOST_SAID else f"{line[: _MOST_SAID - 1]}…"
    print(f"warpimpact: {cut}", file=Plain(sys.stderr), flush=True)
