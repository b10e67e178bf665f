"""Who scores sets of parameters: the threads of this process, and processes of their own for a fit that takes a while.

Half of the time of a set with a scene of its own is Python's, in which threads wait for each other: two cores are used
to three quarters, and more than three hardly at all.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.identification.evaluate import evaluate
from warpimpact.identification.fit import Fit
from warpimpact.identification.likelihood import Score
from warpimpact.solver.device import cores, find_device
from warpimpact.solver.many import side_by_side
from warpimpact.solver.worker import Worker

Array = NDArray[np.float64]

WORTHWHILE = 2.0
"""Seconds of the first batches from which on processes are begun, each of which needs as long until it computes."""


class Batch(NamedTuple):
    """Sets of parameters that are scored together.

    Attributes:
        number: of the batch, and seed of the places of its hits.
        points: standard normal numbers, shape [sets, parameters].
    """

    number: int
    points: Array


Ended = Callable[[Batch, list[Score]], None]


@dataclass
class Crew:
    """Scores batches of sets; the scores do not depend on who computes them.

    Attributes:
        worker: the device, and the threads of this process.
        processes: so many at most, on a CPU. More than one need a main module that does nothing when it is imported.
    """

    fit: Fit
    worker: Worker
    processes: int = 1
    pool: ProcessPoolExecutor | None = field(default=None, init=False)

    def score(self, batches: Sequence[Batch], ended: Ended) -> None:
        """Score batches.

        Args:
            ended: called with each batch and its scores, by any thread.

        Raises:
            Exception: as `evaluate`.
        """
        begin = time.perf_counter()
        left = list(batches) if self.pool is None else self._by_processes(self.pool, batches, ended)

        def here(number: int, own: Worker, _: Any) -> None:
            ended(left[number], evaluate(self.fit, left[number].points, own, seed=left[number].number))

        side_by_side(here, len(left), self.worker)
        if self.pool is None and self.processes > 1 and time.perf_counter() - begin > WORTHWHILE:
            self._begin_processes()

    def _begin_processes(self) -> None:
        context, apiece = multiprocessing.get_context("spawn"), max(1, cores() // self.processes)
        self.pool = ProcessPoolExecutor(self.processes, context, _begun, (self.fit, apiece))

    def _by_processes(self, pool: ProcessPoolExecutor, batches: Sequence[Batch], ended: Ended) -> list[Batch]:
        """Score batches; returns those that the processes could not score. This one may, or tells why not."""
        left = dict(enumerate(batches))
        try:
            with _interrupts_held():
                futures = {pool.submit(_scored, batch): number for number, batch in left.items()}
            for future in as_completed(futures):
                number, scores = futures[future], future.result()
                if scores is not None:
                    ended(left[number], scores)
                    del left[number]
        except (BrokenProcessPool, OSError):  # one was killed, or none can be begun: memory may be short
            pool.shutdown(wait=False, cancel_futures=True)
            self.pool, self.processes = None, 1
        return list(left.values())


@contextmanager
def crew_of(fit: Fit, device: str, processes: int = 1) -> Iterator[Crew]:
    """A crew, whose processes end with the block.

    Raises:
        DeviceError: the device is absent.
    """
    crew = Crew(fit, Worker(device), processes if find_device(device).is_cpu else 1)
    try:
        yield crew
    finally:
        if crew.pool is not None:
            crew.pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Begin processes that Ctrl-C leaves alone, also while they load: it is for the one that it interrupts."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_own: dict[str, Any] = {}
"""Of a process of a crew: its fit and its worker."""


def _begun(fit: Fit, threads: int) -> None:
    """Begin a process of a crew."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _own.update(fit=fit, worker=Worker("cpu", threads))


def _end_with_parent() -> None:
    """A process whose parent was killed would wait for batches for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _scored(batch: Batch) -> list[Score] | None:
    """Scores by this process; None where it cannot."""
    with suppress(Exception):
        return evaluate(_own["fit"], batch.points, _own["worker"], seed=batch.number)
    return None
