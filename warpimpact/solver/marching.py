"""The march of a scene's shots on a device: growing windows and threads."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from queue import SimpleQueue
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

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Progress = Callable[[int, int], None]
Progress1 = Callable[[int], None]
Launch = Callable[[Any, int, int, int], int]

FEWEST_CELLS = 16
"""Fewest cells along a side of the plate's window. A smaller window would hold no core."""
MAX_DOUBLINGS = 6
"""Most times that the windows are doubled for shots that leave theirs."""
LARGEST_CHUNK = 64
"""Most shots of a chunk, where another thread reports the progress."""
SHARES = 3
"""Fewest chunks per thread into which the remaining shots would be divided."""
SHORTEST, LONGEST = 0.002, 0.25
"""Shortest and longest time that a chunk shall take [s]. A computation can be cancelled between two chunks."""
STRIP = 5e-4
"""Width of the strips of hits that cores take one after another [m]."""


class Helpers(NamedTuple):
    """A pool whose threads compute a scene each, and the number of its threads that may help with another scene."""

    pool: Executor
    threads: int


class Marching:
    """The march of the shots in the memory of a device; see `simulate` for the arguments.

    Attributes:
        helpers: threads that help a thread other than the main one when they have nothing else to do.
        memory: memory with the shots. Windows that do not fit a block have a memory for the simple layout.
        cells: cells of the plate's window.
        sizes: number of window sizes to try, each twice as wide as the one before.
    """

    def __init__(self, memory: Memory, threads: int | None = None, helpers: Helpers | None = None) -> None:
        self.memory = memory
        self.threads, self.helpers, self.sizes = launching(threads), helpers, MAX_DOUBLINGS
        self.cells = self._window_cells()

    def march(self, progress: Progress | None = None, cancel: Cancel = NEVER) -> Any:
        """March all shots, and march those again in wider windows which leave theirs."""
        outcomes = self.memory.outcomes()
        count = len(outcomes.status)

        def reached(finished: int, done: int) -> None:
            cancel.check()
            if progress is not None:
                progress(finished + done, count)

        pending = np.arange(count)
        for size in range(1, self.sizes + 1):
            self._march_some(pending, outcomes, partial(reached, count - len(pending)))
            pending = np.flatnonzero(outcomes.status.numpy() == Status.LEFT_WINDOW)
            wider = 2 * self.cells[0], 2 * self.cells[1]
            if not len(pending) or size == self.sizes or not self._fits(wider):
                break
            self.widen(wider)
        reached(count, 0)
        return outcomes

    def widen(self, cells: Cells) -> None:
        """Set wider windows. Windows that do not fit a block need the simple layout."""
        self.cells, prepared = cells, self.memory.prepared
        if 0 < prepared.variant.window < math.prod(cells):
            simple = replace(prepared, variant=replace(prepared.variant, window=0))
            wider = Memory(simple, self.memory.device)
            wider.passage, wider.history = self.memory.passage, self.memory.history  # these hold the finished shots
            self.memory = wider

    def _window_cells(self) -> Cells:
        """Cells of the first window, fewer if memory does not allow them.

        Raises:
            MemoryError: no window that holds a core fits.
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
            if memory.variant.free_surface:
                which = one_beside_another(memory.prepared, which)
            launch = partial(memory.launch, memory.put(which, wp.int32), outcomes)
            self._on_threads(launch, apiece, len(which), progress)
            return
        slots, scratch = halving(slots, lambda slots: memory.scratch(slots, cells))
        order = memory.put(which, wp.int32)
        for first in range(0, len(which), slots):
            count = memory.launch(order, outcomes, scratch, slots, first, min(slots, len(which) - first))
            wp.synchronize_device(memory.device)
            progress(first + count)

    def _on_threads(self, launch: Launch, apiece: list[Any], total: int, progress: Progress1) -> None:
        """Compute chunks of shots on threads with a scratch each. A CPU launch runs its shots one after another on the
        calling thread, without the interpreter lock."""
        if len(apiece) == 1 and threading.current_thread() is not threading.main_thread():
            self._here(launch, apiece[0], total, progress)
            return
        chunks, ended = Chunks(total, SHARES * len(apiece), LARGEST_CHUNK), SimpleQueue[int]()
        # Signals reach the main thread, so it computes nothing: an interrupt need not wait for a long shot.
        pool = ThreadPoolExecutor(len(apiece))
        try:
            threads = [pool.submit(_work, launch, scratch, chunks, ended.put) for scratch in apiece]
            for thread in threads:
                thread.add_done_callback(lambda _: ended.put(0))
            while chunks.done < total:
                ended.get()
                for thread in threads:
                    if thread.done():
                        thread.result()
                progress(chunks.done)
        finally:
            chunks.end()
            pool.shutdown(wait=False, cancel_futures=True)

    def _here(self, launch: Launch, scratch: Any, total: int, progress: Progress1) -> None:
        """Compute chunks of shots on this thread, and on helper threads that have nothing else to do."""
        memory, cells, helpers = self.memory, self.cells, self.helpers
        # Without helpers few chunks: between two of them, this thread may wait for one that prepares another scene.
        chunks = Chunks(total, SHARES * (1 + helpers.threads) if helpers else 1, total)

        def others_work() -> None:
            with suppress(MemoryError):
                _work(launch, halving(1, lambda slots: memory.scratch(slots, cells))[1], chunks, lambda _: None)

        threads = [helpers.pool.submit(others_work) for _ in range(helpers.threads)] if helpers else []
        try:
            _work(launch, scratch, chunks, lambda _: progress(chunks.done))
        finally:
            chunks.end()
            for thread in threads:
                if not thread.cancel():
                    thread.result()
        progress(chunks.done)


class Chunks:
    """Some shots in chunks; safe to use by several threads.

    The first chunks have one shot each, because some scenes take seconds per shot. The last ones are small, so that no
    thread waits long for another.

    Attributes:
        total, done: numbers of all shots and of computed ones.
    """

    def __init__(self, total: int, shares: int, most: int) -> None:
        """Chunks of shots none of which is computed.

        Args:
            shares: fewest chunks into which the remaining shots would be divided, unless these take no time.
            most: most shots of a chunk.
        """
        self.total, self.done = total, 0
        self._shares, self._most = shares, most
        self._begun, self._pace, self._lock = 0, math.inf, threading.Lock()

    def take(self) -> tuple[int, int]:
        """The first shot of the next chunk and its number of shots; 0 where none is left."""
        with self._lock:
            left, fewest, most = self.total - self._begun, SHORTEST / self._pace, LONGEST / self._pace
            count = min(max(left // self._shares, int(fewest)), int(most), self._most)
            first, count = self._begun, min(max(1, count), left)
            self._begun += count
            return first, count

    def computed(self, count: int, seconds: float) -> None:
        """Count the shots of a computed chunk, which took these seconds."""
        with self._lock:
            self.done += count
            self._pace = max(seconds, 1e-9) / count

    def end(self) -> None:
        """Leave the remaining shots to nobody."""
        with self._lock:
            self._begun = self.total


def _work(launch: Launch, scratch: Any, chunks: Chunks, ended: Callable[[int], object]) -> None:
    """Take and compute chunks, until none is left."""
    while (chunk := chunks.take())[1]:
        begin = time.perf_counter()
        launch(scratch, 1, *chunk)
        chunks.computed(chunk[1], time.perf_counter() - begin)
        ended(chunk[1])


def apart(function: Callable[..., int], *arguments: Any) -> int:
    """Call a function that releases the interpreter lock on another thread, so that signals are handled meanwhile."""
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(function, *arguments).result()
    finally:
        pool.shutdown(wait=False)


def one_beside_another(prepared: Prepared, which: Numbers) -> Numbers:
    """Shots in the order of their hits in a period of the plate, strip by strip, to and fro. A core then finds most of
    what it reads of the cover in the processor's cache, where the core before it left it."""
    shots, period = prepared.shots, prepared.scene.target.layers[0].pattern.period
    y, z = (np.mod(hits[which], extent) for hits, extent in zip((shots.hit_y, shots.hit_z), period, strict=True))
    strip = (y / STRIP).astype(int)
    return which[np.lexsort((np.where(strip % 2, -z, z), strip))]
