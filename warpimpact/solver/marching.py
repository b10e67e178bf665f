"""The march of a scene's shots on a device: growing windows and threads."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.solver.device import halving, launching, load
from warpimpact.solver.grid import Cells
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import Prepared
from warpimpact.solver.worker import NEVER, Cancel

Numbers = NDArray[np.int64]
Progress = Callable[[int, int], None]

FEWEST_CELLS = 16
"""Fewest cells along a side of the plate's window. A smaller window would hold no core."""
MAX_DOUBLINGS = 6
"""Most times that the windows are doubled for shots that leave theirs."""
SHARES = 3
"""Fewest chunks per thread into which the remaining shots would be divided."""
SHORTEST, LONGEST = 0.002, 0.25
"""Shortest and longest time that a chunk shall take [s]. A computation can be cancelled between two chunks."""
REPORT_INTERVAL = 0.1
"""Time between two reports of progress while threads compute [s]."""
STRIP = 5e-4
"""Width of the strips of hits that cores take one after another [m]."""


class March(NamedTuple):
    """Shots that have marched.

    Attributes:
        memory: memory with the shots. Windows that do not fit a block have a memory for the simple layout.
        cells: cells of the widest window of the plate.
        outcomes: the kernels' Outcomes, on the device.
    """

    memory: Memory
    cells: Cells
    outcomes: Any


def march(
    memory: Memory,
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel = NEVER,
    cells: Cells | None = None,
) -> March:
    """March all shots, and march those again in wider windows which leave theirs.

    Args:
        threads, progress, cancel: as in `simulate`.
        cells: cells of the plate's window; by default as many as shots need.

    Raises:
        MemoryError: no window that holds a core fits.
    """
    count, outcomes = len(memory.prepared.shots), memory.outcomes()
    threads, sizes = max(1, min(launching(threads), count)), MAX_DOUBLINGS if cells is None else 1
    cells = cells or _first_cells(memory, threads)
    memory, pending = memory.with_windows(cells), np.arange(count)
    for size in range(1, sizes + 1):

        def report(done: int, finished: int = count - len(pending)) -> None:
            cancel.check()
            if progress is not None:
                progress(finished + done, count)

        _march_some(memory, cells, threads, pending, outcomes, report)
        pending = np.flatnonzero(outcomes.status.numpy() == Status.LEFT_WINDOW)
        wider = 2 * cells[0], 2 * cells[1]
        if not len(pending) or size == sizes or memory.slots(wider, threads) == 0:
            break
        cells, memory = wider, memory.with_windows(wider)
    if progress is not None:
        progress(count, count)
    return March(memory, cells, outcomes)


def _first_cells(memory: Memory, threads: int) -> Cells:
    """Cells of the first window, fewer if memory does not allow them."""
    cells = first = (memory.prepared.cells,) * 2
    while memory.slots(cells, threads) == 0:  # a shot that leaves a smaller window ends as LEFT_WINDOW
        cells = cells[0] // 2, cells[1] // 2
        if min(cells) < FEWEST_CELLS:
            raise MemoryError(memory.too_large(first))
    return cells


def _march_some(
    memory: Memory, cells: Cells, threads: int, which: Numbers, outcomes: Any, report: Callable[[int], None]
) -> None:
    """March the shots of the given numbers in windows of one size.

    A CPU launch runs its shots one after another on the calling thread, without the interpreter lock. Signals reach
    the main thread, so it computes nothing where others do: an interrupt need not wait for a long shot.
    """
    load(memory.stage.kernel, memory.device)
    slots = memory.slots(cells, threads)
    if not memory.device.is_cpu:
        slots, scratch = halving(slots, lambda slots: memory.scratch(slots, cells))
        order = memory.put(which, wp.int32)
        for first in range(0, len(which), slots):
            count = min(slots, len(which) - first)
            memory.launch(order, outcomes, scratch, slots, first, count)
            wp.synchronize_device(memory.device)
            report(first + count)
        return
    slots, scratches = halving(slots, lambda slots: [memory.scratch(1, cells) for _ in range(slots)])
    order = memory.put(cache_order(memory.prepared, which) if memory.variant.free_surface else which, wp.int32)
    chunks = Chunks(len(which), SHARES * slots if slots > 1 else 1)
    launches = [partial(memory.launch, order, outcomes, scratch, 1) for scratch in scratches]
    if slots == 1:
        chunks.launch_all(launches[0], report)
        return
    pool = ThreadPoolExecutor(slots)
    try:
        working = {pool.submit(chunks.launch_all, launch) for launch in launches}
        while working:
            ended, working = wait(working, REPORT_INTERVAL, FIRST_EXCEPTION)
            for thread in ended:
                thread.result()
            report(chunks.done)
    finally:
        chunks.end()
        pool.shutdown(wait=False, cancel_futures=True)


class Chunks:
    """Some shots in chunks; safe to use by several threads.

    The first chunks have one shot each, because some scenes take seconds per shot. The last ones are small, so that no
    thread waits long for another.

    Args:
        total: number of shots.
        shares: fewest chunks into which the remaining shots would be divided, unless these take no time.
    """

    def __init__(self, total: int, shares: int) -> None:
        self.total, self.done, self._shares = total, 0, shares
        self._begun, self._pace, self._lock = 0, math.inf, threading.Lock()

    def launch_all(
        self, launch: Callable[[int, int], object], report: Callable[[int], object] = lambda done: None
    ) -> None:
        """Launch chunks, each with its first place and its number of shots, until none is left."""
        while (chunk := self._next())[1]:
            begin = time.perf_counter()
            launch(*chunk)
            with self._lock:
                self.done += chunk[1]
                self._pace = max(time.perf_counter() - begin, 1e-9) / chunk[1]
            report(self.done)

    def _next(self) -> tuple[int, int]:
        with self._lock:
            left, fewest, most = self.total - self._begun, SHORTEST / self._pace, LONGEST / self._pace
            count = min(max(left // self._shares, int(fewest)), int(most))
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
