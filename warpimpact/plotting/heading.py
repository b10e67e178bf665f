"""Title and notes of a figure: the title in one line above it; below it notes on what it shows, and the names of the
catalogue with their evidence."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from matplotlib.font_manager import FontProperties

from warpimpact.results import attributes as attr

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

_FROM_EDGE = 0.12
"""Distance of title and notes from the edge of a figure without layout engine [inch]."""
_TITLE_SIZE, _SMALLEST_TITLE = 12.0, 9.0
"""Font sizes of a title [pt]: the usual one, and the smallest for a long title."""
_TITLE_LETTERS, _NOTE_LETTERS = 10.0, 15
"""Average number of letters in an inch of a title of the first size, and of a note."""
LINE = 0.15
"""Height of a line of a note [inch]."""


def add_heading(figure: Figure, title: str, *notes: str) -> None:
    """Write a title in one line at the top of a figure, and each note from a line of its own below the figure.

    A long title is written smaller. A title that is still wider than the figure is cut, and stands whole before the
    notes.
    """
    line, size = _in_one_line(title, figure.get_figwidth())
    placed = figure.get_layout_engine() is None
    top = {"y": 1.0 - _FROM_EDGE / figure.get_figheight(), "va": "top"} if placed else {}
    figure.suptitle(line, fontsize=size, **top)
    lines = note_lines(figure.get_figwidth(), title, notes)
    if lines:
        _write_notes(figure, "\n".join(lines))


def inscribe(figure: Figure, dataset: xarray.Dataset, *notes: str, title: str = "") -> None:
    """Write the title of a result, or another title, over a figure; below it the notes and the names of the
    catalogue."""
    run_title = str(dataset.attrs.get(attr.TITLE, ""))
    add_heading(figure, title or run_title, *([run_title] if title else []), *notes, *names(dataset))


def inscribe_hit(figure: Figure, history: xarray.Dataset, what: str) -> None:
    """Write the number of a replayed hit and what is shown of it over a figure, its result's title and names below."""
    inscribe(figure, history, title=f"hit {history.attrs[attr.HIT]}: {what}")


def legend_below(figure: Figure, columns: int | None = None) -> None:
    """Add one legend of all panels, each label once, below a figure with a layout engine; in one row without a number
    of columns. Notes of the figure become its title, because nothing else keeps both apart."""
    entries: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    columns = columns or len(entries)
    figure.legend(entries.values(), entries, loc="outside lower center", ncols=columns, frameon=False)
    if notes := figure.get_supxlabel():
        figure.supxlabel("")
        _write_notes(figure, notes)


def note_lines(width: float, title: str, notes: Sequence[str]) -> list[str]:
    """Lines of the notes below a figure of this width [inch]."""
    cut = [title] if _in_one_line(title, width)[0] != title else []
    return [line for note in [*cut, *notes] for line in wrap(note, int(_NOTE_LETTERS * width))]


def names(dataset: xarray.Dataset) -> list[str]:
    """A line for each name of the catalogue that a result has, with how well it is known."""
    return list(dataset.attrs.get(attr.CATALOGUE_NAMES, "").splitlines())


def _in_one_line(title: str, width: float) -> tuple[str, float]:
    """A title that fits into a width [inch], and its font size [pt]."""
    line, letters = " ".join(title.split()), _TITLE_LETTERS * width
    size = max(_SMALLEST_TITLE, min(_TITLE_SIZE, _TITLE_SIZE * letters / max(len(line), 1)))
    most = int(letters * _TITLE_SIZE / size)
    return (line if len(line) <= most else line[: most - 1].rstrip() + "…"), size


def _write_notes(figure: Figure, text: str) -> None:
    """Write the notes below all else; over the legend where a layout engine has placed one there."""
    if figure.get_layout_engine() is None:
        place = {"y": _FROM_EDGE / figure.get_figheight(), "va": "bottom"}
        figure.supxlabel(text, fontsize="small", color="0.3", **place)
    elif figure.legends:
        (legend,) = figure.legends
        legend.set_title(text, prop=FontProperties(size="small"))
        legend.get_title().set_color("0.3")
    else:
        figure.supxlabel(text, fontsize="small", color="0.3")
