"""A command that was interrupted and resumed ends with the file of an undisturbed one."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import xarray

from warpimpact.cli import main
from warpimpact.runs import chunks, compute
from warpimpact.runs.chunks import Chunks

TARGET = """
title = "small"
core = { shape = "ogive", diameter = "6 mm", crh = 3.0, length = "27 mm", mass = "4 g" }
[impact]
velocity = "825 m/s"
[numerics]
level = 0
[output]
standoffs = ["130 mm"]
"""
HOLED = 'pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }\n'
PLATE = '[plate]\nthickness = "4 mm"\nresistance = "2.6 GPa"\n'
BASE = '[[layer]]\nthickness = "8 mm"\nresistance = "1 GPa"\n'
HITS = '[hits]\nsampling = "sobol"\ncount = {}\n'
CAMPAIGN = TARGET + PLATE + HOLED + HITS.format(160)
COMMANDS: dict[str, tuple[str, ...]] = {
    "limit": ("limit", TARGET + PLATE + HOLED + HITS.format(160), "--tolerance", "60 m/s"),
    "sweep": ("sweep", CAMPAIGN.replace("160", "96") + '[sweep]\nvelocity = ["700 m/s", "800 m/s"]\n'),
    "optimise": (
        "optimise",
        TARGET
        + PLATE
        + '[variables]\nthickness = { low = "2 mm", high = "7 mm", step = "1 mm" }\n'
        + '[[objectives]]\nmeasure = "areal_density"\n[[objectives]]\nmeasure = "mean(residual_energy_fraction)"\n'
        + "[search]\n"
        + "designs = 6\npopulation = 6\nhits = 64\nconfirm_hits = 64\n",
    ),
}
"""By name: the command, its file, and options."""
OF_THE_CALL = re.compile("history|time|second|cost")

Called = Callable[..., int]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("commands")


@pytest.fixture(scope="module")
def called(folder: Path) -> Iterator[Called]:
    """A function that calls a command, and returns the exit code. Runs have several chunks."""
    (folder / "target.toml").write_text(TARGET + PLATE + HOLED + BASE + HITS.format(64), encoding="utf-8")

    def called(name: str, output: Path, *options: str) -> int:
        command, text, *own = COMMANDS[name]
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        return main([command, str(file), "-o", str(output), "--device", "cpu", "-q", *own, *options])

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(compute, "FEWEST", 64)
        patched.setattr(chunks, "HELD_SECONDS", 0.0)
        yield called


def content(path: Path) -> dict[str, Any]:
    """All that a result holds, but for when and how fast it was computed."""
    actual: dict[str, Any] = {}
    for place, dataset in xarray.open_groups(path, engine="netcdf4").items():  # a reference has hits of its own
        values = {name: of.values.tolist() for name, of in dataset.load().variables.items()} | dataset.attrs
        dataset.close()
        actual |= {f"{place}/{name}": str(value) for name, value in values.items() if not OF_THE_CALL.search(name)}
    return actual


@pytest.fixture(scope="module", params=COMMANDS)
def name(request: pytest.FixtureRequest) -> str:
    """Of a question; the tests of one follow each other, as they share the straight answer."""
    return str(request.param)


@pytest.fixture(scope="module")
def straight(name: str, called: Called, folder: Path) -> Path:
    """The answer of threads that nothing disturbs."""
    path = folder / f"{name}.nc"
    assert called(name, path) == 0
    return path


@pytest.fixture
def interrupting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C comes once two chunks are on the disk."""
    left, original = 2, Chunks.save

    def save(self: Chunks, *arguments: Any) -> None:
        nonlocal left
        original(self, *arguments)
        left -= 1
        if left == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(Chunks, "save", save)


def test_resumed_equals_undisturbed(
    name: str, straight: Path, called: Called, interrupting: None, tmp_path: Path
) -> None:
    output = tmp_path / "resumed.nc"
    assert called(name, output) == 130
    assert not output.exists()
    assert called(name, output, "--resume") == 0
    assert content(output) == content(straight)
