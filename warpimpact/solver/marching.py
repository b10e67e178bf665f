"""Marches the shots of a scene on a device: windows that grow, threads, and the order of the shots at one plate."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial
from queue import SimpleQueue
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.solver.device import halving, launching, load
from warpimpact.solver.memory import Memory
from warpimpact.solver.windows import Cells
from warpimpact.solver.worker import NEVER, Cancel

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Progress = Callable[[int, int], None]
Progress1 = Callable[[int], None]

CPU_CHUNK = 64
"""Most shots per launch on the CPU."""
SHARES = 3
"""Launches per thread into which the shots that are left would be divided at least."""
CPU_LAUNCH = 0.25
"""Seconds that a launch on the CPU is to take at most: a computation can be broken off between two of them."""
FEWEST_CELLS = 16
"""Along a side of the plate's window, which would hold no core if it were smaller still."""
MAX_DOUBLINGS = 6
"""Largest number of times that the windows are doubled for the shots that left theirs."""


class March:
    """The march of what is in the memory of a device; see `simulate` for the arguments.

    Attributes:
        memory: where the shots are. Windows that do not fit a block have another one, for the simple layout.
        cells: of the plate's window.
        sizes: of windows that are tried, each twice as wide as the one before.
    """

    def __init__(self, memory: Memory, threads: int | None = None) -> None:
        self.memory, self.at_a_plate = memory, memory.at_a_plate
        self.threads, self.sizes = launching(threads), MAX_DOUBLINGS
        self.cells = self._window_cells()

    def march(self, progress: Progress | None = None, cancel: Cancel = NEVER) -> Any:
        """March all shots; repeat those that leave their window in wider windows."""
        outcomes = self.memory.outcomes()
        count = len(outcomes.status)

        def reached(done: int) -> None:
            cancel.check()
            if progress is not None:
                progress(done, count)

        pending = np.arange(count)
        for size in range(1, self.sizes + 1):
            self._march_some(pending, outcomes, _after(count - len(pending), reached))
            pending = whole_plates(outcomes.status.numpy() == Status.LEFT_WINDOW, self.at_a_plate)
            wider = 2 * self.cells[0], 2 * self.cells[1]
            if not len(pending) or size == self.sizes or not self._fits(wider):
                break
            self.widen(wider)
        outcomes.status.assign(spoilt(outcomes.status.numpy(), self.at_a_plate))
        reached(count)
        return outcomes

    def widen(self, cells: Cells) -> None:
        """Have wider windows; those that do not fit a block are for the simple layout."""
        self.cells, prepared = cells, self.memory.prepared
        if 0 < prepared.variant.window < math.prod(cells):
            simple = replace(prepared, variant=replace(prepared.variant, window=0))
            wider = Memory(simple, self.memory.device)
            wider.passage, wider.history = self.memory.passage, self.memory.history  # with the shots that are done
            self.memory = wider

    def _window_cells(self) -> Cells:
        """Cells of a first window, or what memory allows.

        Raises:
            MemoryError: windows do not fit in which a core is at all.
        """
        cells = first = (self.memory.prepared.cells,) * 2
        while not self._fits(cells):  # a shot that leaves a smaller window ends as LEFT_WINDOW
            cells = cells[0] // 2, cells[1] // 2
            if min(cells) < FEWEST_CELLS:
                raise MemoryError(self.memory.too_large(first))
        return cells

    def _fits(self, cells: Cells) -> bool:
        return self.memory.slots(cells, self.threads) > 0

    def _march_some(self, which: Numbers, outcomes: Any, progress: Progress1) -> None:
        """March the shots of the given indices in windows of one size."""
        memory, cells = self.memory, self.cells
        load(memory.stage.kernel, memory.device)
        slots = memory.slots(cells, self.threads)
        if memory.device.is_cpu:
            _, apiece = halving(slots, lambda slots: [memory.scratch(1, cells) for _ in range(slots)])
            launch = partial(memory.launch, memory.put(which, wp.int32), outcomes)
            self._on_threads(launch, apiece, len(which), progress)
            return
        slots, scratch = halving(slots, lambda slots: memory.scratch(slots, cells))
        order = memory.put(in_turns(which, self.at_a_plate, slots), wp.int32)
        for first, count in turns(len(which), self.at_a_plate, slots):
            memory.launch(order, outcomes, scratch, slots, first, count)
            wp.synchronize_device(memory.device)
            progress(first + count)

    def _on_threads(self, launch: Callable[..., int], slots: list[Any], total: int, progress: Progress1) -> None:
        """Distribute chunks over threads, each with one slot. A CPU launch runs its shots one after another on the
        calling thread, without the interpreter lock."""
        idle = SimpleQueue[Any]()
        for scratch in slots:
            idle.put(scratch)

        def work(first: int, count: int) -> tuple[int, float]:
            scratch, begin = idle.get(), time.perf_counter()
            try:
                return launch(scratch, 1, first, count), time.perf_counter() - begin
            finally:
                idle.put(scratch)

        # The first launches are of one shot each, as some scenes take seconds per shot; so are the last ones, as no
        # thread is to wait long for another.
        most, begun, done = 1, 0, 0
        waiting: set[Future[tuple[int, float]]] = set()
        alone = len(slots) == 1 and threading.current_thread() is not threading.main_thread()  # which is interrupted
        pool = _Here() if alone else ThreadPoolExecutor(len(slots))
        # After each launch a thread may wait for the interpreter, while another one prepares its scene.
        largest = total if alone else CPU_CHUNK
        try:
            while done < total:
                while begun < total and len(waiting) < 2 * len(slots):
                    share = total - begun if alone else max(1, (total - begun) // (SHARES * len(slots)))
                    count = min(chunk_of(min(most, share), self.at_a_plate), total - begun)
                    waiting.add(pool.submit(work, begun, count))
                    begun += count
                ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for shots, seconds in (future.result() for future in ended):
                    done += shots
                    most = min(largest, max(1, int(CPU_LAUNCH * shots / max(seconds, 1e-9))))
                progress(done)
        finally:  # whoever interrupts does not wait for a shot that takes a minute
            pool.shutdown(wait=False, cancel_futures=True)


def apart(function: Callable[..., int], *arguments: Any) -> int:
    """Call what computes without the interpreter lock on a thread of its own, so that a signal need not wait for it."""
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(function, *arguments).result()
    finally:
        pool.shutdown(wait=False)


class _Here(Executor):
    """Calls on the thread that submits them."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        future = Future[Any]()
        future.set_result(function(*arguments, **named))
        return future


def _after(finished: int, progress: Progress1) -> Progress1:
    """Progress of what comes after the shots already finished."""
    return lambda done: progress(finished + done)


def whole_plates(which: NDArray[np.bool_], count: int) -> Numbers:
    """Indices of all shots at those plates of which any shot is marked."""
    return np.flatnonzero(np.repeat(which.reshape(-1, count).any(axis=1), count))


def in_turns(which: Numbers, count: int, slots: int) -> Numbers:
    """Shots in the order in which a device that computes so many plates at a time takes them: of each lot of plates
    first all first shots, then all second ones. Those at one plate are then in one slot, one after another."""
    lots = (which[first : first + slots * count] for first in range(0, len(which), slots * count))
    return np.concatenate([lot.reshape(-1, count).T.reshape(-1) for lot in lots])


def turns(total: int, count: int, slots: int) -> Iterator[tuple[int, int]]:
    """(first, number) of the launches that compute so many shots in the order of `in_turns`."""
    for first in range(0, total, slots * count):
        plates = min(slots, (total - first) // count)
        yield from ((first + turn * plates, plates) for turn in range(count))


def chunk_of(most: int, count: int) -> int:
    """Shots per launch, at most so many but at least one plate: those at one plate stay together."""
    return max(1, most // count) * count


def spoilt(status: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Statuses of all shots, in which a shot fails, too, where the computation of an earlier one at its plate failed:
    nobody knows what that one left of the plate."""
    rows = status.reshape(-1, count).copy()
    for order in range(1, count):
        before = rows[:, order - 1]
        rows[:, order] = np.where(before >= Status.UNFINISHED, before, rows[:, order])
    return rows.reshape(-1)
