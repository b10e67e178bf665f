"""What a program imports: the names at the top, and the README's example as a type checker of a user sees it."""

import os
import pydoc
import re
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

import warpimpact

CHECKOUT = Path(__file__).parents[2]


def example() -> str:
    """The Python example of the README."""
    (code,) = re.findall(r"```python\n(.*?)```", (CHECKOUT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    return str(code)


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


TYPED = ("numpy", "xarray", "pydantic", "pydantic_core", "annotated_types", "typing_extensions.py", "typing_inspection")
"""Packages whose types public names have. Others have none where no stubs are installed, which a user need not have."""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment of a user: packages with types, and this one by its path, as make installs it."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    (site,) = folder.glob("lib/*/site-packages")
    for name in TYPED:
        here = next(Path(path, name) for path in sys.path if Path(path, name).exists())
        (site / name).symlink_to(here)
    (site / "warpimpact.pth").write_text(str(CHECKOUT), encoding="utf-8")
    return folder


@pytest.mark.skipif(sysconfig.get_platform().startswith("win"), reason="environments have other folders")
@pytest.mark.parametrize(
    ("more", "complaint"),
    [("", None), ("print(plate.thicknes, plate.thickness.mean)\n", '"Plate" has no attribute "thicknes"')],
)
def test_the_example_passes_a_strict_type_check(
    environment: Path, tmp_path: Path, more: str, complaint: str | None
) -> None:
    (tmp_path / "example.py").write_text(example() + more, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", environment / "cache"]
    done = subprocess.run(
        [*command, "--python-executable", environment / "bin" / "python", "example.py"],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if name != "MYPYPATH"},
        capture_output=True,
        text=True,
        check=False,
    )
    if complaint is None:
        assert done.stdout.startswith("Success"), done.stdout
    else:
        assert complaint in done.stdout
        assert 'Item "float" of "float | Any" has no attribute "mean"' in done.stdout  # what is read is a float
