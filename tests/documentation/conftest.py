"""Pilots, chains and pictures that take little: pages show how commands are used, and results are not looked at."""

from typing import Any

import pytest
from matplotlib.figure import Figure

from warpimpact.continuum import one_hit
from warpimpact.identification import identify
from warpimpact.solver import accuracy
from warpimpact.solver.settings import Accuracy


@pytest.fixture(autouse=True)
def little_work(monkeypatch: pytest.MonkeyPatch) -> None:
    pilot_size, save = accuracy.pilot_size, Figure.savefig

    def few(wanted: Accuracy, least: int = 8) -> int:
        return pilot_size(wanted, min(least, 8))

    def coarse(figure: Figure, file: Any, **how: Any) -> None:
        figure.set_layout_engine("none")
        save(figure, file, **how | {"dpi": 20})

    monkeypatch.setattr("warpimpact.runs.compute.pilot_size", few)
    monkeypatch.setattr("warpimpact.solver.fast_law.pilot_size", few)
    monkeypatch.setattr(accuracy, "PILOT_SECONDS", 0.0)
    for share in ("LARGEST_IMBALANCE", "LARGEST_HOURGLASS_SHARE"):  # of elements that are too coarse for a result
        monkeypatch.setattr(one_hit, share, 1.0)
    for name, few_sets in {
        "WALKERS_PER_PARAMETER": 3,
        "MOST_WALKERS": 8,
        "PRIOR_SETS_PER_WALKER": 2,
        "CHECK_STEPS": 1,
    }.items():
        monkeypatch.setattr(identify, name, few_sets)
    for user in ("warpimpact.cli.studies", "warpimpact.identification.identify"):  # the command has it by name
        monkeypatch.setattr(f"{user}.most_sets", lambda fit: 5 * identify.walkers_of(fit))
    monkeypatch.setattr(Figure, "savefig", coarse)
