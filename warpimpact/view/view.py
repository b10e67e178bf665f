"""A view of a result as data: sections of sentences and tables, which `text_of` and `html_of` write.

A room declares what a result shows: columns with header, unit and format, and rows of numbers. Widths, alignment and
markup are decided here, so the terminal, a report and a notebook show the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from textwrap import wrap
from typing import Any, NamedTuple

_GAP = "   "
"""Space between two columns of a text."""
_HEAD = 24
"""Most characters of a header in a line of text if its column is narrower."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        header: text above the column. A table none of whose columns has a header has no head.
        unit: unit of its numbers as people write it.
        write: gives the text of a value. A text in a row stays as it is, and None leaves its cell empty.
        right: whether the cells are aligned at their right end.
    """

    header: str = ""
    unit: str = ""
    write: Callable[[Any], str] = str
    right: bool = False

    @property
    def head(self) -> str:
        """Header and unit."""
        return f"{self.header} [{self.unit}]".strip() if self.unit else self.header

    def cell(self, value: Any) -> str:
        """The text of a value in a row."""
        return value if isinstance(value, str) else "" if value is None else self.write(value)


def number(header: str = "", unit: str = "", digits: str = "#.4g") -> Column:
    """A column of numbers, written with a format such as ".3f"; a dash stands for NaN."""
    return Column(header, unit, lambda value: "-" if math.isnan(value) else format(value, digits), right=True)


@dataclass(frozen=True)
class Table:
    """Rows of values under their columns."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]

    @property
    def heads(self) -> list[str]:
        """Headers with units; empty if no column has one."""
        heads = [column.head for column in self.columns]
        return heads if any(heads) else []

    @property
    def cells(self) -> list[list[str]]:
        """Texts of all rows."""
        return [[column.cell(value) for column, value in zip(self.columns, row, strict=True)] for row in self.rows]


def labelled(rows: Iterable[tuple[str, str]]) -> Table:
    """A table of labels and their texts."""
    return Table((Column(), Column()), list(rows))


@dataclass(frozen=True)
class Section:
    """A part of a view.

    Attributes:
        parts: sentences and tables, in their order.
        title: its heading; empty if it has none.
    """

    parts: Sequence[str | Table]
    title: str = ""


def text_of(sections: Iterable[Section]) -> str:
    """The view as plain text, with an empty line between sections; a section without parts is left out."""
    return "\n\n".join("\n".join(_lines(section)) for section in sections if section.parts)


def _lines(section: Section) -> Iterable[str]:
    if section.title:
        yield section.title
    for part in section.parts:
        yield from [part] if isinstance(part, str) else _table_lines(part)


def _table_lines(table: Table) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*table.cells, strict=True)] or [0] * len(table.columns)
    heads = [
        wrap(head, max(width, _HEAD), break_long_words=False) for head, width in zip(table.heads, widths, strict=False)
    ]
    tallest = max(map(len, heads), default=0)
    rows = zip(*([""] * (tallest - len(head)) + head for head in heads), strict=True)
    lines = [*map(list, rows), *table.cells]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    sides = [">" if column.right else "<" for column in table.columns]
    return [
        _GAP.join(f"{cell:{side}{width}}" for cell, side, width in zip(line, sides, widths, strict=True)).rstrip()
        for line in lines
    ]


def html_of(sections: Iterable[Section], heading: str = "h3") -> str:
    """The view as HTML; all its text is escaped."""
    parts = []
    for section in sections:
        if section.title and section.parts:
            parts.append(f"<{heading}>{escape(section.title)}</{heading}>")
        parts += [f"<p>{escape(part)}</p>" if isinstance(part, str) else table_html(part) for part in section.parts]
    return "\n".join(parts)


def table_html(table: Table, caption: str = "") -> str:
    """A table as HTML; numbers have the class "number", and what is wider than the page scrolls."""
    kinds = [' class="number"' if column.right else "" for column in table.columns]
    lines = [f"<caption>{escape(caption)}</caption>"] if caption else []
    for tag, row in [*([("th", table.heads)] if table.heads else []), *(("td", row) for row in table.cells)]:
        cells = (f"<{tag}{kind}>{escape(cell)}</{tag}>" for kind, cell in zip(kinds, row, strict=True))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return '<div class="wide"><table>' + "\n".join(lines) + "</table></div>"
