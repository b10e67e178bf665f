"""A command that was interrupted and resumed ends with the file of an undisturbed one."""

import re
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
HITS = '[hits]\nsampling = "sobol"\ncount = {}\n'
CAMPAIGN = TARGET + PLATE + HOLED + HITS.format(160)
COMMANDS: dict[str, tuple[str, ...]] = {
    "limit": ("limit", CAMPAIGN, "--tolerance", "60 m/s"),
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


def content(path: Path) -> dict[str, Any]:
    """All that a result holds, but for when and how fast it was computed."""
    actual: dict[str, Any] = {}
    for place, dataset in xarray.open_groups(path, engine="netcdf4").items():  # a reference has hits of its own
        values = {name: of.values.tolist() for name, of in dataset.load().variables.items()} | dataset.attrs
        dataset.close()
        actual |= {f"{place}/{name}": str(value) for name, value in values.items() if not OF_THE_CALL.search(name)}
    return actual


@pytest.mark.parametrize("name", COMMANDS)
def test_resumed_equals_undisturbed(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C comes once two chunks are on the disk."""
    monkeypatch.setattr(compute, "FEWEST", 64)
    monkeypatch.setattr(chunks, "HELD_SECONDS", 0.0)
    command, text, *own = COMMANDS[name]
    file, straight, output = (tmp_path / part for part in (f"{name}.toml", "straight.nc", "resumed.nc"))
    file.write_text(text, encoding="utf-8")

    def called(path: Path, *options: str) -> int:
        return main([command, str(file), "-o", str(path), "--device", "cpu", "-q", *own, *options])

    assert called(straight) == 0
    left, original = 2, Chunks.save

    def save(self: Chunks, *arguments: Any) -> None:
        nonlocal left
        original(self, *arguments)
        left -= 1
        if left == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(Chunks, "save", save)
    assert called(output) == 130
    assert not output.exists()
    assert called(output, "--resume") == 0
    assert content(output) == content(straight)
