"""The README: its lines work in order, its links lead somewhere, and the versions agree."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")


def commands() -> list[list[str]]:
    """The command lines under "Use", without their comments."""
    (block,) = re.findall(r"## Use\n.*?```\n(.*?)```", README, re.DOTALL)
    return [shlex.split(line, comments=True) for line in block.splitlines()]


def test_each_line_works_after_those_above_it(tmp_path: Path) -> None:
    """All of them, on few hits; then the example in Python."""
    lines = commands()
    assert len(lines) > 10
    for line in lines:
        assert line[0] == "warpimpact"
        few = ["--count", "128"] if line[1] in ("run", "compare") else []
        few = ["--trajectories", "1"] if line[1] == "report" else few
        few = ["--hits", "2"] if line[1] == "study" else few
        if line[1] == "identify":  # the fit itself takes minutes
            fit = tmp_path / line[2]
            text = fit.read_text(encoding="utf-8")
            fit.write_text(text.replace("sets = 3072\nhits = 512", "sets = 64\nhits = 64"), encoding="utf-8")
            assert fit.read_text(encoding="utf-8") != text
        done = subprocess.run(
            [sys.executable, "-c", "import sys; from warpimpact.cli import main; sys.exit(main())", *line[1:], *few],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{shlex.join(line)}: {done.stderr}"
    made = {path.name for path in tmp_path.iterdir()}
    assert {"slotted.toml", "slotted.nc", "slotted.csv", "slots.nc", "slots.html", "slotted_hit34.nc"} <= made
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    few_hits = code.replace('from_toml("slotted.toml")', 'from_toml("slotted.toml", count=128)')
    assert few_hits != code
    done = subprocess.run([sys.executable, "-c", few_hits], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "perforated" in done.stdout


@pytest.mark.skipif(not (CHECKOUT / ".git").exists(), reason="no checkout")
def test_what_the_lines_write_is_ignored_by_git() -> None:
    made = ["slotted.toml", "slotted.nc", "slotted.nc.parts/lock", "slotted_plate.png", "slotted_hit34_flight.png"]
    made += ["slotted.csv", "slots.html", "round holes.nc", "two_plates.png", "warpimpact.schema.json"]
    done = subprocess.run(
        ["git", "check-ignore", "--stdin"],
        input="\n".join([*made, "pyproject.toml", "README.md"]),
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.replace('"', "").splitlines() == made


def test_every_command_is_in_the_readme_or_in_its_help() -> None:
    shown = subprocess.run(
        [sys.executable, "-c", "from warpimpact.cli import main; main(['--help'])"],
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    assert all(re.search(rf"^    {line[1]}\b", shown, re.MULTILINE) for line in commands())


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
