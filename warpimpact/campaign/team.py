"""Who computes the shards of a campaign: the devices of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.compute import compute, made_by
from warpimpact.scene import Shots
from warpimpact.simulate import DeviceError, find_device

CUDA_SHOTS = 2**17
"""Shots per task on a GPU, which fewer would not fill; on a CPU a task is one shard."""


@dataclass(frozen=True)
class Team:
    """Computes shots in the background.

    Attributes:
        submit: hands over shots; their Dataset comes in the future.
        width: tasks to keep under way: as many as compute, and as many that wait.
        task: shots per task.
        made_by: versions and kind of device, which decide the bits.
        underway: how many shots of unfinished tasks are done.
    """

    submit: Callable[[Shots], Future[xarray.Dataset]]
    width: int
    task: int
    made_by: dict[str, str]
    underway: Callable[[], int]


@contextmanager
def local_team(campaign: Campaign, device: str) -> Iterator[Team]:
    """The devices of this machine, each computing one task at a time.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names with commas between them.

    Raises:
        DeviceError: a device is absent, or they are of different kinds, which compute different bits.
    """
    devices = _devices(device)
    idle, done, stopping = SimpleQueue[str](), dict[int, int](), threading.Event()
    for chosen in devices:
        idle.put(str(chosen))

    def work(shots: Shots) -> xarray.Dataset:
        name, thread = idle.get(), threading.get_ident()

        def progress(finished: int, total: int) -> None:
            if stopping.is_set():
                raise InterruptedError
            done[thread] = finished

        try:
            return compute(campaign, shots, device=name, progress=progress)
        finally:
            done[thread] = 0
            idle.put(name)

    pool = ThreadPoolExecutor(len(devices))
    try:
        yield Team(
            submit=lambda shots: pool.submit(work, shots),
            width=2 * len(devices),
            task=1 if devices[0].is_cpu else CUDA_SHOTS,
            made_by=made_by(str(devices[0])),
            underway=lambda: sum(done.copy().values()),
        )
    finally:
        stopping.set()
        pool.shutdown(cancel_futures=True)


def _devices(names: str) -> list[Any]:
    """The devices of some names with commas between them."""
    first = find_device(names.split(",")[0].strip())
    if names == "auto":
        import warp

        return [first] if first.is_cpu else list(warp.get_cuda_devices())
    devices = [first, *(find_device(name.strip()) for name in names.split(",")[1:])]
    if len({kind for chosen in devices if (kind := made_by(str(chosen))["device"])}) > 1:
        raise DeviceError(f'device: got "{names}", but these are of different kinds, which compute different bits')
    return devices
