"""What stands over a figure: the title, broken into lines where it is wider than the figure, and the names of the
catalogue with their evidence."""

from __future__ import annotations

from textwrap import fill, wrap
from typing import TYPE_CHECKING

from warpimpact.results import attributes as attr

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_WIDTH = 80
_BELOW_THE_TOP = 0.12
"""Distance of a title from the top of the figure [inch]."""
_LETTERS = 9.5
"""Average number of letters in an inch of a title."""


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


def heading(dataset: xarray.Dataset, width: int = _WIDTH) -> str:
    """The title of a result; below it a line of at most `width` characters, or several, for every name."""
    return "\n".join([dataset.attrs.get(attr.TITLE, ""), *names(dataset, width)])


def names(dataset: xarray.Dataset, width: int = _WIDTH) -> list[str]:
    """Lines of the names of the catalogue that a result has, each with the state of its evidence."""
    lines = dataset.attrs.get(attr.EVIDENCE, "").splitlines()
    named = [line for line in lines if not line.startswith((attr.RESTS_ON, attr.NOT_TESTED))]
    return [part for line in named for part in wrap(line, width)]
