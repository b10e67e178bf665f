"""The progress of a run, and how it is shown."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from warpimpact.results.measures import Measure
from warpimpact.solver.accuracy import PilotResult
from warpimpact.statistics.intervals import Estimate


@dataclass(frozen=True)
class RunProgress:
    """The progress of a run.

    Attributes:
        done, total: numbers of shots; `total` is the most that a stop rule allows.
        saved: shots of whole shards, which no interrupt loses; `done` also counts those of unfinished shards.
        resumed: shots that an earlier run had computed.
        failed: shots whose computation failed.
        estimates: running estimates of the main quantities, over the shots from the first on without a gap.
        piloting: whether the pilot is still running. No shot is done then.
        trying: level that the pilot computes; None where unknown.
        found: findings of the pilot; None if the campaign fixes the resolution.
    """

    done: int
    total: int
    saved: int
    resumed: int
    failed: int
    estimates: dict[Measure, Estimate]
    piloting: bool = False
    trying: int | None = None
    found: PilotResult | None = None


Follow = Callable[[RunProgress], None]


@contextmanager
def followed(given: Follow | None) -> Iterator[Follow]:
    """The function that shows the progress of a run: the given one, or a bar in a notebook. Elsewhere nothing is
    shown."""
    if given is not None or not _in_a_notebook():
        yield given or (lambda now: None)
        return
    with _bar()(unit="hit") as bar:

        def show(now: RunProgress) -> None:
            bar.total = now.total
            text = "a pilot looks for the resolution" if now.piloting else f"{now.failed} failed" if now.failed else ""
            bar.set_postfix_str(text, refresh=False)
            bar.update(now.done - bar.n)

        yield show
        bar.refresh()


def _bar() -> Any:
    """The progress bar class for notebooks if it works here, else the one for terminals."""
    if find_spec("ipywidgets"):
        from tqdm.notebook import tqdm as widget

        return widget
    from tqdm import tqdm

    return tqdm


def _in_a_notebook() -> bool:
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"
