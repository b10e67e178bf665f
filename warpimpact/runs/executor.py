"""Executors of jobs: the devices of this machine, processes of it, or the workers of a Dask cluster (`cluster.py`).

A job is a function with its arguments, all of which can be pickled. The function also takes `worker`, which says where
to compute, and `report`, which it calls with its progress. The result depends only on the arguments and the kind of
device, so every executor returns the same bits.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager, suppress
from multiprocessing import resource_tracker
from queue import SimpleQueue
from typing import Any, NamedTuple, Protocol, TypeVar

from warpimpact.results import attributes as attr
from warpimpact.runs.describe import made_by
from warpimpact.solver.device import DeviceError, cores, find_device
from warpimpact.solver.worker import Cancel, Worker

LOOK_EVERY = 0.2
"""Seconds between two checks of the reports of jobs, of signals and of the workers."""
PATIENCE = 1.0
"""Seconds to wait for jobs whose results are not needed. A thread can only end between two launches of a kernel."""

Key = TypeVar("Key")


class ClusterError(RuntimeError):
    """A cluster cannot be used; the message is for the user."""


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
    waiting: dict[Future[Any], Key] = {}
    try:
        while True:
            width = executor.width()
            while len(waiting) < width and (keyed := next(jobs, None)) is not None:
                waiting[executor.submit(keyed[1])] = keyed[0]
            if not waiting:
                return
            finished, _ = wait(waiting, timeout=LOOK_EVERY, return_when=FIRST_COMPLETED)
            for future in finished:
                yield waiting.pop(future), future.result()
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
    """Processes of this machine, which share its cores; arguments as in `choice.executor_for`.

    If a process was killed or failed, the threads of this process compute its job or raise the error. The threads
    compute alone for `after` seconds: a start takes some two seconds and 0.4 GB.
    """

    is_remote = True

    def __init__(self, count: int, device: str, threads: Threads, after: float = 0.0) -> None:
        self.made_by, self._threads, self._count, self._device = threads.made_by, threads, count, device
        self._after, self._first = after, 0.0
        self._pool: ProcessPoolExecutor | None = None
        self._broken = False

    def submit(self, job: Job) -> Future[Any]:
        """Compute a job in a process, or in this one."""
        now = time.monotonic()
        self._first = self._first or now
        if self._broken or now - self._first < self._after:
            return self._threads.submit(job)
        try:
            with _interrupts_held():
                in_process = self._begun_pool().submit(_in_process, pickle.dumps(job))
        except (OSError, RuntimeError):  # a process was killed, or none can be started: memory may be short
            self._broken = True
            return self._threads.submit(job)
        future = Future[Any]()

        def passed_on(ended: Future[Any]) -> None:
            try:
                self._pass_on(job, ended, future)
            except Exception as error:  # a callback only logs it, and whoever waits for the job waits for ever
                future.set_exception(error)

        in_process.add_done_callback(passed_on)
        return future

    def _begun_pool(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context, apiece = multiprocessing.get_context("spawn"), max(1, cores() // self._count)
            self._pool = ProcessPoolExecutor(self._count, context, _begin_process, (self._device, apiece))
        return self._pool

    def _pass_on(self, job: Job, ended: Future[Any], future: Future[Any]) -> None:
        """Pass the result of a process to the future of a job. Without a result the threads compute the job."""
        if ended.cancelled() or not future.set_running_or_notify_cancel():
            return
        if ended.exception() is None and ended.result() is not _FAILED:
            future.set_result(ended.result()[0])
            return
        self._broken = self._broken or ended.exception() is not None

        def again(here: Future[Any]) -> None:
            if here.cancelled() or (error := here.exception()) is not None:
                future.set_exception(InterruptedError() if here.cancelled() else error)
            else:
                future.set_result(here.result())

        try:
            self._threads.submit(job).add_done_callback(again)
        except RuntimeError as error:  # the threads are closed
            future.set_exception(error)

    def width(self) -> int:
        """Twice the number of processes, or of this process's devices and cores."""
        return max(2 * self._count, self._threads.width())

    def reports(self) -> list[Any]:
        """Reports of the jobs of this process."""
        return self._threads.reports()

    def close(self) -> None:
        """End the processes. Each first ends its job."""
        self._broken = True
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


_FAILED = None
"""Returned by a process for a job that it could not compute. A result is in a tuple."""
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


def _in_process(pickled: bytes) -> tuple[Any] | None:
    """Compute a job in a process of `Processes`."""
    with suppress(Exception):
        job: Job = pickle.loads(pickled)
        return (job.function(*job.arguments, worker=_process_worker[0], report=lambda value: None),)
    return _FAILED


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
