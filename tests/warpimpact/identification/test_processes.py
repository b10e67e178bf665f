"""Processes that score sets: their scores are those of threads, and nobody has to clear up behind them."""

import logging
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pytest

from warpimpact.identification import identify
from warpimpact.identification.fit import Fit
from warpimpact.identification.identify import FitProgress
from warpimpact.identification.likelihood import ShotScore
from warpimpact.identification.posterior import Sampled
from warpimpact.runs import executor
from warpimpact.runs.choice import executor_for
from warpimpact.runs.questions import answered

FitMaker = Callable[..., Fit]
PATIENCE = 120.0
"""Seconds for what takes two."""


@pytest.fixture
def fit(make_fit: FitMaker, small: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> Fit:
    monkeypatch.setattr(identify, "BATCH", 8)
    return make_fit(small)


def sample(fit: Fit, workers: int | None = None, progress: Callable[[FitProgress], None] | None = None) -> Sampled:
    with executor_for("cpu", workers=workers, apart=True) as computing:
        return answered(identify.sampled(fit, progress), computing)


def check_equal(one: Sampled, other: Sampled) -> None:
    np.testing.assert_array_equal(one.points, other.points)
    for a, b in zip(one.scores, other.scores, strict=True):
        for name in vars(a):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_a_killed_process_costs_nothing(fit: Fit) -> None:
    killed = set[int]()

    def kill(now: FitProgress) -> None:
        for child in multiprocessing.active_children() if not killed else ():
            killed.add(child.pid or 0)
            child.kill()

    disturbed = sample(fit, 2, kill)
    assert killed
    check_equal(disturbed, sample(fit))


def test_what_a_process_cannot_compute_is_told_by_this_one(fit: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> list[ShotScore]:
        raise ValueError("of this process")

    monkeypatch.setattr(identify, "evaluate", fails)
    monkeypatch.setattr(executor, "_in_process", logging.debug)  # which returns None
    with pytest.raises(ValueError, match="of this process"):
        sample(fit, 2)


def begun(text: str, small: tuple[str, str], folder: Path) -> tuple[subprocess.Popen[str], list[psutil.Process]]:
    """A fit in a process of its own, and the processes that it has begun."""
    (folder / "fit.toml").write_text(text.replace(small[0], "[sampling]\nsets = 1048576\neffective = 65536\nhits = 32"))
    code = (
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # the tests may run in the background of a shell
        "from warpimpact.cli import main\n"
        "raise SystemExit(main(['identify', 'fit.toml', '--device', 'cpu', '--workers', '2']))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    end, of_crew = time.monotonic() + PATIENCE, list[psutil.Process]()
    while len(of_crew) < 2 and time.monotonic() < end:
        time.sleep(0.05)
        of_crew = [one for one in psutil.Process(process.pid).children() if "spawn_main" in " ".join(one.cmdline())]
    assert len(of_crew) == 2
    return process, of_crew


def test_processes_end_with_a_killed_one(text: str, small: tuple[str, str], tmp_path: Path) -> None:
    process, of_crew = begun(text, small, tmp_path)
    process.kill()
    process.communicate()
    assert not psutil.wait_procs(of_crew, timeout=PATIENCE)[1]


def test_an_interrupt_is_told_once(text: str, small: tuple[str, str], tmp_path: Path) -> None:
    process, of_crew = begun(text, small, tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them, of which two are still loading
    told = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 130
    assert "Traceback" not in told, told
    assert told.count("interrupted") == 1
    assert not psutil.wait_procs(of_crew, timeout=PATIENCE)[1]
