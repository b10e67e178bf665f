"""Executors of jobs: the devices of this machine, processes of it, or the workers of a Dask cluster.

A job is a function with its arguments, all of which can be pickled. The function also takes `worker`, which says where
to compute, and `report`, which it calls with its progress. The result depends only on the arguments and the kind of
device, so every executor returns the same bits. If a worker of a cluster dies, another one computes its jobs.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from multiprocessing import resource_tracker
from queue import SimpleQueue
from typing import Any, NamedTuple, Protocol, TypeVar

from warpimpact.results import attributes as attr
from warpimpact.runs.computer import ClusterError, made_by
from warpimpact.solver.device import DeviceError, cores, find_device
from warpimpact.solver.worker import Cancel, Worker

LOOK_EVERY = 0.2
"""Seconds between two checks of the reports of jobs, of signals and of the workers."""
PATIENCE = 1.0
"""Seconds to wait for jobs whose results are not needed. A thread can only end between two launches of a kernel."""

Key = TypeVar("Key")


class Job(NamedTuple):
    """A function and its arguments, all of which can be pickled."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


class Executor(Protocol):
    """Computes jobs.

    Attributes:
        made_by: versions and kind of device, which determine the bits of a result.
        is_remote: whether other processes compute the jobs. If such a process dies, its unfinished jobs are lost.
    """

    made_by: dict[str, str]
    is_remote: bool

    def submit(self, job: Job) -> Future[Any]:
        """Compute a job in the background."""

    def width(self) -> int:
        """Number of jobs to keep submitted: those computed at a time, and as many that wait.

        Raises:
            ClusterError: the cluster is lost.
        """

    def reports(self) -> list[Any]:
        """The last report of every running job, where it is known."""


def completed(
    executor: Executor, jobs: Iterator[tuple[Key, Job]], tick: Callable[[], object]
) -> Generator[tuple[Key, Any]]:
    """Results of jobs as they come, each with the key of its job.

    A job is taken from `jobs` when it is submitted. Closing the iterator gives up the submitted jobs.

    Args:
        tick: called several times a second.

    Raises:
        KeyboardInterrupt: a signal came.
        Exception: the error of the first job that fails.
    """
    waiting: dict[Future[Any], tuple[Key, Job]] = {}
    try:
        while True:
            width = executor.width()
            while len(waiting) < width and (keyed := next(jobs, None)) is not None:
                waiting[executor.submit(keyed[1])] = keyed
            if not waiting:
                return
            finished, _ = wait(waiting, timeout=LOOK_EVERY, return_when=FIRST_COMPLETED)
            for future in finished:
                key, job = waiting.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):  # a process was killed
                    waiting[executor.submit(job)] = key, job
                else:
                    yield key, future.result()
            tick()
    finally:
        for future in waiting:
            future.cancel()


def result_of(
    executor: Executor, function: Callable[..., Any], *arguments: Any, tick: Callable[[], object] = lambda: None
) -> Any:
    """The result of a single job; `tick` is called several times a second."""
    with closing(completed(executor, iter([(None, Job(function, arguments))]), tick)) as results:
        return next(results)[1]


class Threads:
    """The devices of this machine, each of which computes a job at a time; arguments as in `choice.executor_for`."""

    is_remote = False

    def __init__(self, device: str, *, apart: bool = False, cancel: Cancel | None = None) -> None:
        devices = _devices(device)
        self.made_by, self._stop = made_by(str(devices[0])), Cancel(cancel)
        workers = [Worker(str(chosen), cancel=self._stop) for chosen in devices]
        if apart and devices[0].is_cpu:
            workers = [Worker("cpu", 1, self._stop)] * cores()
        self._count, self._idle = len(workers), SimpleQueue[Worker]()
        for worker in workers:
            self._idle.put(worker)
        self._pool, self._begun = ThreadPoolExecutor(self._count), list[Future[Any]]()
        self._reports: dict[int, Any] = {}

    def submit(self, job: Job) -> Future[Any]:
        """Compute a job in a thread."""
        future = self._pool.submit(self._compute, job)
        self._begun = [*(begun for begun in self._begun if not begun.done()), future]
        return future

    def _compute(self, job: Job) -> Any:
        worker, thread = self._idle.get(), threading.get_ident()

        def report(value: Any) -> None:
            self._reports[thread] = value

        try:
            return job.function(*job.arguments, worker=worker, report=report)
        finally:
            self._reports.pop(thread, None)
            self._idle.put(worker)

    def width(self) -> int:
        """Twice the number of devices, or of cores."""
        return 2 * self._count

    def reports(self) -> list[Any]:
        """The last report of every running job."""
        return list(self._reports.copy().values())

    def close(self) -> None:
        """Give up the submitted jobs."""
        self._stop.cancel()
        self._pool.shutdown(wait=False, cancel_futures=True)
        wait([future for future in self._begun if not future.cancelled()], timeout=PATIENCE)


class Processes:
    """Processes of this machine, which share its cores; arguments as in `executor_for`.

    The threads of this process compute alone for `after` seconds, as a start takes some two seconds and 0.4 GB; and all
    that is left if a process is killed.
    """

    is_remote = True

    def __init__(self, count: int, device: str, threads: Threads, after: float = 0.0) -> None:
        self.made_by, self._threads, self._count, self._device = threads.made_by, threads, count, device
        self._after, self._first = after, 0.0
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, job: Job) -> Future[Any]:
        """Compute a job in a process, or in this one."""
        now = time.monotonic()
        self._first = self._first or now
        if now - self._first < self._after:
            return self._threads.submit(job)
        if self._pool is None:
            context, apiece = multiprocessing.get_context("spawn"), max(1, cores() // self._count)
            self._pool = ProcessPoolExecutor(self._count, context, _begin_process, (self._device, apiece))
        try:
            with _interrupts_held():
                return self._pool.submit(_in_process, job)
        except (BrokenProcessPool, OSError):  # memory may be short
            return self._threads.submit(job)

    def width(self) -> int:
        """Twice the number of processes, or of this process's devices and cores."""
        return max(2 * self._count, self._threads.width())

    def reports(self) -> list[Any]:
        """Reports of the jobs of this process."""
        return self._threads.reports()

    def close(self) -> None:
        """End the processes. Each first ends its job."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


_process_worker: list[Worker] = []
"""The worker of a process of `Processes`."""


def _begin_process(device: str, threads: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the first one ends the others
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _process_worker[:] = [Worker(device, threads)]


def _end_with_parent() -> None:
    """End this process when its parent is gone, because it would wait for jobs for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _in_process(job: Job) -> Any:
    """Compute a job in a process of `Processes`."""
    return job.function(*job.arguments, worker=_process_worker[0], report=lambda value: None)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, also while they load: they inherit a mask. A signal that comes meanwhile is
    raised afterwards, because a process that is only half started would print a traceback."""
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    resource_tracker.ensure_running()  # if it started with the first process, it would remove the mask
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if came:
            signal.raise_signal(signal.SIGINT)


def _devices(names: str) -> list[Any]:
    """The devices for names separated by commas."""
    first = find_device(names.split(",")[0].strip())
    if names == "auto":
        import warp

        return [first] if first.is_cpu else list(warp.get_cuda_devices())
    devices = [first, *(find_device(name.strip()) for name in names.split(",")[1:])]
    if len({kind for chosen in devices if (kind := made_by(str(chosen))[attr.DEVICE])}) > 1:
        raise DeviceError(f'device: got "{names}", but these are of different kinds, which compute different bits')
    return devices


@contextmanager
def executor_for(
    device: str = "auto",
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    apart: bool = False,
    after: float = 0.0,
    cancel: Cancel | None = None,
) -> Iterator[Executor]:
    """The executor that the options of a command ask for. By default the devices of this machine compute.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names separated by commas.
        workers: number of processes on this machine. They need a main module that does nothing when it is imported.
        scheduler: address of a Dask scheduler whose workers compute.
        apart: whether jobs spend much of their time in Python. On a CPU, each core then computes a job of its own.
        after: seconds that this process computes before other processes are started.
        cancel: cancels what this process computes; the futures then raise Cancelled.

    Raises:
        DeviceError: a device is absent, or devices are of different kinds, which compute different bits.
        ClusterError: Dask is not installed, or the scheduler cannot be reached, is lost or has no workers.
    """
    if scheduler is not None:
        with cluster(scheduler, device) as executor:
            yield executor
        return
    with closing(Threads(device, apart=apart, cancel=cancel)) as threads:
        if workers is None:
            yield threads
            return
        with closing(Processes(workers, device, threads, after)) as processes:
            yield processes


def opened(device: str | Executor) -> AbstractContextManager[Executor]:
    """An executor for device names, closed afterwards. A given executor stays open."""
    return executor_for(device) if isinstance(device, str) else nullcontext(device)


NO_WORKERS_LIMIT = 120.0
"""Seconds that a scheduler may be without workers."""

Entered = TypeVar("Entered")


@contextmanager
def cluster(address: str, device: str = "auto") -> Iterator[Cluster]:
    """The workers of a scheduler, each of which computes on a device of this name.

    Raises:
        ClusterError: Dask is not installed; the scheduler cannot be reached, is lost or has no worker for
            NO_WORKERS_LIMIT seconds; or jobs kill one worker after another.
        DeviceError: the workers lack the device, or compute other bits than the first worker asked.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
        from distributed.utils import silence_logging_cmgr
    except ImportError:
        raise ClusterError("a cluster needs Dask: pip install 'warpimpact[cluster]'") from None
    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # a lost scheduler is reported by our own sentence
        try:
            # Not the default client of the process: xarray would take its locks for the files written here.
            client = stack.enter_context(_ended(Client(address, timeout="20s", set_as_default=False)))
        except (OSError, ValueError) as error:
            raise ClusterError(f'scheduler: got "{address}", which cannot be reached ({error})') from None
        try:
            yield Cluster(client, address, device)
        except (CommClosedError, CancelledError) as error:  # without its scheduler a client cancels what it waits for
            raise _lost(address, error) from None
        except KilledWorker as error:
            raise ClusterError(f"some shots ended one worker after another, perhaps out of memory: {error}") from None


@contextmanager
def _ended(part: AbstractContextManager[Entered]) -> Iterator[Entered]:
    """Ignore that a client does not end in time on a busy machine, so that it does not hide how the computation
    ended."""
    entered = part.__enter__()
    try:
        yield entered
    finally:
        with suppress(OSError):  # TimeoutError among them
            part.__exit__(None, None, None)


class Cluster:
    """The workers of a scheduler, all of which compute the same bits. See `cluster`."""

    is_remote = True

    def __init__(self, client: Any, address: str, device: str) -> None:
        self._client, self._address, self._device = client, address, device
        self._executor, self._seen = client.get_executor(pure=False), time.monotonic()
        self.made_by: dict[str, str] = {}
        self.made_by = result_of(self, _made_by)

    def submit(self, job: Job) -> Future[Any]:
        """Compute a job on a worker."""
        future: Future[Any] = self._asked(self._executor.submit, _on_worker, job, self._device, self.made_by)
        return future

    def width(self) -> int:
        """Twice the number of the workers' threads; 2 while there are no workers."""
        threads: int = sum(self._asked(self._client.nthreads).values())
        now = time.monotonic()
        if threads:
            self._seen = now
        elif now - self._seen > NO_WORKERS_LIMIT:
            raise ClusterError(
                f"scheduler: {self._address} has had no worker for {NO_WORKERS_LIMIT:g} s; start some; what is "
                "computed is saved, continue with --resume"
            )
        return 2 * max(1, threads)

    def reports(self) -> list[Any]:
        """Workers do not report."""
        return []

    def _asked(self, request: Callable[..., Any], *arguments: Any) -> Any:
        """The answer to a request to the scheduler."""
        from distributed.client import ClosedClientError

        try:
            return request(*arguments)
        except (OSError, ClosedClientError) as error:  # of the client: here no file is written
            raise _lost(self._address, error) from None


def _lost(address: str, error: BaseException) -> ClusterError:
    return ClusterError(
        f"scheduler: {address} was lost, perhaps killed ({type(error).__name__}); what is computed is saved, "
        "continue with --resume"
    )


def _made_by(*, worker: Worker, report: Callable[[Any], object]) -> dict[str, str]:
    return made_by(worker.device)


def _on_worker(job: Job, device: str, kind: dict[str, str]) -> Any:
    """Compute a job on a worker, of the `kind` of the other workers; this is empty if none was asked before.

    Raises:
        DeviceError: the worker computes other bits.
    """
    ours = made_by(device) if kind else {}
    if ours != kind:
        name = next(name for name in kind if ours[name] != kind[name])
        raise DeviceError(
            f'the workers differ: {name} is "{kind[name]}" on one and "{ours[name]}" on another; a run needs one kind'
        )
    return job.function(*job.arguments, worker=Worker(device), report=lambda value: None)
