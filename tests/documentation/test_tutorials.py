"""The tutorials: their cells run in order, as a notebook runs them, and each tutorial shows a picture.

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

from warpimpact.cli import main

from .smaller import make_campaigns_smaller, smaller

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"
PROGRAMS = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


def cells(page: Path) -> list[str]:
    """The code cells of a page, without those that it hides."""
    code = re.findall(r"```\{code-cell\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [cell for cell in code if "remove-cell" not in cell]


def shell(line: str) -> None:
    """Run a line that begins with "!"; the command runs in this process, where no other program takes its output."""
    if line.startswith("warpimpact ") and "|" not in line:
        assert not main(shlex.split(line)[1:]), line
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
