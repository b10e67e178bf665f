"""Numbers, intervals, tables and views as text and HTML.

A view is what a person sees of a result: sentences and tables by the heading above them. A room makes its view as
a plain dict of strings and DataFrames; here it becomes the text of a terminal, and the HTML of a notebook or a page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, TypeAlias

import pandas as pd

from warpimpact.measures.measure import Measure

View: TypeAlias = Mapping[str, Sequence[str | pd.DataFrame]]
"""Sentences and tables by their heading, which may be empty. The index of a table labels its rows."""

ROUNDING = 1e-5
"""Largest number that is shown as 0. In display units, smaller numbers are rounding of the computation."""
NOT_DETERMINED = "not determined"


def number_text(number: float, digits: str = "#.4g") -> str:
    """A number in a format; a dash for NaN, and 0 for what is 0 within rounding."""
    return "-" if math.isnan(number) else format(0.0 if abs(number) < ROUNDING else number, digits)


def interval_text(low: float, high: float, numerics: float = math.nan, digits: str = "#.4g") -> str:
    """A confidence interval by the hits, and the largest shift by the numerics where it is known."""
    below, above = (number_text(end, digits) for end in (low, high))
    if math.isnan(low) and math.isnan(high):
        return NOT_DETERMINED
    interval = f"at most {above}" if math.isnan(low) else f"at least {below}" if math.isnan(high) else ""
    interval = interval or f"{below} to {above}"
    if math.isnan(numerics):
        return interval
    return f"{interval}, numerics ± {number_text(numerics, digits if digits[-1] in 'f%' else '.2g')}"


def digits_of(measure: Measure) -> str:
    """Format of the values of a measure: percent for shares, and four digits for others."""
    return "#.4g" if measure.display.stored != "1" else ".1%" if measure.is_binary else ".2%"


def value_text(measure: Measure, value: float, low: float, high: float, numerics: float = math.nan) -> str:
    """A value of a measure with its interval as far as it is determined."""
    digits = digits_of(measure)
    interval = "" if math.isnan(low) and math.isnan(high) else f" ({interval_text(low, high, numerics, digits)})"
    return number_text(value, digits) + interval


def difference_text(measure: Measure, value: float, low: float, high: float) -> str:
    """A difference of values of a measure with its interval; of shares in percentage points."""
    is_share = digits_of(measure)[-1] == "%"
    digits, unit, factor = ("+.1f", " points", 100.0) if is_share else ("+#.3g", "", 1.0)
    interval = interval_text(factor * low, factor * high, digits=digits)
    return f"{number_text(factor * value, digits)}{unit} ({interval})"


def rows_of(table: pd.DataFrame) -> Iterable[Any]:
    """The rows of a table as named tuples, whose label is `Index`."""
    return table.itertuples()


def text_of(view: View) -> str:
    """A view as plain text, an empty line between sections, two spaces between the columns of a table; a heading
    without parts is left out."""

    def table_text(table: pd.DataFrame) -> str:
        cells = _labelled(table).map(lambda cell: f" {number_text(cell) if isinstance(cell, float) else cell}")
        text = cells.to_string(header=any(map(str.strip, table.columns)))
        return "\n".join(map(str.rstrip, text.splitlines()))

    sections = []
    for heading, parts in view.items():
        texts = [part if isinstance(part, str) else table_text(part) for part in parts]
        sections += ["\n".join([*([heading] if heading else []), *texts])] if texts else []
    return "\n\n".join(sections)


def html_of(view: View, tag: str = "h3") -> str:
    """A view as HTML; all its text is escaped."""
    parts = []
    for heading, content in view.items():
        parts += [f"<{tag}>{escape(heading)}</{tag}>"] if heading and content else []
        parts += [f"<p>{escape(part)}</p>" if isinstance(part, str) else table_html(part) for part in content]
    return "\n".join(parts)


def table_html(table: pd.DataFrame, caption: str = "") -> str:
    """A table as HTML, which scrolls where it is wider than the page."""
    with pd.option_context("display.max_colwidth", None):
        html = _labelled(table).to_html(float_format=number_text, na_rep="-", border=0)
    head, rest = html.split("\n", 1)
    caption = f"<caption>{escape(caption)}</caption>\n" if caption else ""
    return f'<div class="wide">{head}\n{caption}{rest}</div>'


def _labelled(table: pd.DataFrame) -> pd.DataFrame:
    """The table with one index, whose name is in the line of the other headers."""
    table = table.reset_index(level=[*range(1, table.index.nlevels)]) if table.index.nlevels > 1 else table
    return table.rename_axis(index=None).rename_axis(columns=str(table.index.name or ""))
