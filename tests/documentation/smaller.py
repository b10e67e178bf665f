"""Examples of the pages on few hits: pages show how commands are used, and their results are not looked at."""

import re
from pathlib import Path

MOST = {"count": 64, "hits": 32, "designs": 12, "sets": 128}
"""Largest values of keys of a campaign, and of arguments with these names."""


def smaller(text: str) -> str:
    """A campaign, a line of a shell or code with smaller numbers of hits, designs and sets of parameters."""
    text = re.sub(r"\beffective = \d+", f"sets = {MOST['sets']}", text)
    text = re.sub(r"(continuum \S+) --hits \d+", r"\1 --hits 5 --element 1mm", text)
    return re.sub(rf"\b({'|'.join(MOST)})( ?= ?| )(\d+)\b", _at_most, text)


def _at_most(given: re.Match[str]) -> str:
    key, sign, number = given.groups()
    return f"{key}{sign}{min(int(number), MOST[key])}"


def make_campaigns_smaller(folder: Path) -> None:
    """The same for the campaigns of a folder."""
    for file in folder.glob("*.toml"):
        file.write_text(smaller(file.read_text(encoding="utf-8")), encoding="utf-8")
