"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device
from warpimpact.solver.findings import HitErrors, LevelCost
from warpimpact.solver.marching import Helpers, Marching, Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.pilot import Aim, pilot_hits, pilot_size
from warpimpact.solver.prepare import Prepared, prepare
from warpimpact.solver.resolution import at_level
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
    fixed = numerics_for(scene, shots, numerics or Numerics(), worker, len(shots))
    prepared = prepare(scene, shots, fixed)
    return computed(prepared, worker, progress)


def computed(prepared: Prepared, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute a prepared scene; see `simulate`."""
    memory = Memory(prepared, find_device(worker.device), worker.cancel)
    return marched(memory, worker, progress)


def marched(
    memory: Memory, worker: Worker, progress: Progress | None = None, helpers: Helpers | None = None
) -> Outcomes:
    """Compute a scene in the memory of a device, with threads that may help."""
    march = Marching(memory, worker.threads, helpers)
    contact = march.march(progress, worker.cancel)
    return outcomes_of(march.memory, contact)


def numerics_for(scene: Scene, shots: Shots, numerics: Numerics, worker: Worker, hits: int = 0) -> Numerics:
    """Numerics that fix the resolution: the given ones, or what a pilot of some of the shots finds for a run of this
    number of hits."""
    if numerics.explicit is not None:
        return numerics
    return pilot_of(scene, spread(shots, pilot_size(numerics.asked, hits)), numerics, worker, hits=hits).numerics


def pilot_of(
    scene: Scene,
    pilot: Shots,
    numerics: Numerics,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
    aim: Aim | None = None,
    hits: int = 0,
) -> HitErrors:
    """Find the resolution for an accuracy (solver/pilot.py).

    Args:
        pilot: some of the shots.
        trying: called with every level that is computed.
    """
    prepared_of, seconds = partial(prepare, scene), dict[Numerics, float]()

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        assert at.level is not None
        trying(at.level)
        memory = Memory(prepared_of(some, at), find_device(worker.device), worker.cancel)
        memory.build()
        begin = time.perf_counter()
        outcomes = marched(memory, worker)
        seconds[at] = (time.perf_counter() - begin) / len(some)
        return outcomes

    @cache
    def price(level: int) -> float:
        return prepared_of(pilot[:1], at_level(level, numerics)).seconds

    errors = pilot_hits(outcomes_at, pilot, numerics, price, scene.free_behind, aim, hits)
    if not errors.tried:
        return errors
    first = errors.tried[0].errors
    assert first.numerics.level is not None
    cost = LevelCost(seconds[errors.numerics], seconds[first.numerics], first.numerics.level, first.errors)
    return replace(errors, cost=cost)


def spread(shots: Shots, most: int) -> Shots:
    """At least `most` shots at even distances, in the order of `spread_places`."""
    return shots[spread_places(len(shots), min(len(shots), most))]


def spread_places(places: int, count: int) -> NDArray[np.int64]:
    """`count` of the numbers 0 … places − 1 at even distances, in an order in which any first part is spread, too."""
    digits = max(1, (count - 1).bit_length())
    order = np.array([int(f"{k:0{digits}b}"[::-1], 2) for k in range(2**digits)])
    return np.asarray(np.linspace(0, places, count, endpoint=False).astype(np.int64)[order[order < count]])


def outcomes_of(memory: Memory, contact: Any) -> Outcomes:
    """Outcomes of the shots after their march."""
    return Outcomes.collected(memory.prepared.scene, memory.prepared.shots, memory.report(contact))
