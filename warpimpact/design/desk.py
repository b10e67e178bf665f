"""One computation at a time: a thread that computes jobs, the most urgent first."""

from __future__ import annotations

import asyncio
import heapq
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from typing import Any, TypeVar

from warpimpact.solver.worker import Cancel, Cancelled

Result = TypeVar("Result")


@dataclass(order=True)
class _PageJob:
    """Attributes:
    urgency, number: smaller ones come first.
    work: called with the token that cancels it.
    future: gets the result or the error.
    cancel: cancels the job.
    dropped: whether nobody waits for the job any more.
    """

    urgency: int
    number: int
    work: Callable[[Cancel], Any] = field(compare=False)
    future: Future[Any] = field(compare=False, default_factory=Future)
    cancel: Cancel = field(compare=False, default_factory=Cancel)
    dropped: bool = field(compare=False, default=False)


class Desk:
    """Computes for any number of pages, one job at a time.

    A new job puts off a less urgent running one, which begins again later. So a page that refines its map does not keep
    another one waiting.
    """

    def __init__(self) -> None:
        self._waiting: list[_PageJob] = []
        self._running: _PageJob | None = None
        self._numbers = count()
        self._change = threading.Condition()
        threading.Thread(target=self._work, daemon=True, name="desk").start()

    async def do(self, urgency: int, work: Callable[[Cancel], Result]) -> Result:
        """Return or raise what `work` does. If the awaiting task is cancelled, so is the work, at once.

        Args:
            urgency: 0 is the most urgent.
            work: called with the token that cancels it, in the thread of the desk.
        """
        job = _PageJob(urgency, next(self._numbers), work)
        with self._change:
            heapq.heappush(self._waiting, job)
            if self._running is not None and self._running.urgency > urgency:
                self._running.cancel.cancel()
            self._change.notify()
        try:
            done: Result = await asyncio.wrap_future(job.future)
            return done
        except asyncio.CancelledError:
            with self._change:
                job.dropped = True
                job.cancel.cancel()
            raise

    def _work(self) -> None:
        while True:
            with self._change:
                self._running = None
                while not self._waiting:
                    self._change.wait()
                job = heapq.heappop(self._waiting)
                if job.dropped:
                    continue
                job.cancel, self._running = Cancel(), job
            self._compute(job)

    def _compute(self, job: _PageJob) -> None:
        try:
            result = job.work(job.cancel)
        except Cancelled:
            with self._change:
                if not job.dropped:  # put off
                    heapq.heappush(self._waiting, job)
        except BaseException as error:
            _settle(job.future.set_exception, error)
        else:
            _settle(job.future.set_result, result)


def _settle(tell: Callable[[Any], None], end: Any) -> None:
    """Set the result or the error of a future, unless it was cancelled and nobody waits for it."""
    with suppress(InvalidStateError):
        tell(end)
