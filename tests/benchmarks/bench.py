"""Common parts of the benchmarks: the checkout, the scene, the clock, the machine."""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.append(str(CHECKOUT))  # an installed warpimpact comes first; without one the checkout will do

import warpimpact  # noqa: E402

if find_spec("warpimpact.kernels") is None:
    warpimpact.__path__.append(str(CHECKOUT))  # kernels/ and campaigns/ install inside the package

from warpimpact.scene import Shots  # noqa: E402

CAMPAIGN = CHECKOUT / "campaigns" / "slotted_plate.toml"
RESULTS = Path(__file__).resolve().parent / "results"


def copied(shots: Shots, copies: int) -> Shots:
    """The shots, repeated `copies` times."""
    return Shots(**{name: np.tile(values, copies) for name, values in shots.columns.items()})


def spent(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time [s]."""
    begin = time.process_time()
    value = work()
    return value, time.process_time() - begin


def seconds(work: Callable[[], Any]) -> float:
    """How long one call takes [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0))


def machine() -> dict[str, str | int]:
    """The machine on which the figures were measured, and the date."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": cores(),
        "python": platform.python_version(),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
    }


def store(name: str, values: dict[str, Any]) -> None:
    """Write results/NAME.json; print its path."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(path)
