"""Numbers, intervals and views as text and as HTML: the same cells, escaped where a browser reads them."""

import math

import pandas as pd
import pytest

from warpimpact.analysis.numbers import html_of, interval_text, number_text, text_of

TABLE = pd.DataFrame(
    {"speed": [123.45, math.nan], "interval": ["1 to 2", ""]}, index=pd.Index(["a", "<b>"], name="plate")
)
VIEW = {"": ["One sentence."], "nothing": [], "Speeds & more": [TABLE, "A note."]}


def test_a_view_as_text_has_a_table_without_the_name_of_its_index_on_a_line_of_its_own() -> None:
    assert text_of(VIEW) == (
        "One sentence.\n\nSpeeds & more\nplate   speed interval\na       123.5   1 to 2\n<b>         -\nA note."
    )


def test_html_has_the_same_cells_and_escapes_them() -> None:
    page = html_of(VIEW)
    assert "<h3>Speeds &amp; more</h3>" in page
    assert [cell in page for cell in ("<th>&lt;b&gt;</th>", "<td>123.5</td>", "<td>-</td>")] == [True] * 3
    assert ("nothing" in page, page.count("<table")) == (False, 1)


@pytest.mark.parametrize(
    ("number", "text"), [(7.77e-14, "0.000"), (-1e-6, "0.000"), (1.5e-5, "1.500e-05"), (math.nan, "-")]
)
def test_what_is_zero_within_rounding_is_shown_as_0(number: float, text: str) -> None:
    assert number_text(number) == text


def test_an_interval_names_what_is_not_known_of_it() -> None:
    nan = math.nan
    assert interval_text(nan, nan, 1.0) == "not determined"
    assert (interval_text(nan, 2.0), interval_text(1.0, nan)) == ("at most 2.000", "at least 1.000")
    assert interval_text(0.1, 0.2, 0.0123, ".1%") == "10.0% to 20.0%, numerics ± 1.2%"
    assert interval_text(0.1, 0.2, 0.0123) == "0.1000 to 0.2000, numerics ± 0.012"
