"""A view as text and as HTML: the same cells, escaped where a browser reads them."""

import math

from warpimpact.view.view import Column, Section, Table, html_of, labelled, number, text_of

TABLE = Table(
    (Column("plate"), number("speed", "m/s", ".1f"), Column("interval")),
    [("a", 123.45, "1 to 2"), ("<b>", math.nan, None)],
)
SECTIONS = [
    Section(["One sentence."]),
    Section([]),
    Section([TABLE, "A note."], "Speeds & more"),
    Section([labelled([("hits", "4"), ("made by", "x")])]),
]


def test_text_aligns_numbers_at_the_right_and_words_at_the_left() -> None:
    assert text_of(SECTIONS) == (
        "One sentence.\n\n"
        "Speeds & more\n"
        "plate   speed [m/s]   interval\n"
        "a             123.5   1 to 2\n"
        "<b>               -\n"
        "A note.\n\n"
        "hits      4\n"
        "made by   x"
    )


def test_html_has_the_same_cells_and_escapes_them() -> None:
    page = html_of(SECTIONS)
    assert "<h3>Speeds &amp; more</h3>" in page
    assert '<tr><td>&lt;b&gt;</td><td class="number">-</td><td></td></tr>' in page
    assert '<td class="number">123.5</td>' in page
    assert page.count("<table>") == 2
    assert page.count("<th") == 3  # labels and their values have no head


def test_a_head_wider_than_its_column_goes_on_in_the_next_line() -> None:
    table = Table((number("energy per presented area at 130 mm", "J/mm²"), Column("design")), [(1.0, "a.toml")])
    assert text_of([Section([table])]).splitlines() == [
        "  energy per presented",
        "area at 130 mm [J/mm²]   design",
        "                 1.000   a.toml",
    ]
    long_word = Table((number("plate.pattern[round].diameter", "mm"), Column("design")), [(8.0, "a.toml")])
    assert text_of([Section([long_word])]).splitlines()[0] == "plate.pattern[round].diameter"
