"""Shots at many scenes: designs of a plate, or sets of parameters, computed side by side."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device, launching
from warpimpact.solver.marching import Helpers, March, Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import outcomes_of
from warpimpact.solver.worker import Cancel, Cancelled, Worker

_ANY = Worker()


def simulate_many(
    scenes: Sequence[tuple[Scene, Shots]],
    numerics: Numerics,
    worker: Worker = _ANY,
    progress: Progress | None = None,
) -> list[Outcomes]:
    """Compute the shots of many scenes. The outcomes of each are those of `simulate`, bit for bit.

    On a CPU as many scenes as there are threads are prepared and marched at a time, and threads that have no scene left
    help to march the last ones. A GPU computes one scene after another. The scratch is that of the scenes that are
    computed at a time.

    Args:
        scenes: a scene and its shots each. They may differ in everything: cores, layers, what is recorded.
        numerics: of a resolution, such as Numerics(level=2), for all scenes. There is no pilot.
        progress: called with (shots done, all shots), by any thread.

    Returns:
        The outcomes of the scenes, in their order.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`, for the first scene that cannot be computed.
    """
    device = find_device(worker.device)
    threads = launching(worker.threads) if device.is_cpu else 1
    stop, lock, total = Cancel(worker.cancel), threading.Lock(), sum(len(shots) for _, shots in scenes)
    done = [0] * len(scenes)

    def outcomes(number: int) -> Outcomes:
        def told(some: int, _: int) -> None:
            with lock:
                done[number] = some
                if progress is not None:
                    progress(sum(done), total)

        stop.check()
        helped = threads > 1 and len(scenes) - number <= threads
        memory = Memory(prepare(*scenes[number], numerics), device)
        march = March(memory, 1, Helpers(pool, threads - 1) if helped else None)
        contact = march.march(told, stop)
        return outcomes_of(march.memory, contact)

    pool = ThreadPoolExecutor(threads)
    try:
        futures = [pool.submit(outcomes, number) for number in range(len(scenes))]
        wait(futures, return_when=FIRST_EXCEPTION)
    finally:  # after an error or an interrupt the others are worth nothing, and nobody waits for them
        stop.cancel()
        pool.shutdown(wait=False, cancel_futures=True)
    ended = [future for future in futures if future.done() and not future.cancelled()]
    errors = [error for future in ended if (error := future.exception()) is not None]
    for error in sorted(errors, key=lambda error: isinstance(error, Cancelled)):
        raise error
    return [future.result() for future in futures]
