"""Where tasks are computed: in this process, or by the workers of Dask.

A task is a function with its arguments, all of which can be pickled. The function also takes `worker`, which says where
to compute, and `report`, which it calls with its progress. A result depends only on the arguments and the kind of
device, so its bits are the same everywhere. If a worker of Dask dies, another one computes its tasks.
"""

from __future__ import annotations

import logging
import math
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Any

import warp

from warpimpact.errors import ClusterError, DeviceError
from warpimpact.records import attributes as attr
from warpimpact.solver.device import NEVER, Cancel, Worker, cores, find_device

POLL_SECONDS = 0.2
"""Seconds between two looks at progress, signals and the number of workers."""
NO_WORKER_SECONDS = 5.0
"""Seconds without a worker after which a scheduler is reported."""

Task = Callable[..., Any]
Tick = Callable[[list[Any]], object]
Warn = Callable[[str], object]


class Computer:
    """Computes tasks on the devices of this machine; `computer` opens one.

    Attributes:
        made_by: versions and kind of device, which determine the bits of a result.
    """

    def __init__(self, devices: list[str], cancel: Cancel) -> None:
        self.made_by, self._workers = made_by(devices[0]), [Worker(name, cancel=cancel) for name in devices]
        self._executor: Executor = ThreadPoolExecutor(max(cores(), len(devices)))

    def map(
        self,
        function: Task,
        tasks: Iterable[tuple[Any, tuple[Any, ...]]],
        tick: Tick = lambda reports: None,
        *,
        per_core: bool = False,
    ) -> Generator[tuple[Any, Any]]:
        """Yield results as they come, each with the key of its task.

        A task is taken when it can be computed. Closing the iterator gives up those under way.

        Args:
            tick: called in this thread, several times a second, with the last report of a worker that computes alone in
                this process; others do not report.
            per_core: let each core of a CPU compute a task. By default one task has all cores.
        """
        workers = self._workers
        if per_core and self.made_by[attr.DEVICE] == "cpu":
            workers = [replace(workers[0], threads=1)] * cores()
        if self._width(workers) == 1:
            for key, arguments in tasks:
                yield key, function(*arguments, worker=workers[0], report=lambda value: tick([value]))
            return
        stop = Cancel(workers[0].cancel)
        workers = [replace(worker, cancel=stop) for worker in workers]
        remaining, running = iter(tasks), dict[Future[Any], tuple[Any, int]]()
        try:
            while True:
                for place in {*range(self._width(workers))} - {place for _, place in running.values()}:
                    if (task := next(remaining, None)) is not None:
                        future = self._submit(function, workers[place % len(workers)], task[1])
                        running[future] = task[0], place
                if not running:
                    return
                for future in wait(running, timeout=POLL_SECONDS, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future)[0], future.result()
                tick([])
        finally:
            stop.cancel()
            for future in running:
                future.cancel()

    def call(self, function: Task, *arguments: Any, tick: Tick = lambda reports: None) -> Any:
        """The result of one task."""
        return next(self.map(function, [(None, arguments)], tick))[1]

    def _width(self, workers: list[Worker]) -> int:
        return len(workers)  # most tasks at a time

    def _submit(self, function: Task, worker: Worker, arguments: Any) -> Future[Any]:
        return self._executor.submit(function, *arguments, worker=worker, report=lambda value: None)


class _Cluster(Computer):
    """The workers of a Dask scheduler, all of which compute the same bits, with so many `threads` for a task."""

    def __init__(self, client: Any, address: str, device: str, threads: int | None, warn: Warn) -> None:
        self._client, self._address, self._warn = client, address, warn
        self._workers, self._executor = [Worker(device, threads)], client.get_executor(pure=False)
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

    def _submit(self, function: Task, worker: Worker, arguments: tuple[Any, ...]) -> Future[Any]:
        return self._executor.submit(_on_worker, function, worker.device, worker.threads, self.made_by, *arguments)


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
def computer(
    device: str | Computer = "auto",
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    cancel: Cancel = NEVER,
    warn: Warn = warnings.warn,
) -> Iterator[Computer]:
    """Open what computes: the devices of this machine, or Dask.

    Args:
        device, cancel: as in `run`. A computer is returned as it is, and stays open.
        workers: number of processes of this machine, which share its cores. They need a main module that does nothing
            when it is imported.
        scheduler: address of a Dask scheduler whose workers compute.
        warn: called with a sentence when a scheduler has no workers.

    Raises:
        DeviceError: a device is absent, or devices are of different kinds, which compute different bits.
        ClusterError: Dask is not installed, or the scheduler cannot be reached or is lost.
    """
    if isinstance(device, Computer):
        yield device
    elif workers is not None or scheduler is not None:
        with _dask(device, workers, scheduler, warn) as cluster:
            yield cluster
    else:
        devices = [str(find_device(name.strip())) for name in device.split(",")]
        if device == "auto" and devices != ["cpu"]:
            devices = [str(one) for one in warp.get_cuda_devices()]
        elif len({made_by(name)[attr.DEVICE] for name in devices}) > 1:
            raise DeviceError(f'device: got "{device}", but these are of different kinds, which compute different bits')
        yield Computer(devices, cancel)


@contextmanager
def _dask(device: str, workers: int | None, scheduler: str | None, warn: Warn) -> Iterator[Computer]:
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
