"""A small run loads what it needs and no more: its time is that of its imports."""

import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
HEAVY = {
    "asyncio",
    "dask",
    "distributed",
    "jinja2",
    "matplotlib",
    "pandas",
    "statsmodels",
    "tqdm",
    "xarray",
}
"""Each takes a twentieth of a second and more, or takes another of them along."""


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_a_run_loads_nothing_heavy(sampling: str, tmp_path: Path) -> None:
    text = (CAMPAIGNS / "slotted_plate.toml").read_text(encoding="utf-8")
    (tmp_path / "a.toml").write_text(text.replace('"sobol"', f'"{sampling}"'), encoding="utf-8")
    code = f"""
import sys
from warpimpact.cli import main
assert main(["run", "a.toml", "--count", "64", "--device", "cpu"]) == 0
print(sorted({HEAVY!r} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_new_campaign_loads_no_solver(tmp_path: Path) -> None:
    code = f"""
import sys
from warpimpact.cli import main
assert main(["new", "addon"]) == 0
print(sorted(({HEAVY!r} | {{"warp"}}) & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
