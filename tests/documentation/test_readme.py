"""The README: its lines work in order, its links lead somewhere, and the versions agree."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from warpimpact import Campaign
from warpimpact.cli import main

from .smaller import make_campaigns_smaller, smaller

CHECKOUT = Path(__file__).parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
START = (CHECKOUT / "docs" / "start.md").read_text(encoding="utf-8")


def commands() -> list[list[str]]:
    """The command lines under "Use", then those under "Every command" of docs/start.md, without their comments."""
    (task,) = re.findall(r"## Use\n.*?```\n(.*?)```", README, re.DOTALL)
    (every,) = re.findall(r"## Every command\n.*?```\n(.*?)```", START, re.DOTALL)
    return [shlex.split(smaller(line), comments=True) for line in [*task.splitlines(), *every.splitlines()]]


FEWER = {
    "run": ["--count", "40"],
    "compare": ["--count", "32"],
    "continuum": ["--hits", "5", "--element", "1 mm"],
    "report": ["--trajectories", "1"],
    "sensitivity": ["--hits", "16"],
    "test": ["--count", "4"],
}
"""Options with which commands compute less."""


def test_each_line_works_after_those_above_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All of them, on few hits; then the example in Python."""
    monkeypatch.chdir(tmp_path)
    lines = commands()
    assert len(lines) > 10
    for program, command, *rest in lines:
        assert program == "warpimpact"
        code = main([command, *rest, *FEWER.get(command, [])])
        assert not code, f"{command} {shlex.join(rest)}: {capsys.readouterr().err}"
        if command == "new":
            make_campaigns_smaller(tmp_path)
    made = {path.name for path in tmp_path.iterdir()}
    assert {"slotted.toml", "slotted.nc", "slotted.csv", "slots.nc", "slots.html", "slotted_hit34.nc"} <= made
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    few_hits = code.replace('run("addon.toml")', 'run(Campaign.from_toml("addon.toml", count=40))')
    assert few_hits != code
    capsys.readouterr()
    exec(few_hits, {"Campaign": Campaign})
    assert "perforated" in capsys.readouterr().out


def test_every_command_is_shown_at_work(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    daily, expert = re.findall(r":\n((?:    \w+ .*\n)+)", capsys.readouterr().out.partition("options:")[2])[:2]
    names = [re.findall(r"^    (\w+) ", group, re.MULTILINE) for group in (daily, expert)]
    assert names[0] == ["catalogue", "new", "design", "run", "compare", "limit", "optimise", "report"]
    shown = {line[1] for line in commands()} | {"design", "schema"}  # a page until it is left; for editors
    assert shown == {*names[0], *names[1]}


@pytest.mark.parametrize(
    "page", [CHECKOUT / "README.md", *(CHECKOUT / "docs").rglob("*.md")], ids=lambda page: page.stem
)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#: ]+)[)#]", page.read_text(encoding="utf-8"))
    broken = [link for link in links if not (page.parent / link).exists()]
    assert not broken


def test_the_citation_has_the_version_of_the_package() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (CHECKOUT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {project['version']}\n" in citation
    assert f'name: "{project["authors"][0]["name"]}"' in citation
