"""Shots at many scenes, such as designs of a plate or sets of parameters, a scene per thread."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from threading import Lock
from typing import TypeVar

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device, launching
from warpimpact.solver.marching import Progress
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import computed
from warpimpact.solver.worker import Cancel, Worker

Value = TypeVar("Value")


def simulate_many(
    scenes: Sequence[tuple[Scene, Shots]],
    numerics: Numerics,
    worker: Worker | None = None,
    progress: Progress | None = None,
) -> list[Outcomes]:
    """Compute the shots of many scenes. The outcomes of each are those of `simulate`, bit for bit.

    Args:
        scenes: scenes with their shots. They may differ in everything: cores, layers, records.
        numerics: a fixed resolution, such as Numerics(level=2), for all scenes. There is no pilot.
        progress: called with (shots done, all shots), by any thread.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`, for a scene that cannot be computed.
    """
    done, total, lock = [0] * len(scenes), sum(len(shots) for _, shots in scenes), Lock()

    def compute(number: int, share: Worker) -> Outcomes:
        def report(now: int, _: int) -> None:
            with lock:
                done[number] = now
                if progress is not None:
                    progress(sum(done), total)

        return computed(prepare(*scenes[number], numerics), share, report)

    return in_threads(compute, len(scenes), worker or Worker())


def in_threads(compute: Callable[[int, Worker], Value], count: int, worker: Worker) -> list[Value]:
    """The values of `compute` for the numbers 0 … count − 1, in order: on a CPU one per thread, on a GPU one by one.

    Args:
        compute: called with a number, and a worker with a share of the threads.

    Raises:
        DeviceError: the device is absent.
    """
    threads = launching(worker.threads) if find_device(worker.device).is_cpu else 1
    stop, pool = Cancel(worker.cancel), ThreadPoolExecutor(threads)
    share = replace(worker, threads=max(1, threads // max(1, count)), cancel=stop)
    try:
        values = [pool.submit(compute, number, share) for number in range(count)]
        for value in as_completed(values):
            value.result()  # raises the first error
    finally:  # after an error or an interrupt the other results are not needed, and nobody waits for them
        stop.cancel()
        pool.shutdown(wait=False, cancel_futures=True)
    return [value.result() for value in values]
