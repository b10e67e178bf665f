"""What a program imports, the wheel in another folder, and the sections of the model that files cite."""

import os
import pydoc
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import warpimpact

CHECKOUT = Path(__file__).parents[2]


def test_every_public_name_is_there() -> None:
    assert {"simulate", "open_result", "Scene", "run"} <= set(warpimpact.__all__) < set(dir(warpimpact))
    assert len(warpimpact.__all__) <= 41
    assert all(getattr(warpimpact, name) is not None for name in dir(warpimpact))
    top = pydoc.render_doc(warpimpact.Plate, renderer=pydoc.plaintext).splitlines()
    assert any("A perforated plate." in line for line in top[:6]), top[:6]
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = warpimpact.simulat


def test_help_is_quick() -> None:
    heavy = {"matplotlib", "numpy", "pydantic", "warp", "xarray"}
    code = f"import sys; from warpimpact.cli import parser; parser(); sys.exit(len({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_example_passes_a_strict_type_check_that_sees_mistakes(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (CHECKOUT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    mistakes = "print(plate.thicknes, plate.thickness.mean)\n"
    (tmp_path / "example.py").write_text(code + mistakes, encoding="utf-8")
    # With the settings and the cache of `make types`, which has checked the package.
    command = [sys.executable, "-m", "mypy", "--strict", tmp_path / "example.py"]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    *errors, _ = done.stdout.splitlines()
    assert len(errors) == 2, done.stdout
    assert '"Plate" has no attribute "thicknes"' in errors[0]
    assert 'Item "float" of "float | Any" has no attribute "mean"' in errors[1]  # what is read is a float


def test_a_wheel_computes_from_another_folder(tmp_path: Path) -> None:
    source, site = tmp_path / "source", tmp_path / "site"
    for part in ("warpimpact", "kernels", "campaigns"):
        shutil.copytree(CHECKOUT / part, source / part)
    for part in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(CHECKOUT / part, source)
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", tmp_path, source],
        check=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(site)
    pages = {path.name for path in (site / "warpimpact" / "report" / "static").iterdir()}
    assert {"page.html", "page.css", "page.js"} <= pages
    script = (
        "import warpimpact, warpimpact.kernels.march as march\n"
        "from warpimpact.cli import main\n"
        f"assert all(m.__file__.startswith({str(site)!r}) for m in (warpimpact, march))\n"
        "raise SystemExit(main(['new', '--list']) or main(['validate', '--device', 'cpu']))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "between holes" in result.stdout
    assert "slotted_plate  " in result.stdout


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
