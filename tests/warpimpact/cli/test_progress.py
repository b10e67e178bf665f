"""Progress: plain lines in a log, a bar on a terminal, both with estimates and failed shots."""

import io
import sys
from dataclasses import replace

import pytest

from warpimpact.cli.progress import show_run
from warpimpact.results.measures import Measure
from warpimpact.runs.progress import RunProgress
from warpimpact.statistics.intervals import Estimate


def standing(done: int, *, failed: int = 0, resumed: int = 100) -> RunProgress:
    velocity = Estimate(731.25, 730.5, 732.0, done, 10.0)
    tilt = Estimate(23.0, 22.0, 24.0, done, 5.0)
    measures = (Measure.parse("mean(residual_velocity)"), Measure.parse("mean(tilt@130mm)"))
    return RunProgress(done, 1000, done, resumed, failed, dict(zip(measures, (velocity, tilt), strict=True)))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr("warpimpact.cli.progress.time.monotonic", lambda: now[0])
    return now


def test_a_log_gets_a_line_per_tenth(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run() as show:
        for done in range(100, 1001, 10):
            clock[0] += 0.1
            show(standing(done, failed=done // 300))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 10
    assert lines[0] == "100 of 1000 hits"
    # 100 hits a second; no rate stands in a line before 2 s have passed since the first of them.
    assert "hits/s" not in "".join(lines[:2])
    assert lines[3] == (
        "400 of 1000 hits, 100 hits/s, 6 s left; "
        "mean(residual_velocity) 731.25 ± 0.75 m/s, mean(tilt@130mm) 23 ± 1°, 1 failed"
    )
    assert lines[-1].startswith("1000 of 1000 hits, 100 hits/s, 0 s left; ")


def test_a_slow_run_is_not_silent(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run() as show:
        for _ in range(100):
            show(standing(101))
            clock[0] += 60.0
    assert len(capsys.readouterr().err.splitlines()) == 100  # of 100 minutes


def test_a_terminal_gets_a_bar_that_counts_what_was_resumed_as_done(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with show_run() as show:
        show(standing(100))
        show(standing(600, failed=3))
        show(standing(590, failed=3))  # what is under way may be given up: a bar does not go back
        show(standing(1000, failed=3))
    last = terminal.getvalue().split("\r")[-1]
    assert "1000/1000" in last
    assert "hit/s" in last
    assert "mean(residual_velocity) 731.25 ± 0.75 m/s" in last
    assert "3 failed" in last


def test_a_log_says_what_a_pilot_tries_and_counts_no_time_of_it(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    begun = standing(0, resumed=0)
    with show_run() as show:
        for tenth in range(700):
            show(replace(begun, piloting=True, trying=2 if tenth < 300 else 4))
            clock[0] += 0.1
        for done, seconds in ((0, 20.0), (1, 3.0), (0, 0.99), (400, 0.0)):  # kernels are compiled before the first hit
            show(standing(done, resumed=0))
            clock[0] += seconds
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "a pilot looks for the resolution, level 2, for 2 s so far"
    assert sum("level 4" in line for line in lines) < 10
    assert [line for line in lines if line.startswith("0 of")] == ["0 of 1000 hits"]
    assert lines[-1].startswith("400 of 1000 hits, 100 hits/s, 6 s left; ")
    assert sum(" s left" in line for line in lines) == 1
