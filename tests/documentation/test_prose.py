"""Sentences of the pages are short, and their words are those of the glossary.

`python tests/documentation/test_prose.py` prints words, sentences, mean and 90th percentile of every page.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

CHECKOUT = Path(__file__).parents[2]
PAGES = [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").rglob("*.md"))]
MEAN, NINETIETH = 17.0, 24.0
"""Words of a sentence, at most: the mean of a page, and its 90th percentile."""

SMALLEST_SAMPLE = 5
"""Sentences below which a page has no percentile."""

CELL = 8
"""Words from which on a cell of a table counts as a sentence; shorter ones are numbers and names."""


PRIVATE = ("told apart", "promise", "beyond them", "rows left out", "nobody measured")
"""Words of this house that no page needs."""


def prose(page: str) -> Iterator[str]:
    """Paragraphs, list items, definitions and long cells of a page, without code, formulas and directives."""
    page = re.sub(r"\A---\n.*?\n---\n", "", page, flags=re.DOTALL)
    page = re.sub(r"^```\{(?:glossary|warning|note)\}\n(.*?)^```", r"\n\1", page, flags=re.DOTALL | re.MULTILINE)
    page = re.sub(r"^```.*?^```|^\$\$.*?\$\$\s*$|<!--.*?-->", "\n", page, flags=re.DOTALL | re.MULTILINE)
    page = re.sub(r"!\[[^]]*\]\([^)]*\)|^#.*$|^\* \* \*$", "\n", page, flags=re.MULTILINE)
    page = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", page)
    page = re.sub(r"`[^`]*`|\$[^$]*\$", "X", page)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )|\n(?=\|)", page):
        if block.lstrip().startswith("|"):
            yield from (cell for cell in block.split("|") if len(words(cell)) >= CELL)
        else:
            yield re.sub(r"^\s*(?:[-*]|\d+\.) ", "", block)


def words(text: str) -> list[str]:
    """Words and numbers of a text."""
    return re.findall(r"[^\W_][\w.,'’°%/×^²³-]*", text)


def sentence_lengths(page: str) -> list[int]:
    """Words of each sentence of a page; three and fewer are a label."""
    sentences = (part for block in prose(page) for part in re.split(r"(?<=[.!?])[*)\"]*\s+(?=[\W_]*[A-Z0-9])", block))
    return [count for sentence in sentences if (count := len(words(sentence))) > 3]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(CHECKOUT)))
def test_sentences_are_short(page: Path) -> None:
    lengths = sentence_lengths(page.read_text(encoding="utf-8"))
    if len(lengths) >= SMALLEST_SAMPLE:
        assert np.mean(lengths) <= MEAN
        assert np.quantile(lengths, 0.9) <= NINETIETH


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(CHECKOUT)))
def test_words_are_those_of_the_field(page: Path) -> None:
    blocks = " ".join(" ".join(prose(page.read_text(encoding="utf-8"))).lower().split())
    assert not [word for word in PRIVATE if word in blocks]


def test_a_sentence_is_measured() -> None:
    page = "# Title\n\nOne two three [four](five.md) `six seven`. Two of `a b` and $c d$ are six.\n\n- a b c d e\n"
    assert sentence_lengths(page) == [5, 7, 5]


if __name__ == "__main__":
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        lengths = sentence_lengths(text) or [0]
        figures = f"{len(text.split()):6} {len(lengths):5} {np.mean(lengths):6.1f} {np.quantile(lengths, 0.9):6.1f}"
        print(figures, path.relative_to(CHECKOUT))
