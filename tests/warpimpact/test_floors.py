"""The house: rooms import downwards only, files and signatures stay short."""

import ast
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).parents[2]
ROOMS = [path.parent for path in CHECKOUT.glob("warpimpact/*/__init__.py")]
MOST_LINES, MOST_ARGUMENTS = 350, 8
SOURCES = sorted(path for top in ("warpimpact", "kernels") for path in (CHECKOUT / top).rglob("*.py"))


def files(*, kernels: bool) -> list[Any]:
    """The source files as parameters of a test."""
    names = {str(file.relative_to(CHECKOUT)): file for file in SOURCES}
    return [pytest.param(file, id=name) for name, file in names.items() if kernels or not name.startswith("kernels/")]


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder with the package as it is installed: kernels/ inside warpimpact/."""
    for source, target in (("warpimpact", "warpimpact"), ("kernels", "warpimpact/kernels")):
        shutil.copytree(CHECKOUT / source, tmp_path / target, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(CHECKOUT / "pyproject.toml", tmp_path)
    return tmp_path


def linted(folder: Path) -> subprocess.CompletedProcess[str]:
    command = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_cache=True))"
    return subprocess.run([sys.executable, "-c", command], cwd=folder, capture_output=True, text=True, check=False)


def test_imports_go_down_only(installed: Path) -> None:
    done = linted(installed)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


@pytest.mark.parametrize(
    ("file", "line", "sentence"),
    [
        ("scene/model.py", "import warpimpact.cli", "warpimpact.scene is not allowed to import warpimpact.cli"),
        ("kernels/status.py", "from warpimpact.scene import Plate", "warpimpact.kernels is not allowed to import"),
        ("statistics/intervals.py", "import xarray", "warpimpact.statistics is not allowed to import xarray"),
        ("results/files.py", "from warpimpact import run", "warpimpact.results is not allowed to import"),
        ("plotting/cell.py", "import warpimpact.export.spreadsheet", "warpimpact.plotting is not allowed to import"),
    ],
)
def test_an_import_upwards_is_found(installed: Path, file: str, line: str, sentence: str) -> None:
    broken = installed / "warpimpact" / file
    broken.write_text(broken.read_text(encoding="utf-8") + f"\n{line}\n", encoding="utf-8")
    done = linted(installed)
    assert done.returncode == 1
    assert sentence in done.stdout


def test_no_files_import_each_other_in_a_circle(installed: Path) -> None:
    """Imports for type checkers and those inside functions count."""
    search = """
import grimp
graph = grimp.build_graph("warpimpact", cache_dir=None)
imports = [(file, other) for file in sorted(graph.modules) for other in graph.find_modules_directly_imported_by(file)]
print(*(f"{file} -> {way}" for file, other in imports if (way := graph.find_shortest_chain(other, file))), sep="\\n")
"""
    done = subprocess.run([sys.executable, "-c", search], cwd=installed, capture_output=True, text=True, check=True)
    assert not done.stdout.strip()


def test_every_room_has_its_floor_and_its_package() -> None:
    tables = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    floors = {name.strip() for layer in tables["importlinter"]["contracts"][0]["layers"] for name in layer.split("|")}
    rooms = {f"warpimpact.{room.name}" for room in ROOMS} | {"warpimpact.kernels"}
    assert floors == rooms
    assert rooms <= set(tables["setuptools"]["packages"])
    folders = {path.name for path in (CHECKOUT / "tests" / "warpimpact").iterdir() if any(path.glob("test_*.py"))}
    assert folders == {room.name for room in ROOMS}


@pytest.mark.parametrize("room", [*ROOMS, CHECKOUT / "kernels"], ids=lambda room: room.name)
def test_a_room_says_what_it_is_for_what_may_change_and_what_it_imports(room: Path) -> None:
    docstring = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8"))) or ""
    told = " ".join(docstring.split())
    assert "Change " in told
    assert "It imports " in told


@pytest.mark.parametrize("file", files(kernels=True))
def test_a_long_file_gives_its_reason(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    if len(text.splitlines()) > MOST_LINES:
        told = ast.get_docstring(ast.parse(text)) or ""
        assert "Long because" in told, f"{file} has more than {MOST_LINES} lines"


def test_a_file_name_occurs_once() -> None:
    """A command, its figure and its kernel share a name, as they are the same thing."""
    names = Counter(
        file.name for file in SOURCES if not {"cli", "plotting", "kernels"} & {*file.relative_to(CHECKOUT).parts}
    )
    twice = {name for name, count in names.items() if count > 1} - {"__init__.py"}
    assert twice <= {"assumptions.py", "limit.py", "limits.py", "replay.py"}


def signatures(file: Path) -> Iterator[tuple[str, int]]:
    """Functions of a file, and how many arguments each takes besides self or cls."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            taken = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            yield node.name, sum(argument.arg not in ("self", "cls") for argument in taken)


@pytest.mark.parametrize("file", files(kernels=False))
def test_signatures_are_short(file: Path) -> None:
    long = {name: count for name, count in signatures(file) if count > MOST_ARGUMENTS}
    assert not long, f"more than {MOST_ARGUMENTS} arguments"
