"""README, start page and tutorials: their lines and cells run in order, and links lead somewhere.

All cells run in this process, the command as well: `make docs` executes them in notebooks.
"""

import ast
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from IPython.core.inputtransformer2 import TransformerManager
from IPython.display import Image
from matplotlib import pyplot
from matplotlib.figure import Figure

from warpimpact import Campaign
from warpimpact.cli import main

MOST = {"count": 64, "hits": 32, "designs": 8, "sets": 64}
"""Largest values of keys of a campaign, and of arguments with these names."""


def smaller(text: str) -> str:
    """A campaign, a line of a shell or code with fewer hits, designs and sets of parameters, a coarse level, larger
    elements, and one hit by them."""
    text = re.sub(r"\beffective = \d+", f"sets = {MOST['sets']}", text)
    text = re.sub(r'\bfidelity = "(standard|draft)"', "level = 0", text)
    text = re.sub(r"(continuum \S+) --hits \d+", r"\1 --hits 5 --element 2mm", text)
    text = re.sub(r"(from_toml\(files\(.*\))$", r"\1.with_continuum_hits(1)", text, flags=re.MULTILINE)
    return re.sub(rf"\b({'|'.join(MOST)})( ?= ?| )(\d+)\b", _at_most, text)


def _at_most(given: re.Match[str]) -> str:
    key, sign, number = given.groups()
    return f"{key}{sign}{min(int(number), MOST[key])}"


def make_campaigns_smaller(folder: Path) -> None:
    """The same for the campaigns of a folder, and bare cores; a tutorial has whole bullets."""
    for file in folder.glob("*.toml"):
        text = smaller(file.read_text(encoding="utf-8"))
        few = 'spacing = "1.5 mm"\nbullet = "core"\nhits = 1'
        file.write_text(re.sub(r"^hits = 12\b", few, text, flags=re.M), encoding="utf-8")


CHECKOUT = Path(__file__).parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
START = (CHECKOUT / "docs" / "start.md").read_text(encoding="utf-8")


def commands() -> list[list[str]]:
    """The command lines under "Use", then those under "Every command" of docs/start.md, without their comments."""
    (task,) = re.findall(r"## Use\n.*?```\n(.*?)```", README, re.DOTALL)
    (every,) = re.findall(r"## Every command\n.*?```\n(.*?)```", START, re.DOTALL)
    return [shlex.split(smaller(line), comments=True) for line in [*task.splitlines(), *every.splitlines()]]


def test_every_command_is_shown_at_work(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    names = re.findall(r"^    (\w+) ", capsys.readouterr().out, re.MULTILINE)
    shown = {line[1] for line in commands()} | {"design", "schema"}  # a page until it is left; for editors
    assert len(names) > 15
    assert shown == {*names} - {"warpimpact"}


FEWER = {
    "run": ["--count", "40"],
    "compare": ["--count", "32"],
    "report": ["--trajectories", "1"],
    "sensitivity": ["--hits", "16"],
    "sweep": ["--count", "8"],
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
    assert "P(base_perforated)" in capsys.readouterr().out


@pytest.mark.parametrize(
    "page", [CHECKOUT / "README.md", *(CHECKOUT / "docs").rglob("*.md")], ids=lambda page: page.stem
)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#: ]+)[)#]", page.read_text(encoding="utf-8"))
    broken = [link for link in links if not (page.parent / link).exists()]
    assert not broken


TUTORIALS = CHECKOUT / "docs" / "tutorials"
PROGRAMS = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


def cells(page: Path) -> list[str]:
    """The code cells of a page, without those that it hides."""
    code = re.findall(r"```\{code-cell\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [cell for cell in code if "remove-cell" not in cell]


def shell(line: str) -> None:
    """Run a line that begins with "!"; the command runs in this process, where no other program takes its output."""
    if line.startswith("warpimpact ") and "|" not in line:
        command, *rest = shlex.split(line)[1:]
        assert not main([command, *rest, *(FEWER["report"] if command == "report" else [])]), line
        make_campaigns_smaller(Path())
    else:
        subprocess.run(line, shell=True, check=True, env=os.environ | {"PATH": PROGRAMS})


def run_cell(code: str, names: dict[str, object]) -> object:
    """Run the code of a cell; the value of its last line, where that is an expression."""
    tree = ast.parse(TransformerManager().transform_cell(code))
    last = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return eval(compile(last, "cell", "eval"), names) if last else None


@pytest.mark.parametrize(
    "page", [page for page in sorted(TUTORIALS.glob("*.md")) if page.stem != "index"], ids=lambda page: page.stem
)
def test_a_tutorial_runs_and_shows_a_picture(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shown: list[object] = []
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.gcf()))
    names: dict[str, object] = {"get_ipython": lambda: SimpleNamespace(system=shell)}
    shown += [run_cell(smaller(cell), names) for cell in cells(page)]
    pictures = [picture for picture in shown if isinstance(picture, (Figure, Image))]
    assert pictures
    for picture in pictures:
        assert not isinstance(picture, Figure) or picture.axes
    pyplot.close("all")
