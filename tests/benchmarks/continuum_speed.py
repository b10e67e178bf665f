"""Cost of a hit by finite elements: per element and step, beside the fast law, and on all cores.

python tests/benchmarks/continuum_speed.py          # writes results/continuum_speed.json
"""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import Any

import numpy as np
from bench import cores, machine, seconds, spent, store
from continuum_cases import CASES

from warpimpact import FastLaw, FiniteElements, simulate
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum.handover import memory_of
from warpimpact.solver.device import Worker

CASE = CASES["slotted"]
ROUNDS, FAST_HITS, LEVEL = 3, 1024, 2


def main() -> None:
    """Measure, print, store."""
    continuum = FiniteElements(flows=(flow_entry(CASE.flows[0]).flow,), spacing=0.5e-3)
    shots = CASE.shots(FAST_HITS)
    conditions = memory_of(CASE.scene, shots[:1], Worker("cpu", 1)).prepared.conditions
    times, elements, steps = [], 0, 0
    for _ in range(ROUNDS):
        hit = continuum.prepare_hit(CASE.scene, shots[:1], 0, conditions)
        elements = sum(int(mesh.present.sum()) for mesh in hit.meshes)
        ended, took = spent(hit.march)
        steps = int(ended.flight["steps"])
        times.append(took)
    fast = partial(simulate, CASE.scene, method=FastLaw(level=LEVEL), device="cpu", threads=1)
    fast(shots[:1])
    per_fast = spent(lambda: fast(shots))[1] / FAST_HITS
    together = 2 * cores()
    same = partial(simulate, CASE.scene, shots[np.zeros(together, dtype=int)], method=continuum)
    walls = [seconds(partial(same, threads=threads)) for threads in (1, cores())]
    values: dict[str, Any] = {
        "machine": machine(),
        "rounds": ROUNDS,
        "level": LEVEL,
        "elements": elements,
        "steps": steps,
        "seconds": median(times),
        "nanoseconds": 1e9 * median(times) / elements / steps,
        "fast": per_fast,
        "ratio": median(times) / per_fast,
        "cores": cores(),
        "together": together,
        "scaling": walls[0] / walls[1] / cores(),
    }
    print(values)
    store("continuum_speed", values)


if __name__ == "__main__":
    main()
