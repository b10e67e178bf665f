"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device
from warpimpact.solver.easing import eased, worth_easing
from warpimpact.solver.findings import Cost, HitErrors
from warpimpact.solver.marching import March, Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.pilot import Excess, pilot_hits, pilot_size
from warpimpact.solver.prepare import Prepared, prepare
from warpimpact.solver.purse import Purse
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
    """Compute every shot on its own copy of the target (docs/model.md §§1–5), or those of a sample one after another on
    one copy (`Shots.sample`, docs/model.md §8).

    Args:
        numerics: as in a campaign. None is the standard fidelity: a pilot on some of the shots finds the resolution. A
            level or a single setting, such as Numerics(level=2), needs no pilot.
        device, threads, cancel: as in `Worker`.
        progress: called repeatedly with (shots done, all shots).

    Returns:
        The outcomes, with what the scene records (records/registry.py).

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`.
    """
    numerics, worker = numerics or Numerics(), Worker(device, threads, cancel)

    def outcomes(some: Shots, at: Numerics, progress: Progress | None = None) -> Outcomes:
        return computed(prepare(scene, some, at), worker, progress)

    if numerics.explicit is None:
        pilot = spread(shots, pilot_size(numerics.asked, len(shots)))
        numerics = pilot_of(scene, pilot, numerics, worker, hits=len(shots)).numerics
    return outcomes(shots, numerics, progress)


def computed(prepared: Prepared, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute what was prepared; see `simulate`."""
    return marched(Memory(prepared, find_device(worker.device)), worker, progress)


def marched(memory: Memory, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute what is in the memory of a device; see `simulate`."""
    march = March(memory, worker.threads)
    contact = march.march(progress, worker.cancel)
    return outcomes_of(march.memory, contact)


def pilot_of(
    scene: Scene,
    pilot: Shots,
    numerics: Numerics,
    worker: Worker,
    trying: Callable[[int], object] = lambda level: None,
    excess_of: Excess | None = None,
    hits: int = 0,
) -> HitErrors:
    """Find the resolution for an accuracy: the level (solver/pilot.py), and for a long run coarser levels of single
    settings (solver/easing.py).

    Args:
        pilot: some of the shots.
        trying: called with every level that is computed.
        excess_of: as in `pilot_hits`.
        hits: of the run that the resolution is for; 0 if that is not known.
    """

    seconds: dict[Numerics, float] = {}

    def outcomes_at(at: Numerics, some: Shots) -> Outcomes:
        assert at.level is not None
        trying(at.level)
        memory = Memory(prepare(scene, some, at), find_device(worker.device))
        memory.build()
        begin = time.perf_counter()
        outcomes = marched(memory, worker)
        seconds[at] = (time.perf_counter() - begin) / len(some)
        return outcomes

    def at_one(level: int, some: Shots) -> Outcomes:
        return outcomes_at(at_level(level, numerics), some)

    def price(level: int) -> float:
        return prepare(scene, pilot[: pilot.at_a_plate], at_level(level, numerics)).seconds

    found = pilot_hits(at_one, pilot, numerics, scene.free_behind, excess_of, Purse(cache(price)))
    if not found.tried:
        return found
    first = found.tried[0][0]
    if excess_of is None and worth_easing(found, hits):
        found = eased(found, outcomes_at, pilot, numerics, scene.free_behind)
    assert first.numerics.level is not None
    cost = Cost(seconds[found.numerics], seconds[first.numerics], first.numerics.level, first.errors)
    return replace(found, cost=cost)


def spread(shots: Shots, most: int) -> Shots:
    """Some of the shots, as `spread_places` has them; those at one plate go together."""
    together = shots.at_a_plate
    plates = len(shots) // together
    places = spread_places(plates, min(plates, -(-most // together)))
    return shots[(places[:, None] * together + np.arange(together)).reshape(-1)]


def spread_places(places: int, count: int) -> NDArray[np.int64]:
    """So many of some places at even distances; the first of them lie all over, too."""
    digits = max(1, (count - 1).bit_length())
    order = np.array([int(f"{k:0{digits}b}"[::-1], 2) for k in range(2**digits)])
    return np.asarray(np.linspace(0, places, count, endpoint=False).astype(np.int64)[order[order < count]])


def outcomes_of(memory: Memory, contact: Any) -> Outcomes:
    """What became of the shots, after their march."""
    return Outcomes.collected(memory.prepared.scene, memory.prepared.shots, memory.report(contact))
