"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from functools import cache
from threading import Lock
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.accuracy import (
    FIRST_AT_BASE,
    LevelErrors,
    PilotResult,
    answer_errors,
    choose_level,
    hit_errors,
    pilot_size,
)
from warpimpact.solver.device import Cancel, Worker, find_device, launching
from warpimpact.solver.marching import Progress, march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import Prepared, prepare
from warpimpact.solver.resolution import at_level, coarsest_level

Array = NDArray[np.float64]
Value = TypeVar("Value")


def computed(prepared: Prepared, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute every shot of a prepared scene on its own copy of the target (docs/model.md §§1–5)."""
    memory, _, contact = march(Memory(prepared, find_device(worker.device), worker.cancel), worker, progress)
    return memory.report(contact)


def numerics_for(scene: Scene, shots: Shots, numerics: Numerics, worker: Worker) -> Numerics:
    """Numerics that fix the resolution: the given ones, or what a pilot of some of the shots finds."""
    if numerics.explicit is not None:
        return numerics
    return pilot_of(scene, spread(shots, pilot_size(numerics.required)), numerics, worker).numerics


def pilot_of(
    scene: Scene,
    pilot: Shots,
    numerics: Numerics,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
) -> PilotResult:
    """Find the level of resolution for an accuracy (solver/accuracy.py).

    Args:
        pilot: some of the shots.
        trying: called with every level that is computed.

    Raises:
        ValueError: the accuracy has no bound on outcomes, or one on a base that the target lacks.
    """
    required = numerics.required_at(len(scene.target.layers))
    if required.bounds_answer and len(scene.target.layers) == 1:
        raise ValueError("accuracy: base_perforated and mean_velocity need layers behind the plate")
    if not required.bounds_answer and not required.bounds_hits:
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")

    def compute(level: int) -> Outcomes:
        trying(level)
        return computed(prepare(scene, pilot, at_level(level, numerics)), worker)

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        parts = [hit_errors(coarse, fine, required, free)] if required.bounds_hits else []
        parts += [answer_errors(coarse, fine, required, free, pilot.velocity)] if required.bounds_answer else []
        every = {name: error for part in parts for name, error in part.errors.items()}
        return LevelErrors(every, max(part.excess for part in parts))

    # A core flies free behind the last layer, and behind one with a gap as wide as the core is long.
    free = [*(gap >= 2.0 * scene.core.bounding_radius for gap in scene.target.gaps[1:]), True]
    first = max(coarsest_level(required.strictness), FIRST_AT_BASE if required.bounds_answer else 0)
    build_kernels(scene, pilot, at_level(first, numerics), worker)
    return choose_level(numerics, first, compute, errors, cost_by_level(scene, pilot, numerics))


def cost_by_level(scene: Scene, pilot: Shots, numerics: Numerics, passages: int = 1) -> Callable[[int], float]:
    """A function of a level: the time that some passages of a pilot's shots take there [s]."""
    return cache(lambda level: passages * len(pilot) * prepare(scene, pilot[:1], at_level(level, numerics)).seconds)


def build_kernels(scene: Scene, shots: Shots, numerics: Numerics, worker: Worker) -> None:
    """Compile what shots need, so that it counts in no time that they take."""
    Memory(prepare(scene, shots, numerics), find_device(worker.device), worker.cancel).build()


def spread(shots: Shots, most: int) -> Shots:
    """At least `most` shots at even distances, in the order of `spread_places`."""
    return shots[spread_places(len(shots), min(len(shots), most))]


def spread_places(places: int, count: int) -> NDArray[np.int64]:
    """`count` of the numbers 0 … places − 1 at even distances, in an order in which any first part is spread, too."""
    digits = max(1, (count - 1).bit_length())
    order = np.array([int(f"{k:0{digits}b}"[::-1], 2) for k in range(2**digits)])
    return np.asarray(np.linspace(0, places, count, endpoint=False).astype(np.int64)[order[order < count]])


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
