"""Progress of a computation: one line that is rewritten on a terminal, lines in a log."""

import argparse
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from warpimpact.analysis.numbers import interval_text
from warpimpact.results.measures import Measure
from warpimpact.runs.progress import RunProgress
from warpimpact.statistics.intervals import Estimate

_SILENCE = {True: 0.1, False: 60.0}
"""Longest time between two lines [s], by whether they go to a terminal."""
_SHORT = 2.0
"""Seconds after which a pilot is announced, and after the first item a rate."""


class Step(NamedTuple):
    """The progress of a computation.

    Attributes:
        done, total: numbers of the counted items.
        resumed: items that an earlier computation had done, which do not count for the rate.
        text: further information.
        before: what is running before the first item; its time does not count for the rate.
    """

    done: int
    total: int
    resumed: int = 0
    text: str = ""
    before: str = ""


@contextmanager
def show_progress(arguments: argparse.Namespace, unit: str = "hit") -> Iterator[Callable[[Step], None]]:
    """Show the progress of a computation, or of several one after another.

    Args:
        arguments: with --quiet nothing is shown.
        unit: name of the counted items.
    """
    display = _Display(unit)
    yield (lambda step: None) if arguments.quiet else display.show
    display.end()


@contextmanager
def show_run(arguments: argparse.Namespace) -> Iterator[Callable[[RunProgress], None]]:
    """Show the progress of a run, with its running estimates."""
    with show_progress(arguments) as show:
        yield lambda run: show(Step(run.done, run.total, run.resumed, _running(run), _pilot(run)))


class _Display:
    """Writes a line at the start, after every tenth, and after a silence; on a terminal over the one before."""

    def __init__(self, unit: str) -> None:
        self._unit = unit
        self._step = Step(0, 0)
        self._begin = self._last = time.monotonic()
        self._first, self._phase = 0, ""
        self._is_terminal = sys.stderr.isatty()

    def show(self, step: Step) -> None:
        """Take in the progress of the computation."""
        now, last = time.monotonic(), self._step
        is_other = step.total != last.total or step.done < last.done == last.total
        if is_other or bool(step.before) != bool(last.before):
            self._begin, self._first, self._phase = now, step.resumed, ""
        else:  # items under way may be given up
            step = step._replace(done=max(step.done, last.done))
            if self._first == step.resumed < step.done:  # kernels may have been compiled before the first item
                self._begin, self._first = now, step.done
        self._step = step
        elapsed = now - self._begin
        phase = step.before or f"{10 * step.done // step.total}"
        is_silent = now - self._last < _SILENCE[self._is_terminal]
        if (is_silent and phase == self._phase) or (step.before and elapsed < _SHORT):
            return
        self._last, self._phase = now, phase
        line = f"{step.before}, for {elapsed:.0f} s so far" if step.before else self._line(step, elapsed)
        if self._is_terminal:
            line = f"\r{line[: shutil.get_terminal_size().columns - 1]}\x1b[K"
        print(line, end="" if self._is_terminal else "\n", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Go to the next line of a terminal."""
        if self._is_terminal and self._phase:
            print(file=sys.stderr)

    def _line(self, step: Step, elapsed: float) -> str:
        line, fresh = f"{step.done} of {step.total} {self._unit}s", step.done - self._first
        if fresh > 0 and elapsed >= _SHORT:
            left = (step.total - step.done) * elapsed / fresh
            line += f", {fresh / elapsed:.4g} {self._unit}s/s, {left:.0f} s left"
        return f"{line}; {step.text}" if step.text and step.done > step.resumed else line


def _pilot(run: RunProgress) -> str:
    if not run.piloting:
        return ""
    return "a pilot looks for the resolution" + ("" if run.level is None else f", level {run.level}")


def _running(run: RunProgress) -> str:
    """Write running estimates and failed shots as one short line."""

    def text_of(measure: Measure, estimate: Estimate) -> str:
        if measure.is_binary:  # a share is not in the middle of its interval
            return f"{estimate.value:.4g} ({interval_text(estimate.low, estimate.high, digits='.4g')})"
        mean = estimate.times(measure.display.factor)
        half_width = "" if math.isnan(mean.half_width) else f" ± {mean.half_width:.2g}"
        return f"{mean.value:.5g}{half_width}{measure.display.suffix}"

    parts = [
        f"{measure.text} {text_of(measure, estimate)}"
        for measure, estimate in run.estimates.items()
        if estimate.count > 1
    ]
    if run.pilot is not None:
        parts.append(run.pilot.phrase)
    return ", ".join([*parts, f"{run.failed} failed"])
