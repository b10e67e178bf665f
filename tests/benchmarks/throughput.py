"""Hits per second of three levels on three scenes.

    python tests/benchmarks/throughput.py          # writes results/throughput.json

The contenders of a scene run in turn, round after round, and the median round counts. Rates are of processor time of
one core, and of wall time on all cores; those of wall time mean something on a quiet machine only. What other scenes
cost beside the slotted plate: roads.py.
"""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import Any

from bench import CHECKOUT, copied, cores, machine, seconds, spent, store

from warpimpact import Campaign, FastLaw
from warpimpact.solver.simulate import simulate

SCENES = {"slotted plate": "slotted_plate", "round holes": "round_holes", "ogive with a shank": "ogive_core"}
"""Campaigns by the name of their scene."""
TIMED = 0.4
"""Processor time of one timed run [s]."""
ROUNDS = 5
"""Runs of each contender, in turn with the others."""
LEVELS, HITS = (0, 2, 6), 1024
"""Levels of LADDER, and Sobol hits over the unit cell."""
FEWEST = 64
"""Hits of a timed run at least; the scenes are drawn over the unit cell."""


def main() -> None:
    """Measure, print, store."""
    values: dict[str, Any] = {"machine": machine(), "hits": HITS, "rounds": ROUNDS, "scenes": {}}
    for name, file in SCENES.items():
        values["scenes"][name] = rates(Campaign.from_toml(CHECKOUT / "campaigns" / f"{file}.toml"))
        print(name, values["scenes"][name])
    store("throughput", values)


def rates(campaign: Campaign) -> dict[str, dict[str, float]]:
    """Hits per second of some levels: of one core, and on all cores."""
    scene, shots = campaign.scene, campaign.sampler().shots(0, HITS)
    values: dict[str, dict[str, float]] = {}
    for level in LEVELS:
        march = partial(simulate, scene, method=FastLaw(level=level), device="cpu")
        march(shots[:FEWEST])  # builds what is to be built
        count = max(FEWEST, int(FEWEST * TIMED / spent(lambda march=march: march(shots[:FEWEST], threads=1))[1]))
        many = copied(shots, -(-count * cores() // len(shots)))
        one, wall = [], []
        for _ in range(ROUNDS):
            one.append(spent(partial(march, many[:count], threads=1))[1] / count)
            wall.append(seconds(partial(march, many[: count * cores()])) / (count * cores()))
        values[f"level {level}"] = {"one_core": 1.0 / median(one), "all_cores": 1.0 / median(wall)}
    return values


if __name__ == "__main__":
    main()
