"""Progress of a computation: a bar on a terminal, plain lines in a log."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from .mistakes import Plain, say

if TYPE_CHECKING:
    from warpimpact.results.measures import Measure
    from warpimpact.runs.progress import RunProgress
    from warpimpact.statistics.intervals import Estimate

_SILENCE = 60.0
"""Longest time between two lines of a log [s]."""
_SHORT = 2.0
"""Seconds after which a pilot is announced, and after the first item a rate."""
_BAR_FORMAT = "{l_bar}{bar:20}{r_bar}"
"""Format of a bar on a terminal. Its width is fixed, because estimates beside it would leave it one character."""


_quiet = False


def set_verbosity(*, verbose: int, quiet: bool) -> None:
    """Set what a command writes beside its output and its warnings.

    Args:
        verbose: 1 shows the log of the package from INFO on, 2 from DEBUG on.
        quiet: whether no progress is shown.
    """
    global _quiet
    _quiet = quiet
    logger = logging.getLogger("warpimpact")
    logger.handlers.clear()
    if verbose:
        handler = logging.StreamHandler(Plain(sys.stderr))
        handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s", "%H:%M:%S"))
        logger.addHandler(handler)
        logger.setLevel(logging.INFO if verbose == 1 else logging.DEBUG)


def warn(sentence: str) -> None:
    """Warn the user on the terminal or in the log, while the command goes on."""
    say(f"warning: {sentence}")


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
def show_progress(unit: str = "hit") -> Iterator[Callable[[Step], None]]:
    """Show the progress of a computation, or of several one after another.

    Args:
        unit: name of the counted items.
    """
    if _quiet:
        yield lambda step: None
        return
    if not sys.stderr.isatty():
        yield _Log(unit).show
        return
    from tqdm import tqdm

    with tqdm(unit=unit, dynamic_ncols=True, bar_format=_BAR_FORMAT, miniters=0, smoothing=0.0) as bar:

        def show(step: Step) -> None:
            if step.before or bar.total is None or _another(step, int(bar.n), int(bar.total)):
                bar.reset(step.total)
                bar.n = bar.initial = step.resumed
            elif bar.initial == step.resumed < step.done:  # kernels may have been compiled before the first item
                bar.reset(step.total)
                bar.n = bar.initial = step.done
            bar.set_postfix_str(step.before or step.text, refresh=bool(step.before))
            bar.update(max(0, step.done - bar.n))

        yield show


def _another(step: Step, done: int, total: int) -> bool:
    """Whether a step belongs to another computation than the one that was at `done` of `total`."""
    return total > 0 and (step.total != total or step.done < done == total)


class _Log:
    """Writes a line at the start, after every tenth, and every minute."""

    def __init__(self, unit: str) -> None:
        self._unit = unit
        self._begin = self._last = time.monotonic()
        self._tenths, self._before = -1, ""
        self._step = Step(0, 0)
        self._first = 0

    def show(self, step: Step) -> None:
        """Take in the progress of the computation."""
        now, last = time.monotonic(), self._step
        new = not last.total or _another(step, last.done, last.total) or bool(step.before) != bool(last.before)
        if new:  # the clock starts again
            self._begin, self._last, self._tenths, self._before = now, now, -1, ""
            self._first = step.resumed
        elif self._first == step.resumed < step.done:  # kernels may have been compiled before the first item
            self._begin, self._first = now, step.done
        step = step if new else step._replace(done=max(step.done, last.done))  # what is under way may be given up
        self._step = step
        elapsed = now - self._begin
        silent = now - self._last < _SILENCE
        if step.before:
            if elapsed < _SHORT or (silent and step.before == self._before):
                return
            self._before, line = step.before, f"{step.before}, for {elapsed:.0f} s so far"
        else:
            tenths = 10 * step.done // step.total
            if silent and tenths == self._tenths:
                return
            self._tenths, line = tenths, self._line(step, elapsed)
        self._last = now
        print(line, file=sys.stderr, flush=True)

    def _line(self, step: Step, elapsed: float) -> str:
        line, fresh = f"{step.done} of {step.total} {self._unit}s", step.done - self._first
        if fresh > 0 and elapsed >= _SHORT:
            left = (step.total - step.done) * elapsed / fresh
            line += f", {fresh / elapsed:.4g} {self._unit}s/s, {left:.0f} s left"
        return f"{line}; {step.text}" if step.text and step.done > step.resumed else line


@contextmanager
def show_run() -> "Iterator[Callable[[RunProgress], None]]":
    """Show the progress of a run, with its running estimates."""
    if _quiet:
        yield lambda run: None
        return
    with show_progress() as show:
        yield lambda run: show(Step(run.done, run.total, run.resumed, _running(run), _pilot(run)))


def _pilot(run: "RunProgress") -> str:
    if not run.piloting:
        return ""
    return "a pilot looks for the resolution" + ("" if run.trying is None else f", level {run.trying}")


def _running(run: "RunProgress") -> str:
    """Running estimates and failed shots as one short line."""
    from warpimpact.analysis.numbers import interval_text, plus_minus

    def text_of(measure: "Measure", estimate: "Estimate") -> str:
        if measure.is_binary:  # a share is not in the middle of its interval
            return f"{estimate.value:.4g} ({interval_text(estimate.low, estimate.high, text='{:.4g}'.format)})"
        return plus_minus(estimate.times(measure.display.factor), ".5g", ".2g") + measure.display.suffix

    parts = [
        f"{measure.text} {text_of(measure, estimate)}"
        for measure, estimate in run.estimates.items()
        if estimate.count > 1
    ]
    if run.pilot is not None:
        parts.append(run.pilot.phrase)
    return ", ".join([*parts, f"{run.failed} failed"])
