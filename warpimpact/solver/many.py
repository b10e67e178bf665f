"""Shots at many scenes, such as designs of a plate or sets of parameters, computed side by side."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import replace
from typing import TypeVar

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device, launching
from warpimpact.solver.marching import Helpers, Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import marched
from warpimpact.solver.worker import Cancel, Cancelled, Worker

Value = TypeVar("Value")
_ANY = Worker()


def simulate_many(
    scenes: Sequence[tuple[Scene, Shots]],
    numerics: Numerics,
    worker: Worker = _ANY,
    progress: Progress | None = None,
) -> list[Outcomes]:
    """Compute the shots of many scenes. The outcomes of each are those of `simulate`, bit for bit.

    On a CPU, each thread prepares and marches a scene of its own. Threads that have no scene left help to march the
    last ones. A GPU computes one scene after another. Only the scenes in progress take scratch memory.

    Args:
        scenes: scenes with their shots. They may differ in everything: cores, layers, records.
        numerics: a fixed resolution, such as Numerics(level=2), for all scenes. There is no pilot.
        progress: called with (shots done, all shots), by any thread.

    Returns:
        The outcomes of the scenes, in their order.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`, for the first scene that cannot be computed.
    """
    device, lock, total = find_device(worker.device), threading.Lock(), sum(len(shots) for _, shots in scenes)
    done = [0] * len(scenes)

    def outcomes(number: int, share: Worker, helpers: Helpers | None) -> Outcomes:
        def told(some: int, _: int) -> None:
            with lock:
                done[number] = some
                if progress is not None:
                    progress(sum(done), total)

        memory = Memory(prepare(*scenes[number], numerics), device, share.cancel)
        return marched(memory, replace(share, threads=1), told, helpers)

    return side_by_side(outcomes, len(scenes), worker)


def side_by_side(
    compute: Callable[[int, Worker, Helpers | None], Value], count: int, worker: Worker = _ANY
) -> list[Value]:
    """The values of `compute` for the numbers 0 … count − 1, in order; on a CPU, one per thread at a time.

    Args:
        compute: called with a number, a worker with a share of the threads that no other call has, and the helpers that
            may join when they have nothing else to do.

    Raises:
        DeviceError: the device is absent.
    """
    threads = launching(worker.threads) if find_device(worker.device).is_cpu else 1
    stop, pool = Cancel(worker.cancel), ThreadPoolExecutor(threads)

    def computed(number: int) -> Value:
        stop.check()
        left = count - number
        helpers = Helpers(pool, threads - 1) if left <= threads > 1 else None
        return compute(number, replace(worker, threads=-(-threads // left), cancel=stop), helpers)

    try:
        futures = [pool.submit(computed, number) for number in range(count)]
        wait(futures, return_when=FIRST_EXCEPTION)
    finally:  # after an error or an interrupt the other results are not needed, and nobody waits for them
        stop.cancel()
        pool.shutdown(wait=False, cancel_futures=True)
    ended = [future for future in futures if future.done() and not future.cancelled()]
    errors = [error for future in ended if (error := future.exception()) is not None]
    for error in sorted(errors, key=lambda error: isinstance(error, Cancelled)):
        raise error
    return [future.result() for future in futures]
