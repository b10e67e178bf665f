"""The title of a figure, broken into lines where it is wider than the figure."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BELOW_THE_TOP = 0.12
"""Of a title [inch]."""
_LETTERS = 9.5
"""In an inch of a title, on average."""


def add_heading(figure: Figure, title: str) -> None:
    """Write a title at the top of a figure.

    Where matplotlib breaks lines, it measures what stands between two dollars as a formula, also where text is no
    formula; it fails there if that is none. Lines with a dollar are broken by their letters.
    """
    inch, formula = 1.0 / figure.get_figheight(), "$" in title
    if formula:
        letters = int(_LETTERS * figure.get_figwidth())
        title = "\n".join(fill(line, letters) for line in title.split("\n"))
    figure.suptitle(title, y=1.0 - _BELOW_THE_TOP * inch, va="top", wrap=not formula)
