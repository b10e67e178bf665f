"""The workers of a Dask cluster as a team that computes the shards of a campaign."""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Any, NamedTuple, TypeVar

from warpimpact.campaign.campaign import Campaign
from warpimpact.results.table import Table
from warpimpact.runs.describe import made_by
from warpimpact.runs.task import Computation, Task
from warpimpact.runs.team import HIT_MAP, ClusterError, Team, awaited, task_size
from warpimpact.solver.device import DeviceError, cores
from warpimpact.solver.findings import Found
from warpimpact.solver.worker import Worker

LONELY = 120.0
"""Seconds for which a scheduler may be without workers."""
LISTEN_EVERY = 0.2
"""Seconds between two looks for a signal while a worker prepares."""


Entered = TypeVar("Entered")


class _How(NamedTuple):
    """How the workers of a cluster compute.

    Attributes:
        device, threads: as in `simulate`.
        kind: what all of them must be, as `made_by` says.
    """

    device: str
    threads: int | None
    kind: dict[str, str]


@contextmanager
def cluster_team(
    campaign: Campaign,
    *,
    address: str | None = None,
    workers: int | None = None,
    device: str = "auto",
    computation: Computation = HIT_MAP,
) -> Iterator[Team]:
    """The workers of a Dask cluster; what one that dies was computing goes to another.

    Args:
        address: of a scheduler.
        workers: processes to start on this machine, where there is no address.
        device: that every worker computes on.
        computation: of every hit.

    Raises:
        ClusterError: dask is not installed, the scheduler cannot be reached, is lost or has no worker for LONELY
            seconds, or shots kill one worker after another.
        DeviceError: the workers lack the device, or compute other bits than the first one asked.
    """
    with connected(address, workers) as (reached, executor, threads):
        asked = reached.asked
        kind = awaited(asked(executor.submit, made_by, device), LISTEN_EVERY, reached.threads)
        campaign = awaited(asked(executor.submit, _looked_at, campaign), LISTEN_EVERY, reached.threads)
        how = _How(device, threads, kind)
        yield Team(
            computation=computation,
            pilot=lambda: asked(executor.submit, _pilot, computation, campaign, how),
            trying=lambda: None,
            submit=lambda task: asked(executor.submit, _compute_alike, computation, campaign, task, how),
            width=lambda: 2 * max(1, reached.threads()),
            task=lambda rate: task_size(kind),
            made_by=kind | dict(computation.content),
            underway=lambda: 0,
        )


@contextmanager
def connected(address: str | None, workers: int | None) -> Iterator[tuple[Reached, Any, int | None]]:
    """A scheduler, an executor that submits to its workers, and the threads of each of these; None where they were
    started elsewhere.

    Args:
        address, workers: as in `cluster_team`.

    Raises:
        ClusterError: as in `cluster_team`.
    """
    with _starting():
        from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin
        from distributed.comm import CommClosedError
        from distributed.utils import silence_logging_cmgr
    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # a lost scheduler gets our sentence, no traceback
        threads = None
        if address is None:
            assert workers is not None
            threads = max(1, cores() // workers)
            with _starting():
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
                address = stack.enter_context(_ended(cluster)).scheduler_address
        with _starting():
            try:
                # Not the default of its process, of which xarray takes the locks of the files that are written here.
                client = stack.enter_context(_ended(Client(address, timeout="20s", set_as_default=False)))
            except (OSError, ValueError) as error:
                raise ClusterError(f'scheduler: got "{address}", which cannot be reached ({error})') from None
        if threads is not None:
            with _starting():
                client.register_plugin(_ignoring_interrupts(WorkerPlugin))
        executor = client.get_executor(pure=False)
        reached = Reached(client, address)
        try:
            yield reached, executor, threads
        except (CommClosedError, CancelledError) as error:  # without its scheduler a client cancels what it waits for
            raise _lost(address, error) from None
        except KilledWorker as error:
            raise ClusterError(f"some shots ended one worker after another, perhaps out of memory: {error}") from None


@contextmanager
def _ended(part: AbstractContextManager[Entered]) -> Iterator[Entered]:
    """A part of Dask that does not end in time, on a busy machine, must not hide how the computation ended. Its
    processes end with this one."""
    entered = part.__enter__()
    try:
        yield entered
    finally:
        with suppress(OSError):  # TimeoutError among them
            part.__exit__(None, None, None)


@contextmanager
def _starting() -> Iterator[None]:
    """Name the settings of Dask where it does not start.

    Raises:
        ClusterError: it is not installed, or does not start.
    """
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


class Reached:
    """A scheduler that may be lost, or all of its workers.

    Raises:
        ClusterError: the scheduler is lost, or has had no worker for LONELY seconds.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address, self._seen = client, address, time.monotonic()

    def asked(self, request: Callable[..., Any], *arguments: Any) -> Any:
        """What a request to the scheduler returns."""
        from distributed.client import ClosedClientError

        try:
            return request(*arguments)
        except (OSError, ClosedClientError) as error:  # of the client: here no file is written
            raise _lost(self._address, error) from None

    def threads(self) -> int:
        """Of all workers."""
        count: int = sum(self.asked(self._client.nthreads).values())
        now = time.monotonic()
        if count:
            self._seen = now
        elif now - self._seen > LONELY:
            raise ClusterError(
                f"scheduler: {self._address} has had no worker for {LONELY:g} s; start some; what is computed is "
                "saved, continue with --resume"
            )
        return count


def _lost(address: str, error: BaseException) -> ClusterError:
    return ClusterError(
        f"scheduler: {address} was lost, perhaps killed ({type(error).__name__}); what is computed is saved, "
        "continue with --resume"
    )


def _ignoring_interrupts(plugin: Any) -> Any:
    """Plugin of workers on this machine, which Ctrl-C reaches, too: this process is the one that ends them."""

    def setup(self: Any, worker: Any) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    return type("Ignoring", (plugin,), {"setup": setup})()


def _pilot(computation: Computation, campaign: Campaign, how: _How) -> Found | None:
    """What the pilot finds, on a worker."""
    return computation.pilot(campaign, Worker(how.device), lambda level: None)


def _compute_alike(computation: Computation, campaign: Campaign, task: Task, how: _How) -> Table:
    """Compute a task on a worker that gives the same bits as the others."""
    check_alike(how.device, how.kind)
    return computation.compute(campaign, task, Worker(how.device, how.threads))


def check_alike(device: str, kind: dict[str, str]) -> None:
    """Check on a worker that it gives the same bits as the others.

    Raises:
        DeviceError: it is of another kind than `made_by` says.
    """
    own = made_by(device)
    if own != kind:
        name = next(name for name in kind if own[name] != kind[name])
        raise DeviceError(
            f'the workers differ: {name} is "{kind[name]}" on one and "{own[name]}" on another; a run needs one kind'
        )


def _looked_at(campaign: Campaign) -> Campaign:
    """The campaign, which carries the ligament of its plate from then on: that of a free form takes seconds, and every
    shard tells it."""
    _ = campaign.plate.ligament
    return campaign
