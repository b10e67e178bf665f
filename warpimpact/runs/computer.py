"""Where tasks are computed: in this process, or by the workers of Dask.

A task is a function with its arguments, all of which can be pickled. The function also takes `worker`, which says where
to compute, and `report`, which it calls with its progress. A result depends only on the arguments and the kind of
device, so its bits are the same everywhere. If a worker of Dask dies, another one computes its tasks.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeVar

import warp

from warpimpact.results import attributes as attr
from warpimpact.solver.device import DeviceError, cores, find_device
from warpimpact.solver.worker import NEVER, Cancel, Worker

LOOK_EVERY = 0.2
"""Seconds between two looks at progress, signals and the number of workers."""
WORKERLESS, WORKERLESS_LIMIT = 5.0, 120.0
"""Seconds without a worker after which a scheduler is reported, and given up."""

Key = TypeVar("Key")
Task = Callable[..., Any]
Tick = Callable[[list[Any]], object]
Warn = Callable[[str], object]


class ClusterError(RuntimeError):
    """A cluster cannot be used; the message is for the user."""


class _Pool(NamedTuple):
    """Where tasks wait: how to submit one, how many may be there, and the last report of each running one."""

    submit: Callable[..., Future[Any]]
    width: Callable[[], int]
    reports: Callable[[], list[Any]]


class Computer:
    """Computes tasks on the devices of this machine; `computer` opens one.

    Attributes:
        made_by: versions and kind of device, which determine the bits of a result.
        is_remote: whether other processes compute.
    """

    is_remote = False

    def __init__(self, made_by: dict[str, str], workers: list[Worker]) -> None:
        self.made_by, self._workers = made_by, workers

    def map(
        self,
        function: Task,
        tasks: Iterable[tuple[Key, tuple[Any, ...]]],
        tick: Tick = lambda reports: None,
        *,
        per_core: bool = False,
    ) -> Generator[tuple[Key, Any]]:
        """Yield results as they come, each with the key of its task.

        A task is taken when it can be computed. Closing the iterator gives up those under way.

        Args:
            function: called with the arguments of a task, `worker` and `report`.
            tick: called in this thread, several times a second, with the last report of every running task.
            per_core: let each core of a CPU compute a task. By default one task has all cores.
        """
        workers = self._workers
        if per_core and self.made_by.get(attr.DEVICE) == "cpu":
            workers = [Worker("cpu", 1, workers[0].cancel if workers else NEVER)] * cores()
        if len(workers) == 1 and not self.is_remote:
            for key, arguments in tasks:
                yield key, function(*arguments, worker=workers[0], report=lambda value: tick([value]))
            return
        remaining, running = iter(tasks), dict[Future[Any], Key]()
        with self._pool(function, workers, per_core) as (submit, width, reports):
            try:
                while True:
                    most = width()
                    while len(running) < most and (task := next(remaining, None)) is not None:
                        running[submit(*task[1])] = task[0]
                    if not running:
                        return
                    for future in wait(running, timeout=LOOK_EVERY, return_when=FIRST_COMPLETED).done:
                        yield running.pop(future), future.result()
                    tick(reports())
            finally:
                for future in running:
                    future.cancel()

    def call(self, function: Task, *arguments: Any, tick: Tick = lambda reports: None) -> Any:
        """The result of one task."""
        return next(self.map(function, [(None, arguments)], tick))[1]

    @contextmanager
    def _pool(self, function: Task, workers: list[Worker], per_core: bool) -> Iterator[_Pool]:
        """A thread for each worker."""
        stop, idle, reports = Cancel(workers[0].cancel), SimpleQueue[Worker](), dict[object, Any]()
        for worker in workers:
            idle.put(Worker(worker.device, worker.threads, stop))

        def compute(*arguments: Any) -> Any:
            worker, task = idle.get(), object()
            try:
                return function(*arguments, worker=worker, report=partial(reports.__setitem__, task))
            finally:
                reports.pop(task, None)
                idle.put(worker)

        pool = ThreadPoolExecutor(len(workers))
        try:
            yield _Pool(partial(pool.submit, compute), lambda: len(workers), lambda: [*reports.copy().values()])
        finally:
            stop.cancel()
            pool.shutdown(wait=False, cancel_futures=True)


class _Cluster(Computer):
    """The workers of a Dask scheduler, all of which compute the same bits.

    Args:
        threads: CPU threads of a task; None is all cores of a worker.
    """

    is_remote = True

    def __init__(self, client: Any, address: str, device: str, threads: int | None, warn: Warn) -> None:
        self._client, self._address, self._device, self._threads, self._warn = client, address, device, threads, warn
        self._seen, self._warned = time.monotonic(), False
        super().__init__({}, [])
        self.made_by = self.call(lambda *, worker, report: made_by(worker.device))

    @contextmanager
    def _pool(self, function: Task, workers: list[Worker], per_core: bool) -> Iterator[_Pool]:
        """The workers, which do not report."""
        threads = 1 if per_core else self._threads
        submit = partial(self._client.get_executor(pure=False).submit, _on_worker, function)
        yield _Pool(partial(submit, self._device, threads, self.made_by), self._width, list)

    def _width(self) -> int:
        """Twice the number of the workers' threads, so that none waits for its next task."""
        try:
            threads: int = sum(self._client.nthreads().values())
        except OSError as error:
            raise _lost(self._address, error) from None
        without = time.monotonic() - self._seen
        if threads:
            self._seen = time.monotonic()
        elif without > WORKERLESS_LIMIT:
            raise ClusterError(
                f"scheduler: {self._address} has had no worker for {WORKERLESS_LIMIT:g} s; start some; what is "
                "computed is saved, continue with --resume"
            )
        elif without > WORKERLESS and not self._warned:
            self._warned = True
            self._warn(f"scheduler: {self._address} has no worker yet; waiting up to {WORKERLESS_LIMIT:g} s")
        return 2 * max(1, threads)


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
    """Open what computes. By default that are the devices of this machine.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names separated by commas. A computer is
            returned as it is, and stays open.
        workers: number of processes of this machine, which share its cores. They need a main module that does nothing
            when it is imported.
        scheduler: address of a Dask scheduler whose workers compute.
        cancel: ends with Cancelled what this process computes.
        warn: called with a sentence when a scheduler has no workers.

    Raises:
        DeviceError: a device is absent, or devices are of different kinds, which compute different bits.
        ClusterError: Dask is not installed, or the scheduler cannot be reached, is lost or has no workers.
    """
    if isinstance(device, Computer):
        yield device
    elif workers is None and scheduler is None:
        devices = _devices(device)
        yield Computer(made_by(devices[0]), [Worker(name, cancel=cancel) for name in devices])
    else:
        with _dask(device, workers, scheduler, warn) as cluster:
            yield cluster


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
        except (CommClosedError, CancelledError, ClosedClientError) as error:
            raise _lost(address, error) from None
        except KilledWorker as error:
            raise ClusterError(f"some tasks ended one worker after another, perhaps out of memory: {error}") from None
        finally:
            with suppress(OSError):  # a client that does not end in time must not hide how the computation ended
                client.close()


def _lost(address: str, error: BaseException) -> ClusterError:
    cause = type(error).__name__
    return ClusterError(
        f"scheduler: {address} was lost, perhaps killed ({cause}); what is computed is saved, continue with --resume"
    )


def _devices(names: str) -> list[str]:
    """The devices for names separated by commas."""
    first = find_device(names.split(",")[0].strip())
    if names == "auto":
        return [str(first)] if first.is_cpu else [str(device) for device in warp.get_cuda_devices()]
    devices = [str(first), *(str(find_device(name.strip())) for name in names.split(",")[1:])]
    if len({made_by(name)[attr.DEVICE] for name in devices}) > 1:
        raise DeviceError(f'device: got "{names}", but these are of different kinds, which compute different bits')
    return devices
