"""Who computes the shards of a campaign: the devices of this machine; a Dask cluster is in cluster.py."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results.interrupts import stop_if_asked
from warpimpact.results.table import Table
from warpimpact.runs.compute import HitMap, made_by
from warpimpact.scene import Shots
from warpimpact.solver.device import DeviceError, find_device

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
        job: what is computed of every hit.
        pilot: finds the promise of the campaign in the background, None if it fixes the resolution itself.
        submit: hands over the promise, shots, and those of them that the solid reference takes, too; their Table
            comes in the future.
        width: tells how many tasks to keep under way: as many as compute, and as many that wait.
        task: shots per task, for a rate of shots per second; 0 where that is not known yet.
        made_by: versions, kind of device and the job's content, which decide the bits.
        underway: how many shots of unfinished tasks are done.
    """

    job: HitMap
    pilot: Callable[[], Future[Any]]
    submit: Callable[[Any, Shots, Shots | None], Future[Table]]
    width: Callable[[], int]
    task: Callable[[float], int]
    made_by: dict[str, str]
    underway: Callable[[], int]


def awaited(future: Future[Any], every: float, tick: Callable[[], object]) -> Any:
    """The result of a future. Meanwhile `tick` is called every so many seconds, and a signal that came stops it all."""
    while not wait([future], timeout=every).done:
        stop_if_asked()
        tick()
    return future.result()


@contextmanager
def local_team(campaign: Campaign, device: str, job: HitMap = HIT_MAP) -> Iterator[Team]:
    """The devices of this machine, each computing one task at a time.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names with commas between them.
        job: what to compute of every hit.

    Raises:
        DeviceError: a device is absent, or they are of different kinds, which compute different bits.
    """
    devices = _devices(device)
    idle, done, stopping = SimpleQueue[str](), dict[int, int](), threading.Event()
    begun = list[Future[Any]]()
    for chosen in devices:
        idle.put(str(chosen))

    def progress(finished: int, total: int) -> None:
        if stopping.is_set():
            raise InterruptedError
        done[threading.get_ident()] = finished

    def work(promise: Any, shots: Shots, solid: Shots | None) -> Table:
        name = idle.get()
        try:
            return job.compute(
                campaign,
                shots,
                promise=promise,
                solid=solid,
                device=name,
                progress=progress,
            )
        finally:
            done[threading.get_ident()] = 0
            idle.put(name)

    def begin(task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        begun[:] = [future for future in begun if not future.done()]
        begun.append(pool.submit(task, *arguments))
        return begun[-1]

    pool, kind = ThreadPoolExecutor(len(devices)), made_by(str(devices[0]))
    try:
        yield Team(
            job=job,
            pilot=lambda: begin(job.promise_of, campaign, str(devices[0]), progress),
            submit=lambda *shots: begin(work, *shots),
            width=lambda: 2 * len(devices),
            task=lambda rate: task_size(kind) or min(CPU_SHOTS, int(CPU_SECONDS * rate)),
            made_by=kind | dict(job.content),
            underway=lambda: sum(done.copy().values()),
        )
    finally:
        stopping.set()
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
