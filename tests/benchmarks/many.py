"""Hits per second of many scenes in one call, and of shots with numbers of their own, beside those of one scene.

    python tests/benchmarks/many.py          # writes results/many.json

Designs are slotted plates of other widths, whose tiles are made anew in every round or known from the round before.
Lengths are degradation lengths, one per shot or shared by some. The contenders run in turn, and the least round counts.
Processor time is that of one thread; wall time, on all cores, means something on a quiet machine only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from bench import machine, store
from roads import NORMAL, P80, SLOTTED, Scenes, scene_and_shots

from warpimpact import Numerics, Shots
from warpimpact.solver.many import simulate_many
from warpimpact.solver.tile import forget_tiles
from warpimpact.solver.worker import Worker

LEVEL, ROUNDS = Numerics(level=2), 5
DESIGNS, EACH = 8, 512
LENGTHS = (1024, 64)
WIDTHS = [f"{4.0 + 0.001 * k:.3f} mm" for k in range(DESIGNS)]
"""So alike that their hits cost the same."""


def with_lengths(shots: Shots, lengths: int) -> Shots:
    """Shots with so many degradation lengths in turn, normal about 0.5 mm."""
    drawn = np.clip(np.random.default_rng(1).normal(0.5e-3, 0.1e-3, lengths), 0.3e-3, 0.8e-3)
    return replace(shots, degradation_length=drawn[np.arange(len(shots)) % lengths])


def contenders() -> dict[str, tuple[Scenes, bool]]:
    """Scenes with their shots, and whether their tiles are made anew."""
    scene, shots = scene_and_shots(P80 + SLOTTED + NORMAL, DESIGNS * EACH)
    designs = [
        scene_and_shots(P80 + SLOTTED.replace('width = "4 mm"', f'width = "{width}"') + NORMAL, EACH)
        for width in WIDTHS
    ]
    found: dict[str, tuple[Scenes, bool]] = {
        f"one scene, {DESIGNS * EACH} hits": ([(scene, shots)], False),
        f"{DESIGNS} designs with {EACH} hits each": (designs, True),
        "the same, their tiles known": (designs, False),
    }
    for lengths in LENGTHS:
        found[f"{lengths} degradation lengths, {len(shots) // lengths} hits each"] = (
            [(scene, with_lengths(shots, lengths))],
            False,
        )
    found[f"{LENGTHS[0]} degradation lengths, one hit each"] = (
        [(scene, with_lengths(shots[: LENGTHS[0]], LENGTHS[0]))],
        False,
    )
    return found


def seconds(scenes: Scenes, anew: bool, threads: int | None, clock: Callable[[], float]) -> float:
    """Time per hit of one call [s]."""
    if anew:
        forget_tiles()
    begin = clock()
    simulate_many(scenes, LEVEL, Worker("cpu", threads))
    return (clock() - begin) / sum(len(shots) for _, shots in scenes)


def main() -> None:
    """Measure, print, store."""
    all_of = contenders()
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in all_of}
    for scenes, anew in all_of.values():
        seconds(scenes, anew, None, time.perf_counter)  # builds what is to be built
    for _ in range(ROUNDS):
        for name, (scenes, anew) in all_of.items():
            one = seconds(scenes, anew, 1, time.process_time)
            times[name].append((one, seconds(scenes, anew, None, time.perf_counter)))
    values: dict[str, Any] = {"machine": machine(), "rounds": ROUNDS, "level": LEVEL.level, "contenders": {}}
    reference = [min(of) for of in zip(*next(iter(times.values())), strict=True)]
    for name, rows in times.items():
        least = [min(of) for of in zip(*rows, strict=True)]
        values["contenders"][name] = {
            "one_core": 1.0 / least[0],
            "all_cores": 1.0 / least[1],
            "share": reference[0] / least[0],
        }
        print(name, values["contenders"][name], flush=True)
    store("many", values)


if __name__ == "__main__":
    main()
