"""Progress: plain lines in a log, a bar on a terminal, both with estimates and failed shots."""

import io
import re
import sys
import time
from dataclasses import replace

import pytest

from warpimpact.cli import main
from warpimpact.cli.progress import Step, show_progress, show_run
from warpimpact.results.measures import Measure
from warpimpact.runs.progress import RunProgress
from warpimpact.scene import Numerics
from warpimpact.solver.accuracy import PilotResult
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
    # 900 hits in 9 seconds after the 100 that were there; the line of 400 comes after 3.1 s.
    assert lines[3] == (
        "400 of 1000 hits, 96.77 hits/s, 6 s left; "
        "mean(residual_velocity) 731.25 ± 0.75 m/s, mean(tilt@130mm) 23 ± 1°, 1 failed"
    )
    assert lines[-1].startswith("1000 of 1000 hits, 98.9 hits/s, 0 s left; ")


def test_a_slow_run_is_not_silent(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run() as show:
        for _ in range(100):
            show(standing(101))
            clock[0] += 60.0
    assert len(capsys.readouterr().err.splitlines()) == 100  # of 100 minutes


def test_a_log_speaks_every_few_seconds_at_first_and_every_minute_later(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    with show_run() as show:
        for _ in range(600):
            show(standing(101))
            clock[0] += 0.1
        assert len(capsys.readouterr().err.splitlines()) == 12  # of the first minute
        clock[0] += 10_000.0
        for _ in range(1800):
            show(standing(101))
            clock[0] += 0.1
    assert len(capsys.readouterr().err.splitlines()) == 3


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


def test_a_line_tells_the_accuracy_that_the_pilot_found(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    for kept, end in (
        (True, "for 90 % of the hits, 0 failed"),
        (False, "for 90 % of the hits, not as promised, 0 failed"),
    ):
        found = PilotResult(Numerics(level=2), kept, 0.9, {"residual_velocity_error": 0.42, "tilt_error": 0.7})
        with show_run() as show:
            clock[0] += 1.0
            show(replace(standing(400), found=found))
        assert capsys.readouterr().err.splitlines()[0].endswith(f"accuracy 0.42 m/s and 0.7 deg {end}")


def test_a_log_says_what_a_pilot_tries_and_counts_no_time_of_it(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    begun = standing(0, resumed=0)
    with show_run() as show:
        for tenth in range(700):
            show(replace(begun, piloting=True, trying=2 if tenth < 300 else 4))
            clock[0] += 0.1
        show(begun)
        clock[0] += 4.0
        show(standing(400, resumed=0))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "a pilot looks for the resolution, level 2, for 2 s so far"
    assert sum("level 4" in line for line in lines) < 10
    assert [line for line in lines if line.startswith("0 of")] == ["0 of 1000 hits"]
    assert lines[-1].startswith("400 of 1000 hits, 100 hits/s, 6 s left; ")


def test_what_may_end_early_tells_the_most_time_that_is_left(
    capsys: pytest.CaptureFixture[str], clock: list[float]
) -> None:
    with show_progress("design") as show:
        show(Step(0, 6, certain=False, text="0 on the front", now="2 of 3 pilots"))
        clock[0] += 10.0
        show(Step(2, 6, certain=False, text="1 on the front", now="6 designs at 64 hits"))
        show(Step(2, 2, text="1 on the front"))
        clock[0] += 5.0
        show(Step(0, 2, now="solid plates"))
        clock[0] += 5.0
        show(Step(1, 2, now="solid plates"))
    assert capsys.readouterr().err.splitlines() == [
        "0 of at most 6 designs; 2 of 3 pilots",
        "2 of at most 6 designs, 0.2 designs/s, at most 20 s left; 1 on the front, 6 designs at 64 hits",
        "2 of 2 designs; 1 on the front",
        "0 of 2 designs; solid plates",
        "1 of 2 designs, 0.2 designs/s, 5 s left; solid plates",
    ]


def test_a_terminal_tells_the_part_that_is_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with show_progress("design") as show:
        show(Step(0, 6, certain=False, now="16 hits"))
        for done, now in ((3, "16 hits"), (3, "64 hits")):
            time.sleep(0.15)  # a bar is drawn anew at most ten times a second
            show(Step(done, 6, certain=False, now=now))
        assert re.search(r" 3/6 at most \[[^<]*, 64 hits]", terminal.getvalue())
        show(Step(0, 7, now="solid plates"))
        time.sleep(0.15)
        show(Step(0, 7, now="solid plates"))
        assert re.search(r" 0/7 \[00:00<.*, solid plates]", terminal.getvalue())


def test_a_short_pilot_says_nothing(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run() as show:
        show(replace(standing(0), piloting=True))
        clock[0] += 1.9
        show(replace(standing(0), piloting=True))
    assert capsys.readouterr().err == ""


def test_a_bar_keeps_its_width_beside_long_estimates(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with show_run() as show:
        show(replace(standing(100), piloting=True, trying=3))
        show(standing(500))
    shown = terminal.getvalue()
    assert "a pilot looks for the resolution, level 3" in shown
    assert len(shown.split("\r")[-1].split("|")[1]) == 20


def test_runs_one_after_another_begin_anew(capsys: pytest.CaptureFixture[str], clock: list[float]) -> None:
    with show_run() as show:
        for _ in range(2):
            for done in (0, 500, 1000):
                show(standing(done, resumed=0))
                clock[0] += 10.0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 6
    assert lines[4].startswith("500 of 1000 hits, 50 hits/s, 10 s left")


def test_quiet_lasts_for_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "--list", "-q"]) == 0
    with show_progress("shot") as show:
        show(Step(1, 2, 0, ""))
    assert "1 of 2" in capsys.readouterr().err
