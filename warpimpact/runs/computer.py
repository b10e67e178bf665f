"""Where tasks are computed: in this process, or by the workers of Dask.

A task is a function with its arguments, all of which can be pickled. The function also takes `worker`, which says where
to compute, and `report`, which it calls with its progress. A result depends only on the arguments and the kind of
device, so its bits are the same everywhere. If a worker of Dask dies, another one computes its tasks.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from typing import Any

from warpimpact.errors import ClusterError, DeviceError
from warpimpact.records import attributes as attr
from warpimpact.solver.device import Cancel, Worker, cores, find_device, thread_pool

POLL_SECONDS = 0.2
"""Seconds between two looks at progress, signals and the number of workers."""
NO_WORKER_SECONDS = 5.0
"""Seconds without a worker after which a scheduler is reported."""

Task = Callable[..., Any]
Tick = Callable[[list[Any]], object]
Report = Callable[[Any], object]
Warn = Callable[[str], object]


class Computer:
    """Computes tasks on the devices of this machine; `RunOptions.computer` opens one.

    On a CPU at most `threads` threads compute at a time. Either they share a task, which has a pool of that size
    (`thread_pool`), or each of them computes a task alone and opens no pool. On GPUs each device has one thread. The
    calling thread waits, so that an interrupt reaches it.

    Attributes:
        made_by: versions and kind of device, which determine the bits of a result.
        threads: most threads that compute at a time in this process.
    """

    def __init__(self, devices: list[str], cancel: Cancel) -> None:
        self.made_by = made_by(devices[0])
        self.threads = cores() if self.made_by[attr.DEVICE] == "cpu" else len(devices)
        share = None if len(devices) == 1 else max(1, self.threads // len(devices))
        self._workers = [Worker(name, share, cancel) for name in devices]

    def map(
        self,
        function: Task,
        tasks: Iterable[tuple[Any, tuple[Any, ...]]],
        tick: Tick = lambda reports: None,
        *,
        save: Callable[[Any, Any], object] = lambda key, result: None,
        per_core: bool = False,
    ) -> Generator[tuple[Any, Any]]:
        """Yield results as they come, each with the key of its task.

        A task is taken when it can be computed. While a result is saved and used, the next task is computed. Closing
        the iterator gives up those under way.

        Args:
            tick: called in this thread, several times a second, with the last reports of the tasks under way in this
                process; workers of Dask do not report.
            save: called with a key and its result before these are yielded.
            per_core: let each core of a CPU compute a task. By default one task has all cores.
        """
        workers = self._workers
        if per_core and self.made_by[attr.DEVICE] == "cpu":
            workers = [replace(workers[0], threads=1)] * self.threads
        stop = Cancel(workers[0].cancel)
        workers = [replace(worker, cancel=stop) for worker in workers]
        remaining, running = iter(tasks), dict[Future[Any], tuple[Any, int]]()
        ended, reports = list[tuple[Any, Future[Any]]](), dict[Any, Any]()
        with self._pool(len(workers)) as pool:
            try:
                while True:
                    for place in {*range(self._width(workers))} - {place for _, place in running.values()}:
                        if (task := next(remaining, None)) is not None:
                            key, arguments = task
                            report = partial(reports.__setitem__, key)
                            bound = self._bound(function, workers[place % len(workers)], report)
                            running[pool.submit(bound, *arguments)] = key, place
                    for key, future in ended:  # while others are computed
                        reports.pop(key, None)
                        result = future.result()
                        save(key, result)
                        yield key, result
                    if not running:
                        return
                    done = wait(running, timeout=POLL_SECONDS, return_when=FIRST_COMPLETED).done
                    tick(list(reports.values()))
                    ended = [(running.pop(future)[0], future) for future in done]
            finally:
                stop.cancel()
                for future in running:
                    future.cancel()

    def call(self, function: Task, *arguments: Any, tick: Tick = lambda reports: None) -> Any:
        """The result of one task."""
        return next(self.map(function, [(None, arguments)], tick))[1]

    def _width(self, workers: list[Worker]) -> int:
        return len(workers)  # most tasks at a time

    def _pool(self, threads: int) -> AbstractContextManager[Executor]:
        return thread_pool(threads)

    def _bound(self, function: Task, worker: Worker, report: Report) -> Task:
        return partial(function, worker=worker, report=report)


class _Cluster(Computer):
    """The workers of a Dask scheduler, all of which compute the same bits, with so many `threads` for a task."""

    def __init__(self, client: Any, address: str, device: str, threads: int | None, warn: Warn) -> None:
        self._client, self._address, self._warn = client, address, warn
        self._workers, self.threads = [Worker(device, threads)], cores()
        self._seen, self.made_by = time.monotonic(), {}
        self.made_by = self.call(lambda *, worker, report: made_by(worker.device))

    def _width(self, workers: list[Worker]) -> int:
        """Twice the number of the workers' threads, so that none waits for its next task."""
        try:
            threads: int = sum(self._client.nthreads().values())
        except OSError as error:
            raise CancelledError from error
        if threads:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > NO_WORKER_SECONDS:
            self._seen = math.inf
            self._warn(f"scheduler: {self._address} has no worker yet; waiting for one")
        return 2 * max(1, threads)

    def _pool(self, threads: int) -> AbstractContextManager[Executor]:
        return nullcontext(self._client.get_executor(pure=False))

    def _bound(self, function: Task, worker: Worker, report: Report) -> Task:
        return partial(_on_worker, function, worker.device, worker.threads, self.made_by)


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: with the campaign, they determine the bits of a result."""
    chosen = find_device(device)
    return {**attr.versions(), attr.DEVICE: "cpu" if chosen.is_cpu else chosen.name}


def _on_worker(function: Task, device: str, threads: int | None, kind: dict[str, str], *arguments: Any) -> Any:
    """Compute a task on a worker, of the `kind` of the other workers; this is empty if none is known."""
    own = made_by(device) if kind else {}
    if own != kind:
        name = next(name for name in kind if own[name] != kind[name])
        raise DeviceError(
            f'the workers differ: {name} is "{kind[name]}" on one and "{own[name]}" on another; a run needs one kind'
        )
    return function(*arguments, worker=Worker(device, threads), report=lambda value: None)


@contextmanager
def dask_computer(device: str, workers: int | None, scheduler: str | None, warn: Warn) -> Iterator[Computer]:
    """The workers of Dask; arguments and errors as in `RunOptions`."""
    try:
        from distributed import Client, KilledWorker, LocalCluster
        from distributed.client import ClosedClientError
        from distributed.comm import CommClosedError
        from distributed.utils import silence_logging_cmgr
    except ImportError:
        raise ClusterError("--workers and --scheduler need Dask: pip install 'warpimpact[cluster]'") from None
    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # a lost scheduler is reported by our own sentence
        address, threads = scheduler, None
        if address is None:
            # Ctrl-C reaches all processes; this one ends the others.
            ignore_interrupts = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
            options = {"dashboard_address": None, "memory_limit": 0, "preload": [ignore_interrupts]}
            local = LocalCluster(n_workers=workers, threads_per_worker=1, silence_logs=logging.CRITICAL, **options)
            address = str(stack.enter_context(local).scheduler_address)
            threads = max(1, cores() // (workers or 1))
        try:
            # Not the default client of the process: xarray would take its locks for the files written here.
            client = Client(address, timeout="20s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(f'scheduler: got "{address}", which cannot be reached ({error})') from None
        try:
            yield _Cluster(client, address, device, threads, warn)
        except (CommClosedError, CancelledError, ClosedClientError, KilledWorker) as error:
            saved = "what is computed is saved, continue with --resume"
            lost = "ended one worker after another" if isinstance(error, KilledWorker) else "was lost, perhaps killed"
            raise ClusterError(f"scheduler: {address} {lost}; {saved}") from None
        finally:
            with suppress(OSError):  # a client that does not end in time must not hide how the computation ended
                client.close()
