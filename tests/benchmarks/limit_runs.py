"""How many runs of a hit a search of limits takes, and whether it finds what a search of each hit on its own finds.

    python tests/benchmarks/limit_runs.py [COUNT [SCENE ...]]

Scenes are those of roads.py that weaken by distance, a solid plate at angles, and a target with a base.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from roads import HOLES, NORMAL, OBLIQUE, OGIVE, P80, SLOTS, base

from warpimpact import Campaign, Numerics
from warpimpact.solver import limit
from warpimpact.solver.limit import HIGHEST_VELOCITY, THICKNESS_TOLERANCE, VELOCITY_TOLERANCE, Sought, thickest
from warpimpact.solver.worker import Worker

BY_PATH = """resistance = "2600 MPa"
shear_coefficient = 0.05
degradation = 0.8
degradation_distance = "0.8 mm"
"""
SLOTTED = f'[plate]\nthickness = "4 mm"\n{BY_PATH}{SLOTS}'
ROUND = f'[plate]\nthickness = "5 mm"\n{BY_PATH}{HOLES}'
SCATTER = '{{ distribution = "normal", mean = {}, std = "{} deg" }}'
TURNED = f"yaw = {SCATTER.format(0, 1)}\npitch = {SCATTER.format(0, 1)}\n"
ALUMINIUM = '[plate]\nthickness = "20 mm"\nresistance = "935 MPa"\nshear_coefficient = 0.05\n'
TILTED = f'[impact]\nvelocity = "600 m/s"\nobliquity = {SCATTER.format(30, 3)}\n{TURNED}'
SLOW, SLOW_OBLIQUE = NORMAL.replace("825", "350"), OBLIQUE.replace("838", "350")

SCENES: dict[str, tuple[str, int, str, int]] = {
    "slotted plate": (P80 + SLOTTED + NORMAL, 2, "velocity", 0),
    "slotted plate, thickness": (P80 + SLOTTED + SLOW, 2, "thickness", 0),
    "solid plate at angles": (OGIVE + ALUMINIUM + TILTED, 2, "velocity", 0),
    "solid plate at angles, thickness": (OGIVE + ALUMINIUM + TILTED, 2, "thickness", 0),
    "round holes, ogive": (OGIVE + ROUND + NORMAL, 2, "velocity", 0),
    "round holes, ogive, 30 degrees": (OGIVE + ROUND + OBLIQUE, 2, "velocity", 0),
    "round holes, ogive, 30 degrees, thickness": (OGIVE + ROUND + SLOW_OBLIQUE, 2, "thickness", 0),
    "plate and base": (P80 + SLOTTED + NORMAL + TURNED + base("8 mm", "4000 MPa"), 0, "velocity", 0),
    "plate and base, thickness of the base": (
        P80 + SLOTTED + NORMAL + TURNED + base("8 mm", "4000 MPa"),
        0,
        "thickness",
        1,
    ),
    "round holes and base, 30 degrees": (OGIVE + ROUND + OBLIQUE + base("6 mm", "800 MPa"), 0, "velocity", 0),
}
"""Campaign, level, and what is sought, by the name of the scene."""


def campaign_of(text: str, count: int) -> Campaign:
    """The campaign with so many hits."""
    hits = f'[hits]\nsampling = "sobol"\ncount = {count}\nseed = 1\n'
    return Campaign.from_text(f'title = "limits"\n{text}{hits}', name="scene", folder=Path())


def found(name: str, count: int) -> tuple[Any, float]:
    """The limits of a scene, and the processor time [s]."""
    text, level, quantity, layer = SCENES[name]
    campaign = campaign_of(text, count)
    scene, shots = campaign.scene, campaign.sampler().shots(0, count)
    highest = HIGHEST_VELOCITY if quantity == "velocity" else thickest(scene, layer)
    sought = Sought(quantity, VELOCITY_TOLERANCE if quantity == "velocity" else THICKNESS_TOLERANCE, highest, layer)
    begin = time.process_time()
    return limit.limits(scene, shots, sought, Numerics(level=level), Worker("cpu")), time.process_time() - begin


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 256
    for name in sys.argv[2:] or SCENES:
        limits, seconds = found(name, count)
        runs, unsure = limits.runs, int((~limits.converged).sum())
        print(f"{name:45} {runs.mean():5.2f} runs, at most {runs.max()}, {unsure} open, {seconds:.1f} s", flush=True)
