"""The march of a scene's shots on a device: growing windows and threads."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import Variable
from warpimpact.solver.device import Worker, find_device, launching, load, thread_pool
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import Cost, Prepared

Numbers = NDArray[np.int64]
Progress = Callable[[int, int], None]

MAX_DOUBLINGS = 6
"""Most times that the windows are doubled for shots that leave theirs."""
SHARES = 3
"""Fewest batches per thread into which the remaining shots would be divided."""
SHORTEST, LONGEST = 0.002, 0.25
"""Shortest and longest time that a batch shall take [s]. A computation can be cancelled between two batches."""
REPORT_INTERVAL = 0.1
"""Time between two reports of progress while threads compute [s]."""
STRIP = 5e-4
"""Width of the strips of hits that cores take one after another [m]."""


class March(NamedTuple):
    """Shots that have marched.

    Attributes:
        memory: memory with the shots. Windows that do not fit a block have a memory for the simple layout.
        cells: cells of the widest window of the plate, in each direction.
        outcomes: the kernels' Outcomes, on the device.
    """

    memory: Memory
    cells: int
    outcomes: Any


def march(
    memory: Memory, worker: Worker | None = None, progress: Progress | None = None, cells: int | None = None
) -> March:
    """March all shots, and march those again in wider windows which leave theirs.

    A CPU launch runs its shots one after another on the calling thread, without the interpreter lock. Signals reach
    the main thread, so it computes nothing where others do: an interrupt need not wait for a long shot.

    Args:
        progress: as in `simulate`.
        cells: cells of the plate's window; by default as many as shots need.

    Raises:
        MemoryError: no window that holds a core fits.
    """
    worker = worker or Worker()
    count, outcomes, device = len(memory.prepared.shots), memory.outcomes(), memory.device
    threads, sizes = max(1, min(launching(worker.threads), count)), MAX_DOUBLINGS if cells is None else 1
    cells, pending, finished = cells or memory.first_cells(threads), np.arange(count), 0

    def report(done: int) -> None:
        worker.cancel.check()
        if progress is not None:
            progress(finished + done, count)

    for size in range(1, sizes + 1):
        memory = memory.with_windows(cells)
        load(memory.stage.kernel, device)
        slots, scratches = memory.scratches(cells, threads)
        in_order = memory.variant.free_surface and device.is_cpu
        order = memory.put(cache_order(memory.prepared, pending) if in_order else pending, wp.int32)
        if len(scratches) == 1:
            batches = Batches(len(pending), 1, report, of=slots if device.is_cuda else None)
            memory.launch(order, outcomes, scratches[0], slots, batches)
        else:
            batches = Batches(len(pending), SHARES * len(scratches))
            with thread_pool(len(scratches)) as pool:
                try:
                    working = set[Future[None]]()
                    for scratch in scratches:
                        working.add(pool.submit(memory.launch, order, outcomes, scratch, slots, batches))
                    while working:
                        ended, working = wait(working, REPORT_INTERVAL, FIRST_EXCEPTION)
                        for thread in ended:
                            thread.result()
                        report(batches.done)
                finally:
                    batches.end()
        pending = np.flatnonzero(outcomes.status.numpy() == Status.LEFT_WINDOW)
        finished = count - len(pending)
        if not len(pending) or size == sizes or memory.slots(2 * cells, threads) == 0:
            break
        cells *= 2
    finished = 0
    report(count)
    return March(memory, cells, outcomes)


@dataclass(frozen=True)
class FastLawComputation:
    """Shots that the fast law will compute, each on its own copy of the target (docs/model.md §§1–5).

    It is a `Computation` (solver/method.py).
    """

    prepared: Prepared
    worker: Worker
    variables: ClassVar[tuple[Variable, ...]] = ()

    @property
    def is_double(self) -> bool:
        """Whether the outcomes are in double precision."""
        return self.prepared.resolution.double

    @property
    def cost(self) -> Cost:
        """What a shot takes, foreseen."""
        return self.prepared.cost

    @cached_property
    def _memory(self) -> Memory:
        return Memory(self.prepared, find_device(self.worker.device), self.worker.cancel)

    def build(self) -> None:
        """Compile the kernels, once per version and machine, and load them."""
        self._memory.build()

    def compute(self, progress: Progress | None = None) -> Outcomes:
        """Compute every shot."""
        memory, _, contact = march(self._memory, self.worker, progress)
        return memory.report(contact)


class Batches:
    """Some shots in batches, each as its first place and its number of shots; iterated by several threads at once.

    The first batches have one shot each, because some scenes take seconds per shot. The last ones are small, so that no
    thread waits long for another.

    Args:
        total: number of shots.
        shares: fewest batches into which the remaining shots would be divided, unless these take no time.
        report: called with the number of shots that are done, after each batch.
        of: number of shots of every batch.
    """

    def __init__(
        self, total: int, shares: int, report: Callable[[int], object] = lambda done: None, of: int | None = None
    ) -> None:
        self.total, self.done, self._shares, self._report, self._of = total, 0, shares, report, of
        self._begun, self._pace, self._lock = 0, math.inf, threading.Lock()

    def __iter__(self) -> Iterator[tuple[int, int]]:
        while (batch := self._next())[1]:
            begin = time.perf_counter()
            yield batch
            with self._lock:
                self.done += batch[1]
                self._pace = max(time.perf_counter() - begin, 1e-9) / batch[1]
            self._report(self.done)

    def _next(self) -> tuple[int, int]:
        with self._lock:
            left, fewest, most = self.total - self._begun, SHORTEST / self._pace, LONGEST / self._pace
            count = self._of or min(max(left // self._shares, int(fewest)), int(most))
            first, count = self._begun, min(max(1, count), left)
            self._begun += count
            return first, count

    def end(self) -> None:
        """Leave the remaining shots to nobody."""
        with self._lock:
            self._begun = self.total


def cache_order(prepared: Prepared, which: Numbers) -> Numbers:
    """Shots in the order of their hits in a period of the plate, strip by strip, to and fro. A core then finds most of
    what it reads of the cover in the processor's cache, where the core before it left it."""
    shots, period = prepared.shots, prepared.scene.target.layers[0].pattern.period
    y, z = (np.mod(hits[which], extent) for hits, extent in zip((shots.hit_y, shots.hit_z), period, strict=True))
    strip = (y / STRIP).astype(int)
    return which[np.lexsort((np.where(strip % 2, -z, z), strip))]
