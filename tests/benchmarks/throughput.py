"""Hits per second of three levels on three scenes.

    python tests/benchmarks/throughput.py          # writes results/throughput.json

The contenders of a scene run in turn, round after round, and the median round counts. Rates are of processor time of
one core, and of wall time on all cores; those of wall time mean something on a quiet machine only. What other scenes
cost beside the slotted plate: roads.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from bench import SCENES, campaign_of, copied, cores, machine, scene_of, shots_of, store

from warpimpact import Campaign, Numerics, Scene, Shots
from warpimpact.solver.simulate import simulate

TIMED = 0.4
"""Processor time of one timed run [s]."""
ROUNDS = 5
"""Runs of each contender, in turn with the others."""
LEVELS, HITS = (0, 2, 6), 1024
"""Levels of LADDER, and Sobol hits over the unit cell."""
FEWEST = 64
"""Hits of a timed run at least; the scenes are drawn over the unit cell."""

Work = Callable[[Shots], Any]


def main() -> None:
    """Measure, print, store."""
    values: dict[str, Any] = {"machine": machine(), "hits": HITS, "rounds": ROUNDS, "scenes": {}}
    for name, file in SCENES.items():
        values["scenes"][name] = rates(campaign_of(file))
        print(name, values["scenes"][name])
    store("throughput", values)


def rates(campaign: Campaign) -> dict[str, dict[str, float]]:
    """Hits per second of some levels: of one core, and on all cores."""
    scene, shots = scene_of(campaign), shots_of(campaign, HITS)
    found: dict[str, dict[str, float]] = {}
    for level in LEVELS:
        alone, together = (_march(scene, Numerics(level=level), threads) for threads in (1, None))
        alone(shots[:FEWEST])  # builds what is to be built
        begin = time.process_time()
        alone(shots[:FEWEST])
        count = max(FEWEST, int(FEWEST * TIMED / (time.process_time() - begin)))
        some = copied(shots, -(-count // len(shots)))[:count]
        many = copied(shots, -(-count * cores() // len(shots)))[: count * cores()]
        one, wall = [], []
        for _ in range(ROUNDS):
            one.append(_seconds(alone, some, time.process_time) / len(some))
            wall.append(_seconds(together, many, time.perf_counter) / len(many))
        found[f"level {level}"] = {"one_core": 1.0 / float(np.median(one)), "all_cores": 1.0 / float(np.median(wall))}
    return found


def _march(scene: Scene, numerics: Numerics, threads: int | None) -> Work:
    return lambda shots: simulate(scene, shots, numerics=numerics, device="cpu", threads=threads)


def _seconds(work: Work, shots: Shots, clock: Callable[[], float]) -> float:
    begin = clock()
    work(shots)
    return clock() - begin


if __name__ == "__main__":
    main()
