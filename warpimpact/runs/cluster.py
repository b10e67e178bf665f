"""The workers of a Dask cluster as an executor. If a worker dies, another one computes its jobs."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Any, TypeVar

from warpimpact.runs.describe import made_by
from warpimpact.runs.executor import ClusterError, Job, result_of
from warpimpact.solver.device import DeviceError
from warpimpact.solver.worker import Worker

LONELY = 120.0
"""Seconds that a scheduler may be without workers."""

Entered = TypeVar("Entered")


@contextmanager
def cluster(address: str, device: str = "auto") -> Iterator[Cluster]:
    """The workers of a scheduler, each of which computes on a device of this name.

    Raises:
        ClusterError: Dask is not installed; the scheduler cannot be reached, is lost or has no worker for LONELY
            seconds; or jobs kill one worker after another.
        DeviceError: the workers lack the device, or compute other bits than the first worker asked.
    """
    with _starting():
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
        from distributed.utils import silence_logging_cmgr
    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # a lost scheduler is reported by our own sentence
        with _starting():
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


@contextmanager
def _starting() -> Iterator[None]:
    """Turn an error of a start of Dask into a ClusterError that names the settings."""
    try:
        yield
    except ClusterError:
        raise
    except ImportError:
        raise ClusterError("a cluster needs Dask: pip install 'warpimpact[cluster]'") from None
    except Exception as error:  # of any class, as settings have no check of their own
        given = ", ".join(sorted(name for name in os.environ if name.startswith("DASK_"))) or "none"
        what = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise ClusterError(
            f"Dask does not start ({what}); check its settings: variables {given}; files in ~/.config/dask"
        ) from error


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
        elif now - self._seen > LONELY:
            raise ClusterError(
                f"scheduler: {self._address} has had no worker for {LONELY:g} s; start some; what is computed is "
                "saved, continue with --resume"
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
