"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import replace
from itertools import repeat
from threading import Lock
from typing import TypeVar

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Scene, Shots
from warpimpact.solver.device import NEVER, Cancel, Worker, find_device, launching, thread_pool
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.marching import Progress
from warpimpact.solver.method import Method

Value = TypeVar("Value")


def simulate(
    scene: Scene,
    shots: Shots,
    *,
    method: Method = FastLaw(),
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel = NEVER,
) -> Outcomes:
    """Compute every shot by a method.

    Args:
        method: `FastLaw` (docs/model.md) or `FiniteElements` (docs/continuum.md). The default is the fast law at the
            standard fidelity: a pilot on some of the shots finds its level. FastLaw(level=2) needs no pilot. The stress
            of the scene's fast law does not count for finite elements.
        device: a name of Warp, such as "cpu" or "cuda:0"; by default a GPU if there is one.
        threads: on a CPU; one per core by default. A thread computes one hit by finite elements at a time.
        progress: called repeatedly with (shots done, all shots).
        cancel: can be told from elsewhere to break off.

    Returns:
        The outcomes, with what the scene records (records/variables.py), and the variables that the method adds: by
        finite elements `energy_imbalance`, `hourglass_share` and `eroded_elements`.

    Raises:
        DeviceError: the device is absent.
        ValueError, TooLong, MemoryError: the method does not compute this, or it takes too much.
    """
    return method.prepare(scene, shots, Worker(device, threads, cancel)).compute(progress)


def simulate_many(
    scenes: Sequence[tuple[Scene, Shots]],
    method: Method,
    worker: Worker | None = None,
    progress: Progress | None = None,
) -> list[Outcomes]:
    """Compute the shots of many scenes. The outcomes of each are those of `simulate`, bit for bit.

    Args:
        scenes: scenes with their shots. They may differ in everything: cores, layers, records.
        method: for all scenes. Each has its own pilot unless the resolution is fixed, as by FastLaw(level=2).
        progress: called with (shots done, all shots), by any thread.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `simulate`, for a scene that cannot be computed.
    """
    done, total, lock = [0] * len(scenes), sum(len(shots) for _, shots in scenes), Lock()

    def compute(number: int, share: Worker) -> Outcomes:
        def report(now: int, _: int) -> None:
            with lock:
                done[number] = now
                if progress is not None:
                    progress(sum(done), total)

        return method.prepare(*scenes[number], share).compute(report)

    return [*in_threads(compute, len(scenes), worker or Worker())]


def in_threads(compute: Callable[[int, Worker], Value], count: int, worker: Worker) -> Iterable[Value]:
    """The values of `compute` for the numbers 0 … count − 1, in order: on a CPU one per thread, on a GPU one by one.

    A worker with one thread computes each in the calling thread, when it is taken.

    Args:
        compute: called with a number, and a worker with a share of the threads.

    Raises:
        DeviceError: the device is absent.
    """
    if worker.threads == 1:
        return map(compute, range(count), repeat(worker))
    threads = launching(worker.threads) if find_device(worker.device).is_cpu else 1
    stop = Cancel(worker.cancel)
    share = replace(worker, threads=max(1, threads // max(1, count)), cancel=stop)
    with thread_pool(threads) as pool:
        try:
            values = [pool.submit(compute, number, share) for number in range(count)]
            for value in as_completed(values):
                value.result()  # raises the first error
        finally:
            stop.cancel()
    return [value.result() for value in values]
