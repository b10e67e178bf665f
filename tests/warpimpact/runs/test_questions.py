"""Whoever computes and whatever interrupts, a command that computes ends with the same file.

The list of questions is that of docs/contributing.md; each is a small file of its own kind.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact.cli import main
from warpimpact.results import attributes as attr
from warpimpact.runs.shards import ShardsOnDisk
from warpimpact.runs.store import Store

TARGET = """
title = "small"
[core]
shape = "ogive"
diameter = "6 mm"
crh = 3.0
length = "27 mm"
mass = "4 g"
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
CAMPAIGN = TARGET + PLATE + HOLED + HITS.format(600)
QUESTIONS: dict[str, tuple[str, ...]] = {
    "run": ("run", CAMPAIGN),
    "limit": ("limit", TARGET + PLATE + HOLED + HITS.format(600), "--tolerance", "60 m/s"),
    "sweep": ("sweep", CAMPAIGN.replace("600", "300") + '[sweep]\nvelocity = ["700 m/s", "800 m/s"]\n'),
    "directions": (
        "test",
        'title = "directions"\n[target]\ncampaign = "target.toml"\n[directions]\nvelocity = "825 m/s"\n'
        'azimuth = ["0 deg", "30 deg"]\nelevation = ["0 deg"]\nfirst_count = 32\nmax_count = 64\nhalf_width = 0.01\n',
    ),
    "identify": (
        "identify",
        TARGET.replace('[impact]\nvelocity = "825 m/s"\n', "").replace("[output]", "[record]")
        + PLATE.replace('resistance = "2.6 GPa"\n', "")
        + '[prior.plate]\nresistance = { distribution = "uniform", low = "1 GPa", high = "4 GPa" }\n'
        + "[sampling]\nsets = 512\nhits = 32\neffective = 200\n"
        + '[[shot]]\nimpact = { velocity = "825 m/s" }\n'
        + '[shot.measured]\nresidual_velocity = { value = "780 m/s", std = "8 m/s" }\n',
    ),
    "optimise": (
        "optimise",
        TARGET
        + PLATE
        + '[variables]\nthickness = { low = "2 mm", high = "7 mm", step = "1 mm" }\n'
        + '[[objectives]]\nmeasure = "areal_density"\n[[objectives]]\nmeasure = "mean(residual_energy_fraction)"\n'
        + "[search]\ndesigns = 6\npopulation = 6\nhits = 16\nmost_hits = 64\nconfirm_hits = 64\n",
    ),
}
"""By name: the command, its file, and options."""
OF_THE_CALL = {attr.HISTORY, attr.COMPUTE_TIME, attr.HITS_PER_SECOND}
pytestmark = pytest.mark.usefixtures("small_shards")

Answered = Callable[..., int]


@pytest.fixture
def asked(tmp_path: Path) -> Answered:
    """A function that asks a question, and returns the exit code."""
    (tmp_path / "target.toml").write_text(TARGET + PLATE + HOLED + BASE + HITS.format(64), encoding="utf-8")

    def asked(name: str, output: Path, *options: str) -> int:
        command, text, *own = QUESTIONS[name]
        file = tmp_path / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        return main([command, str(file), "-o", str(output), "--device", "cpu", "-q", *own, *options])

    return asked


def content(path: Path) -> dict[str, Any]:
    """All that a result holds, but for when and how fast it was computed."""
    with xarray.open_datatree(path, engine="netcdf4") as tree:
        found: dict[str, Any] = {}
        for node in tree.subtree:
            for name, variable in node.to_dataset(inherit=False).variables.items():
                if not re.search("time|seconds|cost", str(name)):
                    found[f"{node.path}/{name}"] = variable.values
            found |= {
                f"{node.path}@{name}": value
                for name, value in node.attrs.items()
                if name not in OF_THE_CALL and "time" not in name and "second" not in name
            }
    return found


def assert_alike(one: Path, other: Path) -> None:
    first, second = content(one), content(other)
    assert first.keys() == second.keys()
    for name, value in first.items():
        assert np.array_equal(value, second[name], equal_nan=np.asarray(value).dtype.kind == "f"), name


@pytest.fixture
def interrupting(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], Iterator[None]]:
    """A function after which Ctrl-C comes once so many results are on the disk."""

    def interrupting(after: int) -> None:
        left = after
        for kind in (ShardsOnDisk, Store):

            def save(self: Any, *arguments: Any, original: Any = kind.save) -> None:
                nonlocal left
                original(self, *arguments)
                left -= 1
                if left == 0:
                    raise KeyboardInterrupt

            monkeypatch.setattr(kind, "save", save)

    return interrupting


@pytest.mark.parametrize("name", QUESTIONS)
def test_resumed_equals_undisturbed(name: str, asked: Answered, interrupting: Any, tmp_path: Path) -> None:
    assert asked(name, tmp_path / "straight.nc") == 0
    interrupting(2)
    output = tmp_path / "resumed.nc"
    assert asked(name, output) == 130
    assert not output.exists()
    assert asked(name, output, "--resume") == 0
    assert_alike(output, tmp_path / "straight.nc")


@pytest.mark.parametrize("name", QUESTIONS)
def test_processes_give_the_bits_of_threads(name: str, asked: Answered, tmp_path: Path) -> None:
    assert asked(name, tmp_path / "threads.nc") == 0
    assert asked(name, tmp_path / "processes.nc", "--workers", "2") == 0
    assert_alike(tmp_path / "processes.nc", tmp_path / "threads.nc")
