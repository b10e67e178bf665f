"""What a program imports: the names at the top, and the README's example as a type checker of a user sees it."""

import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import warpimpact

CHECKOUT = Path(__file__).parents[2]


def test_every_public_name_is_there() -> None:
    assert {"simulate", "open_result", "Scene", "run"} <= set(warpimpact.__all__) < set(dir(warpimpact))
    assert len(warpimpact.__all__) <= 30
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
