"""Runs tests with the lowest versions of the libraries that pyproject.toml allows: `make lowest`.

    python tests/lowest_versions.py                      # a fast part of the suite
    python tests/lowest_versions.py tests/warpimpact     # arguments of pytest

The environment in build/lowest is made anew where a floor has changed.
"""

import json
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
FOLDER = CHECKOUT / "build" / "lowest"
EXTRAS = ("cad", "cluster", "design", "identify", "optimise", "vtk")
TOOLS = ("pytest", "hypothesis", "jsonschema", "selenium", "statsmodels")
FAST = (
    "tests/warpimpact/campaign",
    "tests/warpimpact/catalogue",
    "tests/warpimpact/cli",
    "tests/warpimpact/design/test_server.py",
    "tests/warpimpact/export",
    "tests/warpimpact/optimisation",
    "tests/warpimpact/report",
    "tests/warpimpact/results",
    "tests/warpimpact/scene",
    "tests/warpimpact/statistics",
)


def floors() -> list[str]:
    """Each library with its lowest version, as pip takes it."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *(one for extra in EXTRAS for one in project["optional-dependencies"][extra])]
    return [re.sub(r">=", "==", one) for one in needed]


def environment(needed: list[str]) -> Path:
    """The Python of an environment that has these versions."""
    python, mark = FOLDER / "bin" / "python", FOLDER / "floors.json"
    if not mark.exists() or json.loads(mark.read_text()) != needed:
        venv.create(FOLDER, with_pip=True, clear=True)
        install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile"]
        subprocess.run([*install, *needed, *TOOLS], check=True)
        subprocess.run([*install, "--no-deps", "--editable", CHECKOUT], check=True)
        mark.write_text(json.dumps(needed))
    return python


def main() -> int:
    python = environment(floors())
    tests = sys.argv[1:] or FAST
    return subprocess.run([python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests], cwd=CHECKOUT).returncode


if __name__ == "__main__":
    raise SystemExit(main())
