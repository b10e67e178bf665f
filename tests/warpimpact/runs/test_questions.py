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
from warpimpact.runs import chunks, compute
from warpimpact.runs.chunks import Chunks
from warpimpact.runs.questions import Store

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
QUESTIONS: dict[str, tuple[str, ...]] = {
    "run": ("run", CAMPAIGN),
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
OF_THE_CALL = {attr.HISTORY, attr.COMPUTE_TIME, attr.HITS_PER_SECOND}

Answered = Callable[..., int]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("questions")


@pytest.fixture(scope="module")
def asked(folder: Path) -> Iterator[Answered]:
    """A function that asks a question, and returns the exit code. Runs have several shards."""
    (folder / "target.toml").write_text(TARGET + PLATE + HOLED + BASE + HITS.format(64), encoding="utf-8")

    def asked(name: str, output: Path, *options: str) -> int:
        command, text, *own = QUESTIONS[name]
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        return main([command, str(file), "-o", str(output), "--device", "cpu", "-q", *own, *options])

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(compute, "FEWEST", 64)
        patched.setattr(chunks, "HELD_SECONDS", 0.0)
        yield asked


def content(path: Path) -> dict[str, Any]:
    """All that a result holds, but for when and how fast it was computed."""
    found: dict[str, Any] = {}
    for place, dataset in xarray.open_groups(path, engine="netcdf4").items():  # a reference has hits of its own
        with dataset:
            for name, variable in dataset.variables.items():
                if not re.search("time|seconds|cost", str(name)):
                    found[f"{place}/{name}"] = variable.values
            found |= {
                f"{place}@{name}": value
                for name, value in dataset.attrs.items()
                if name not in OF_THE_CALL and "time" not in name and "second" not in name
            }
    return found


def assert_alike(one: Path, other: Path) -> None:
    first, second = content(one), content(other)
    assert first.keys() == second.keys()
    for name, value in first.items():
        assert np.array_equal(value, second[name], equal_nan=np.asarray(value).dtype.kind == "f"), name


@pytest.fixture(scope="module", params=QUESTIONS)
def name(request: pytest.FixtureRequest) -> str:
    """Of a question; the tests of one follow each other, as they share the straight answer."""
    return str(request.param)


@pytest.fixture(scope="module")
def straight(name: str, asked: Answered, folder: Path) -> Path:
    """The answer of threads that nothing disturbs."""
    path = folder / f"{name}.nc"
    assert asked(name, path) == 0
    return path


@pytest.fixture
def interrupting(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], Iterator[None]]:
    """A function after which Ctrl-C comes once so many results are on the disk."""

    def interrupting(after: int) -> None:
        left = after
        for kind in (Chunks, Store):

            def save(self: Any, *arguments: Any, original: Any = kind.save) -> None:
                nonlocal left
                original(self, *arguments)
                left -= 1
                if left == 0:
                    raise KeyboardInterrupt

            monkeypatch.setattr(kind, "save", save)

    return interrupting


def test_resumed_equals_undisturbed(
    name: str, straight: Path, asked: Answered, interrupting: Any, tmp_path: Path
) -> None:
    interrupting(2)
    output = tmp_path / "resumed.nc"
    assert asked(name, output) == 130
    assert not output.exists()
    assert asked(name, output, "--resume") == 0
    assert_alike(output, straight)
