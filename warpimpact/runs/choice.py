"""The executor that the options of a command, or of a call in Python, ask for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext

from warpimpact.runs.executor import Executor, Processes, Threads
from warpimpact.solver.worker import Cancel


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
        from warpimpact.runs.cluster import cluster

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
