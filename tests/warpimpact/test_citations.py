"""Citations of the model: every section that a file cites is a heading of docs/model.md. § stands for nothing else."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("warpimpact", "kernels", "tests", "campaigns", "docs")
SUFFIXES = {".py", ".md", ".toml"}

NUMBER = r"\d+(?:\.\d+|b\b)?"
HEADING = re.compile(rf"^#{{2,3}} ({NUMBER}) ", re.MULTILINE)
CITATION = re.compile(rf"§+({NUMBER}(?:(?:, | and | to |–)§?{NUMBER})*)")  # also §6.1 to 6.3; §4, 5; §§1–5
FORMER_NAME = re.compile(r"\bMODEL(?:\.md|\s*§)")


def cited_sections(text: str) -> Iterator[tuple[int, str]]:
    """Line and section of every citation; of a range its ends."""
    for match in CITATION.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        yield from ((line, section) for section in re.findall(NUMBER, match[1]))


def sources() -> list[Path]:
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*")] + list(ROOT.iterdir())
    return sorted(path for path in files if path.suffix in SUFFIXES and path.is_file())


@pytest.fixture(scope="module")
def sections() -> set[str]:
    return set(HEADING.findall((ROOT / "docs" / "model.md").read_text(encoding="utf-8")))


def test_the_model_has_its_sections(sections: set[str]) -> None:
    assert {*map(str, range(1, 10)), "7b", *(f"6.{number}" for number in range(1, 11))} <= sections


@pytest.mark.parametrize(
    ("text", "cited"),
    [
        (f"a\n(docs/model.md §{4}).", [(2, "4")]),
        (f"docs/model.md §{5}, 6.5, 6.10", [(1, "5"), (1, "6.5"), (1, "6.10")]),
        (f"docs/model.md §{6}.1 to 6.3's", [(1, "6.1"), (1, "6.3")]),
        (f"docs/model.md §§{1}–5, §{7}b and §{8}", [(1, "1"), (1, "5"), (1, "7b"), (1, "8")]),
    ],
)
def test_citations_are_read(text: str, cited: list[tuple[int, str]]) -> None:
    assert list(cited_sections(text)) == cited


def test_every_cited_section_exists(sections: set[str]) -> None:
    cited = [
        (f"{path.relative_to(ROOT)}:{line}", section)
        for path in sources()
        for line, section in cited_sections(path.read_text(encoding="utf-8"))
    ]
    assert len(cited) > 50  # the search finds the files at all
    broken = [f"{place} cites §{section}" for place, section in cited if section not in sections]
    assert not broken, f"docs/model.md has no such section: {broken}"


def test_no_file_cites_a_former_name_of_the_model() -> None:
    former = [str(p.relative_to(ROOT)) for p in sources() if FORMER_NAME.search(p.read_text(encoding="utf-8"))]
    assert not former, f"cite docs/model.md in the place of MODEL: {former}"
