"""The house: rooms import downwards only, it keeps its size, and names say what a thing is."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
REFUSED = {"told", "said", "asked", "beside", "apart", "found"}
"""Words that no name contains: they say how a thing came about, not what it is."""
ROOMS = [path.parent for path in CHECKOUT.glob("warpimpact/*/__init__.py")]


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder with the package as it is installed: kernels/ inside warpimpact/."""
    for source, target in (("warpimpact", "warpimpact"), ("kernels", "warpimpact/kernels")):
        shutil.copytree(CHECKOUT / source, tmp_path / target, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(CHECKOUT / "pyproject.toml", tmp_path)
    return tmp_path


def test_imports_go_down_only(installed: Path) -> None:
    command = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", command], cwd=installed, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


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


LIGHT = {"numpy", "scipy", "pandas", "xarray", "shapely", "netCDF4", "pydantic"}
"""Libraries that a file imports at its top: they load in a second, and a command may take it."""
FOR_TYPES = {"__init__.py"}
"""Files that import for type checkers alone: the lazy names of the package."""


def imported(node: ast.AST) -> set[str]:
    """First parts of the names that the imports within a node have."""
    names = set[str]()
    for one in ast.walk(node):
        if isinstance(one, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in one.names}
        elif isinstance(one, ast.ImportFrom):
            names.add((one.module or "").partition(".")[0])
    return names


def test_light_libraries_are_imported_at_the_top_of_a_file() -> None:
    for file in (CHECKOUT / "warpimpact").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                assert not imported(node) & LIGHT, f"{file}: {node.name}"
            elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                assert imported(node) <= {"matplotlib"} or file.name in FOR_TYPES, file  # half a second of every start


def test_every_room_has_its_floor_and_its_package() -> None:
    tables = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    layers = tables["importlinter"]["contracts"][0]["layers"]
    floors = {name.strip() for layer in layers for name in re.split("[:|]", layer)}
    rooms = {f"warpimpact.{room.name}" for room in ROOMS} | {"warpimpact.kernels"}
    assert floors == rooms
    assert rooms <= set(tables["setuptools"]["packages"])
    folders = {path.name for path in (CHECKOUT / "tests" / "warpimpact").iterdir() if any(path.glob("test_*.py"))}
    assert folders == {room.name for room in ROOMS}


def lines(*folders: str, pattern: str = "*.py") -> int:
    files = (file for folder in folders for file in (CHECKOUT / folder).rglob(pattern))
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def test_the_house_keeps_its_size() -> None:
    tables = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
    budgets = tables["tool"]["warpimpact"]["budgets"]
    assert lines("kernels", "warpimpact") <= budgets["source"]
    assert lines("tests") <= budgets["tests"]
    assert lines("docs", pattern="*.md") <= budgets["docs"]


def test_source_has_few_files() -> None:
    """A file is a chapter of 150 to 500 lines."""
    assert sum(1 for room in ("kernels", "warpimpact") for _ in (CHECKOUT / room).rglob("*.py")) <= 201


def defined_names(tree: ast.AST) -> set[str]:
    """Functions, classes, arguments, variables and attributes that a file defines; those of libraries are only used."""
    names = set[str]()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                names.add(name)
            case ast.alias(asname=str(name)) | ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)):
                names.add(name)
    return names


def words(name: str) -> set[str]:
    """Words of a name in snake_case or CamelCase."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def test_names_say_what_a_thing_is() -> None:
    files = [
        file for room in ("warpimpact", "kernels", "campaigns", "tests") for file in (CHECKOUT / room).rglob("*.py")
    ]
    names = {file: defined_names(ast.parse(file.read_text(encoding="utf-8"))) | {file.stem} for file in files}
    assert not [(file.name, name) for file in files for name in names[file] if words(name) & REFUSED]


THINGS = "hit|shot|design|point|set|layer|core|hole|test|result|change|pilot|plate|combination|material|value|column"
NEVER_ONE = {
    "HITS_PER_SECOND",
    "plate.pattern.shape",
    "len(datasets)",
    "FEW_SHOTS",
    "len(columns)",
    "pairs",
    "points",
    "file",
}
"""Numbers in messages that are above 1, a rate, or no number, as their code contains."""


def test_messages_have_no_plural_of_one() -> None:
    """A number of things is written by `count_text`."""
    plurals = []
    for file in (CHECKOUT / "warpimpact").rglob("*.py"):
        texts = (one for one in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(one, ast.JoinedStr))
        for number, after in (pair for text in texts for pair in pairwise(text.values)):
            if isinstance(number, ast.FormattedValue) and isinstance(after, ast.Constant):
                code, things = ast.unparse(number.value), re.match(rf" (more )?({THINGS})s\b", str(after.value))
                if things and not any(name in code for name in (*NEVER_ONE, "count_text", "LONGEST")):
                    plurals.append(f"{file.name}: {{{code}}}{things[0]}")
    assert not plurals
