"""Progress: lines in a log, one line on a terminal, both with estimates and failed shots."""

import argparse
import io
import os
import sys
from dataclasses import replace

import pytest

from warpimpact.cli.common import show_run
from warpimpact.results.measures import Measure
from warpimpact.runs.run import RunProgress
from warpimpact.statistics.intervals import Estimate

LOUD = argparse.Namespace(quiet=False)
VELOCITY = "mean(residual_velocity) 731.25 (730.5 to 732) m/s"


def progress_at(done: int, *, failed: int = 0, resumed: int = 100) -> RunProgress:
    estimates = {Measure.parse("mean(residual_velocity)"): Estimate(731.25, 730.5, 732.0, done, 10.0)}
    return RunProgress(done, 1000, done, resumed, failed, estimates)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr("warpimpact.cli.common.time.monotonic", lambda: now[0])
    return now


def test_a_log_gets_a_line_per_tenth_and_per_minute(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run(LOUD) as show:
        for done in range(100, 1001, 10):
            clock[0] += 0.1
            show(progress_at(done, failed=done // 300))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 10
    assert lines[0] == "100 of 1000 hits"
    # 100 hits a second; no rate stands in a line before 2 s have passed since the first of them.
    assert "hits/s" not in "".join(lines[:2])
    assert lines[3] == f"400 of 1000 hits, 100 hits/s, 6 s left; 1 failed, {VELOCITY}"
    assert lines[-1].startswith("1000 of 1000 hits, 100 hits/s, 0 s left; ")
    clock[0] = 0.0
    with show_run(LOUD) as show:
        for _ in range(100):
            show(progress_at(101))
            clock[0] += 60.0
    assert len(capsys.readouterr().err.splitlines()) == 100


def test_a_terminal_gets_one_line_that_never_goes_back(monkeypatch: pytest.MonkeyPatch, clock: list[float]) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((80, 24)))
    with show_run(LOUD) as show:
        for done in (100, 200, 600, 590, 1000):  # hits under way may be given up
            show(progress_at(done, failed=3))
            clock[0] += 1.0
    *lines, end = terminal.getvalue().split("\x1b[K")
    assert end == "\n"
    assert [line.split()[0] for line in lines] == ["100", "200", "600", "600", "1000"]
    assert lines[-1] == f"\r1000 of 1000 hits, 266.7 hits/s, 0 s left; 3 failed, {VELOCITY}"[:80]


def test_a_log_says_what_a_pilot_tries_and_counts_no_time_of_it(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    begun = progress_at(0, resumed=0)
    with show_run(LOUD) as show:
        for tenth in range(700):
            show(replace(begun, piloting=True, level=2 if tenth < 300 else 4))
            clock[0] += 0.1
        for done, seconds in ((0, 20.0), (1, 3.0), (0, 0.99), (400, 0.0)):  # kernels are compiled before the first hit
            show(progress_at(done, resumed=0))
            clock[0] += seconds
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "choosing the resolution: level 2 (2 s)"
    assert sum("level 4" in line for line in lines) < 10
    assert [line for line in lines if line.startswith("0 of")] == ["0 of 1000 hits"]
    assert lines[-1].startswith("400 of 1000 hits, 100 hits/s, 6 s left; ")
    assert sum(" s left" in line for line in lines) == 1
