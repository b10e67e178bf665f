"""What the scenes that users have cost, as ratios to the slotted plate: processor time per hit at standard, its pilot
included.

    python tests/benchmarks/roads.py            # writes results/roads.json
    python tests/benchmarks/roads.py --seed 1   # writes results/drawn.json

Every road differs from the slotted plate, or from the oblique one, in what its name says. A road's level is what its
own pilot finds for a run of RUN hits. The roads are timed in turn with the slotted plate, and the least round counts.
With a seed the roads are scenes that nobody chose: single plates and targets of layers of random_cases.py.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench import machine, spent, store
from random_cases import draw, draw_layers

from warpimpact import Campaign, FastLaw, Scene
from warpimpact.scene import Shots
from warpimpact.solver.accuracy import pilot_of, pilot_size
from warpimpact.solver.device import Worker
from warpimpact.solver.settings import PRESETS

RUN, SMALL = 16384, 1024
"""Hits of the run that a pilot is made for; likewise of scenes that are drawn, whose pilots may take long."""
PILOT = pilot_size(PRESETS["standard"])
ROUNDS, TIMED = 3, 0.4
"""Runs of each road, in turn with the slotted plate, and processor time of one of them [s]."""

P80 = """
[core]
shape = "polynomial"
coefficients = [3.0e-4, 0.24, -5.29]
length = "27.86 mm"
mass = "4 g"
"""
OGIVE = """
[core]
shape = "ogive"
diameter = "6.17 mm"
crh = 3.0
length = "27 mm"
mass = "5.25 g"
"""
MATERIAL = """resistance = "2600 MPa"
shear_coefficient = 0.05
degradation = 0.8
"""
SLOTS = (
    'pattern = { shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }\n'
)
HOLES = """[plate.pattern]
shape = "circle"
diameter = "6 mm"
spacing = ["8 mm", "13.86 mm"]
staggered = true
"""
SLOTTED = f'[plate]\nthickness = "4 mm"\n{MATERIAL}{SLOTS}'
ROUND = f'[plate]\nthickness = "5 mm"\n{MATERIAL}{HOLES}'
NORMAL, OBLIQUE = '[impact]\nvelocity = "825 m/s"\n', '[impact]\nvelocity = "838 m/s"\nobliquity = "30 deg"\n'


def base(thickness: str, resistance: str) -> str:
    """A base 100 mm behind the plate that does not weaken."""
    return (
        f'[[layer]]\ngap = "100 mm"\nthickness = "{thickness}"\nresistance = "{resistance}"\nshear_coefficient = 0.05\n'
    )


ROADS = {
    "slotted plate": P80 + SLOTTED + NORMAL,
    "ogive with a shank, round holes of 5 mm": OGIVE + ROUND + NORMAL,
    "the same at 30 degrees": OGIVE + ROUND + OBLIQUE,
    "the same with a base that it pierces": OGIVE + ROUND + OBLIQUE + base("6 mm", "800 MPa"),
    "the same with a base that stops half": OGIVE + ROUND + OBLIQUE + base("10 mm", "3000 MPa"),
    "slotted plate, strength of the core": P80 + 'strength = "3 GPa"\n' + SLOTTED + NORMAL,
    "slotted plate, weakening by distance": P80
    + SLOTTED.replace("[plate]\n", '[plate]\ndegradation_distance = "0.8 mm"\n')
    + NORMAL,
    "slotted plate, rate-dependent stress": P80 + SLOTTED + NORMAL + "[interaction]\nquadratic = 0.5\n",
    "slotted plate of 8 mm": P80 + SLOTTED.replace("4 mm", "8 mm", 1) + NORMAL,
    "slotted plate, double precision": P80 + SLOTTED + NORMAL + '[numerics]\nprecision = "double"\n',
}
"""Campaigns by the name of the road, less what all have."""


@dataclass(frozen=True)
class Road:
    """A scene, its shots, the numerics that keep standard's promise, and the processor time of the pilot [s]."""

    scene: Scene
    shots: Shots
    numerics: FastLaw
    kept: bool
    pilot: float

    def seconds(self) -> float:
        """Processor time of a hit [s]."""
        begin, count = time.process_time(), 0
        while time.process_time() - begin < TIMED:
            count += len(self.numerics.prepare(self.scene, self.shots, Worker("cpu", 1)).compute())
        return (time.process_time() - begin) / count


def road(scene: Scene, shots: Shots, pilot: Shots, numerics: FastLaw) -> Road:
    """A scene and its shots with what their pilot finds."""
    worker = Worker("cpu", 1)
    pilot_of(scene, pilot[:1], numerics, worker)  # builds the kernels
    promise, seconds = spent(lambda: pilot_of(scene, pilot, numerics, worker))
    return Road(scene, shots, numerics.at_level(promise.level), promise.kept, seconds)


def campaign_of(text: str) -> Campaign:
    """The campaign of a text of ROADS."""
    bending = "bending = true\n" if "strength" in text else ""
    whole = f'title = "road"\n{text}[hits]\ncount = {RUN}\nseed = 1\n[output]\nstandoffs = ["130 mm"]\n{bending}'
    return Campaign.from_text(whole, name="road", folder=Path())


def scene_and_shots(text: str, hits: int) -> tuple[Scene, Shots]:
    """The scene of a text of ROADS, and its first shots."""
    campaign = campaign_of(text)
    return campaign.scene, campaign.sampler().shots(0, hits)


def named(text: str, hits: int) -> Road:
    """A road of ROADS."""
    scene, shots = scene_and_shots(text, max(hits, PILOT))
    return road(scene, shots[:hits], shots[:PILOT], campaign_of(text).numerics)


def drawn_roads(seed: int, scenes: int, hits: int) -> dict[str, Road]:
    """Roads that nobody chose: so many single plates, then so many targets of layers."""
    cases = {("plate", k): draw(seed, k) for k in range(scenes)} | {
        ("layers", k): draw_layers(seed, k) for k in range(scenes)
    }
    return {
        f"{kind} {k}: {case.name}": road(case.scene, case.shots(hits), case.shots(PILOT, seed=77), FastLaw())
        for (kind, k), case in cases.items()
    }


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description="what the scenes that users have cost, beside the slotted plate")
    parser.add_argument("--hits", type=int, default=256, help="hits that are timed (default: 256)")
    parser.add_argument("--seed", type=int, help="of scenes that are drawn, in place of the named ones")
    parser.add_argument("--scenes", type=int, default=6, help="of either kind that are drawn (default: 6)")
    given = parser.parse_args(argv)
    run = RUN if given.seed is None else SMALL
    slotted = named(ROADS["slotted plate"], given.hits)
    values: dict[str, Any] = {"machine": machine(), "hits": given.hits, "run": run, "rounds": ROUNDS, "roads": {}}
    if given.seed is None:
        roads = {name: named(text, given.hits) for name, text in ROADS.items()}
    else:
        values["seed"] = given.seed
        roads = drawn_roads(given.seed, given.scenes, given.hits)
    for name, one in roads.items():
        rounds = [(one.seconds(), slotted.seconds()) for _ in range(ROUNDS)]
        cost, reference = (min(times) for times in zip(*rounds, strict=True))
        whole = [seconds * run + of.pilot for seconds, of in ((cost, one), (reference, slotted))]
        values["roads"][name] = {
            "ratio": whole[0] / whole[1],
            "microseconds_per_hit": 1e6 * cost,
            "level": one.numerics.level,
            "kept": one.kept,
            "pilot_share": one.pilot / whole[0],
        }
        print(name, values["roads"][name], flush=True)
    store("roads" if given.seed is None else "drawn", values)


if __name__ == "__main__":
    main()
