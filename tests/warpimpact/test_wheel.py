"""The wheel carries the kernels and the bundled campaigns; the checkout's own folders cannot stand in for it."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]


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
