"""Every section (§) of the model that a file cites is a heading or a row of docs/model.md."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NUMBER = r"\d+(?:\.\d+)?"
HEADING = re.compile(rf"^(?:#{{2,3}}|\|) ({NUMBER}) ", re.MULTILINE)  # known answers are rows of a table
CITATION = re.compile(rf"§+({NUMBER}(?:(?:, | and | to |–)§?{NUMBER})*)")  # also §6.1 to 6.3; §4, 5; §§1–5


def test_every_cited_section_exists() -> None:
    sections = set(HEADING.findall((ROOT / "docs" / "model.md").read_text(encoding="utf-8")))
    assert {*map(str, range(1, 9)), *(f"6.{number}" for number in range(1, 11))} <= sections
    folders = ("warpimpact", "kernels", "tests", "campaigns", "docs")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*")] + list(ROOT.iterdir())
    cited = [
        (path.name, section)
        for path in files
        if path.suffix in {".py", ".md", ".toml"} and path.is_file()
        for several in CITATION.findall(path.read_text(encoding="utf-8"))
        for section in re.findall(NUMBER, several)
    ]
    assert len(cited) > 50  # the search finds the files at all
    assert not [one for one in cited if one[1] not in sections]
