"""Who computes the shards of a campaign: the devices of this machine; a Dask cluster is in cluster.py."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, TypeVar

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.interrupts import stop_if_asked
from warpimpact.results.table import Table
from warpimpact.runs.compute import HitMap
from warpimpact.runs.describe import made_by
from warpimpact.runs.task import Computation, Task
from warpimpact.solver.device import DeviceError, find_device
from warpimpact.solver.findings import Found
from warpimpact.solver.worker import Cancel, Worker

CUDA_SHOTS = 2**17
"""Shots per task on a GPU, which fewer would not fill."""
CPU_SHOTS, CPU_SECONDS = 2**14, 0.5
"""Most shots of a task on the CPU of this machine, and the time that it is to take: its set-up, on one core, is lost in
that. It is one shard at least, and one shard on the worker of a cluster."""
HIT_MAP = HitMap()
_PATIENCE = 1.0
"""Seconds for which a team waits for computations that nobody wants any more: what a thread of this machine computes
can be broken off between two launches of a kernel only."""


class ClusterError(RuntimeError):
    """A cluster that cannot be used; the message is for a person."""


@dataclass(frozen=True)
class Team:
    """Computes shots in the background.

    Attributes:
        computation: of every hit.
        pilot: begins the pilot of the campaign.
        trying: the level that it computes; None where that is not known.
        submit: hands over a task; its Table comes in the future.
        width: tells how many tasks to keep under way: as many as compute, and as many that wait.
        task: shots per task, for a rate of shots per second; 0 where that is not known yet.
        made_by: versions, kind of device and the computation's content, which decide the bits.
        underway: how many shots of unfinished tasks are done.
    """

    computation: Computation
    pilot: Callable[[], Future[Found | None]]
    trying: Callable[[], int | None]
    submit: Callable[[Task], Future[Table]]
    width: Callable[[], int]
    task: Callable[[float], int]
    made_by: dict[str, str]
    underway: Callable[[], int]


Result = TypeVar("Result")


def awaited(future: Future[Result], every: float, tick: Callable[[], object]) -> Result:
    """The result of a future. Meanwhile `tick` is called every so many seconds, and a signal that came stops it all."""
    while not wait([future], timeout=every).done:
        stop_if_asked()
        tick()
    return future.result()


@contextmanager
def local_team(
    campaign: Campaign, device: str, computation: Computation = HIT_MAP, *, cancel: Cancel | None = None
) -> Iterator[Team]:
    """The devices of this machine, each computing one task at a time.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names with commas between them.
        computation: of every hit.
        cancel: ends what they compute, whose futures then raise Cancelled.

    Raises:
        DeviceError: a device is absent, or they are of different kinds, which compute different bits.
    """
    devices = _devices(device)
    idle, done, stop = SimpleQueue[Worker](), dict[int, int](), Cancel(cancel)
    tried, begun = list[int](), list[Future[Any]]()
    for chosen in devices:
        idle.put(Worker(str(chosen), cancel=stop))

    def progress(finished: int, total: int) -> None:
        done[threading.get_ident()] = finished

    def work(task: Task) -> Table:
        worker = idle.get()
        try:
            return computation.compute(campaign, task, worker, progress)
        finally:
            done[threading.get_ident()] = 0
            idle.put(worker)

    def begin(function: Callable[..., Result], *arguments: Any) -> Future[Result]:
        begun[:] = [future for future in begun if not future.done()]
        future = pool.submit(function, *arguments)
        begun.append(future)
        return future

    pool, kind = ThreadPoolExecutor(len(devices)), made_by(str(devices[0]))
    try:
        yield Team(
            computation=computation,
            pilot=lambda: begin(computation.pilot, campaign, Worker(str(devices[0]), cancel=stop), tried.append),
            trying=lambda: tried[-1] if tried else None,
            submit=lambda task: begin(work, task),
            width=lambda: 2 * len(devices),
            task=lambda rate: task_size(kind) or min(CPU_SHOTS, int(CPU_SECONDS * rate)),
            made_by=kind | dict(computation.content),
            underway=lambda: sum(done.copy().values()),
        )
    finally:
        stop.cancel()
        pool.shutdown(wait=False, cancel_futures=True)
        wait([future for future in begun if not future.cancelled()], timeout=_PATIENCE)


def task_size(kind: dict[str, str]) -> int:
    """Shots per task; 0 where the rate decides."""
    return 0 if kind[attr.DEVICE] == "cpu" else CUDA_SHOTS


def _devices(names: str) -> list[Any]:
    """The devices of some names with commas between them."""
    first = find_device(names.split(",")[0].strip())
    if names == "auto":
        import warp

        return [first] if first.is_cpu else list(warp.get_cuda_devices())
    devices = [first, *(find_device(name.strip()) for name in names.split(",")[1:])]
    if len({kind for chosen in devices if (kind := made_by(str(chosen))[attr.DEVICE])}) > 1:
        raise DeviceError(f'device: got "{names}", but these are of different kinds, which compute different bits')
    return devices
