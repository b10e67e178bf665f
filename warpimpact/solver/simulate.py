"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.accuracy import LevelErrors, PilotResult, choose_level, hit_errors, pilot_size
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress, march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import Prepared, prepare
from warpimpact.solver.resolution import at_level, coarsest_level
from warpimpact.solver.worker import NEVER, Cancel, Worker

Array = NDArray[np.float64]


def simulate(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel = NEVER,
) -> Outcomes:
    """Compute every shot on its own copy of the target (docs/model.md §§1–5).

    Args:
        numerics: as in a campaign. None is the standard fidelity: a pilot on some of the shots finds the resolution. A
            level or a single setting, such as Numerics(level=2), needs no pilot.
        device, threads, cancel: as in `Worker`.
        progress: called repeatedly with (shots done, all shots).

    Returns:
        The outcomes, with the records of the scene (records/registry.py).

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`.
    """
    worker = Worker(device, threads, cancel)
    fixed = numerics_for(scene, shots, numerics or Numerics(), worker)
    prepared = prepare(scene, shots, fixed)
    return computed(prepared, worker, progress)


def computed(prepared: Prepared, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute a prepared scene; see `simulate`."""
    return marched(Memory(prepared, find_device(worker.device), worker.cancel), worker, progress)


def marched(memory: Memory, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute a scene in the memory of a device."""
    end = march(memory, worker.threads, progress, worker.cancel)
    return end.memory.report(end.outcomes)


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
        ValueError: the accuracy has no bound on outcomes.
    """
    required = numerics.required
    if math.isinf(required.residual_velocity) and math.isinf(required.tilt):
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")

    @cache
    def outcomes(level: int) -> Outcomes:
        trying(level)
        return computed(prepare(scene, pilot, at_level(level, numerics)), worker)

    @cache
    def seconds(level: int) -> float:
        return len(pilot) * prepare(scene, pilot[:1], at_level(level, numerics)).seconds

    def errors(coarse: Outcomes, fine: Outcomes) -> LevelErrors:
        return hit_errors(coarse, fine, required, scene.free_behind)

    first = coarsest_level(required.strictness)
    build_kernels(scene, pilot, at_level(first, numerics), worker)
    return choose_level(numerics, first, outcomes, errors, seconds)


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
