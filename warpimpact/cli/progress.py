"""Progress of a computation: a bar on a terminal, plain lines in a log."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .plain import Plain, say

if TYPE_CHECKING:
    from warpimpact.results.measures import Measure
    from warpimpact.runs.progress import Standing
    from warpimpact.statistics.intervals import Estimate

_SILENCE, _LONGEST_SILENCE = 5.0, 60.0
"""Longest times between two lines of a log [s]: in the first minute, and of a run that takes hours. Between these it is
a twelfth of the time so far."""


_quiet = False


@contextmanager
def told(*, verbose: int, quiet: bool) -> Iterator[None]:
    """What a command tells beside its output and its warnings.

    Args:
        verbose: 1 shows the log of the package from INFO on, 2 from DEBUG on.
        quiet: whether no progress is shown.
    """
    global _quiet
    _quiet = quiet
    if not verbose:
        yield
        return
    import logging

    logger, handler = logging.getLogger("warpimpact"), logging.StreamHandler(Plain(sys.stderr))
    handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s", "%H:%M:%S"))
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO if verbose == 1 else logging.DEBUG)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


def is_quiet() -> bool:
    """Whether no progress is shown."""
    return _quiet


def warn(sentence: str) -> None:
    """Say on the terminal or in the log what a person should know, though the command goes on."""
    say(f"warning: {sentence}")


@contextmanager
def show_standing() -> "Iterator[Callable[[Standing], None]]":
    """Show the progress of a run, with its running estimates."""
    if _quiet:
        yield lambda standing: None
        return
    if not sys.stderr.isatty():
        yield _log_standing()
        return
    from tqdm import tqdm

    with tqdm(unit="hit", dynamic_ncols=True) as bar:

        def show(standing: "Standing") -> None:
            if bar.total is None:
                bar.total, bar.initial, bar.n = standing.total, standing.resumed, standing.resumed
            bar.set_postfix_str(_running(standing), refresh=False)
            bar.update(max(0, standing.done - bar.n))

        yield show


def _log_standing() -> "Callable[[Standing], None]":
    """A line at the start, after every tenth of the hits, and every few seconds."""
    shown, last, begin = -1, 0.0, time.monotonic()

    def show(standing: "Standing") -> None:
        nonlocal shown, last
        tenths, elapsed = 10 * standing.done // standing.total, time.monotonic() - begin
        silence = min(_LONGEST_SILENCE, max(_SILENCE, elapsed / 12.0))
        if tenths == shown and elapsed - last < silence:
            return
        shown, last = tenths, elapsed
        line = f"{standing.done} of {standing.total} hits"
        if (fresh := standing.done - standing.resumed) > 0 and elapsed > 0.0:
            left = (standing.total - standing.done) * elapsed / fresh
            line += f", {fresh / elapsed:.4g} hits/s, {left:.0f} s left; {_running(standing)}"
        print(line, file=sys.stderr, flush=True)

    return show


def _running(standing: "Standing") -> str:
    """Running estimates and failed shots as one short line."""
    from warpimpact.analysis.numbers import interval_text, plus_minus

    def told(measure: "Measure", estimate: "Estimate") -> str:
        if measure.is_binary:  # not in the middle of its interval
            return f"{estimate.value:.4g} ({interval_text(estimate.low, estimate.high, '{:.4g}'.format)})"
        return plus_minus(estimate.times(measure.display.factor), ".5g", ".2g") + measure.display.suffix

    parts = [
        f"{measure.text} {told(measure, estimate)}"
        for measure, estimate in standing.estimates.items()
        if estimate.count > 1
    ]
    if standing.promise is not None:
        parts.append(standing.promise.phrase)
    return ", ".join([*parts, f"{standing.failed} failed"])


@contextmanager
def show_count() -> Iterator[Callable[[int, int], None]]:
    """Show how many of the hits are done."""
    if _quiet:
        yield lambda done, total: None
        return
    if not sys.stderr.isatty():
        yield _log_count()
        return
    from tqdm import tqdm

    with tqdm(unit="hit") as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show


def _log_count() -> Callable[[int, int], None]:
    """A line after every tenth of the hits."""
    shown = 0

    def show(done: int, total: int) -> None:
        nonlocal shown
        tenths = 10 * done // total
        if tenths > shown:
            shown = tenths
            print(f"{done} of {total} hits", file=sys.stderr, flush=True)

    return show
