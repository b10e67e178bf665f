"""What coarser levels of single settings do to the errors and the cost of scenes that nobody chose.

A pilot for a run of 4096 hits looks for the resolution without and with trials of coarser settings.

    python tests/benchmarks/coarser.py --seed 1 --scenes 10             # single plates of random_scenes.py
    python tests/benchmarks/coarser.py --seed 1 --scenes 10 --layers    # targets and bursts of random_layers.py

Errors are those of 90 % of the hits, against level 7, or 8 behind layers; the change from the level before is their
uncertainty. A pilot of a single plate may end at level 7 itself, whose error is then unknown. Behind layers
those that the promise counts stand beside them: over 1 m/s + 0.2 % and over 1° + 2 %. Times are processor time of one
core. The resolutions of a scene are timed in turn, and the least round counts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from random_layers import broken, counted, drawn, errors
from random_scenes import RUN, Case, draw
from roads import ROUNDS, Road

from warpimpact.records.layer_variables import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import PRESETS, Numerics, Scene, Shots
from warpimpact.solver.pilot import pilot_size
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

NAME = "standard"
ANSWER, HITS = 7, 96
"""Level of LADDER behind the answer on a single plate, and hits."""
ANSWER_LAYERED, HITS_LAYERED = 8, 48
"""The same behind layers."""


def computed(scene: Scene, shots: Shots, numerics: Numerics) -> Outcomes:
    return simulate(scene, shots, numerics=numerics, device="cpu", threads=1)


def measured(scene: Scene, shots: Shots, resolutions: Sequence[Numerics], truth: Outcomes) -> list[dict[str, Any]]:
    """Errors and processor time of a hit [s] of some resolutions."""
    roads = [Road(scene, shots, numerics, kept=False, pilot=math.nan) for numerics in resolutions]
    outcomes = [computed(scene, shots, numerics) for numerics in resolutions]
    rounds = [[road.seconds() for road in roads] for _ in range(ROUNDS)]
    return [
        {
            "resolution": f"level {numerics.level}" + (f" ({numerics.coarser})" if numerics.coarser else ""),
            "found": errors(found, truth, scene.free_behind),
            "counted": counted(NAME, found, truth, scene.free_behind),
            "layered": LAYER_RESIDUAL_VELOCITY in found,
            "seconds": min(times),
        }
        for numerics, found, times in zip(resolutions, outcomes, zip(*rounds, strict=True), strict=True)
    ]


def text_of(row: dict[str, Any]) -> str:
    """A row of `measured` as a line."""
    over = "; counted {:.2f} m/s, {:.2f}°".format(*row["counted"][:2]) if row["layered"] else ""
    return f"{row['resolution']:44}{1e6 * row['seconds']:8.1f} µs, errors {said(row['found'])}{over}"


def said(errors: Sequence[float]) -> str:
    """Errors as random_layers.py has them, with their units."""
    velocity, tilt, depth, status = errors
    behind = "" if math.isnan(depth) else f", {depth:.2f} mm, {status:.1%} end otherwise"
    return f"{velocity:.2f} m/s, {tilt:.2f}°{behind}"


def on_a_scene(case: Case, layered: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a pilot finds on a scene without and with trials of coarser settings, and what that comes to."""
    pilot, worker = case.shots(pilot_size(PRESETS[NAME], RUN), seed=77), Worker("cpu", 1)
    pilot_of(case.scene, pilot[: pilot.at_a_plate], Numerics(), worker)  # builds the kernels
    found, pilots = [], []
    for hits in (0, RUN):
        begin = time.process_time()
        found.append(pilot_of(case.scene, pilot, Numerics(fidelity=NAME), worker, hits=hits))
        pilots.append(time.process_time() - begin)
    shots, answer = case.shots(HITS_LAYERED if layered else HITS), ANSWER_LAYERED if layered else ANSWER
    truth, before = (computed(case.scene, shots, Numerics(level=level)) for level in (answer, answer - 1))
    rows = measured(case.scene, shots, list(dict.fromkeys(one.numerics for one in found)), truth)
    plain, eased = rows[0], dict(rows[-1])
    for row, one, seconds in zip((plain, eased), found, pilots, strict=True):
        row["told"] = [one.residual_velocity_error, math.degrees(one.tilt_error), 1e3 * one.depth_error]
        row["told"].append(one.status_error)
        row |= {"kept": one.kept, "pilot": seconds, "whole": seconds + RUN * row["seconds"]}
        row |= {"uncertain": errors(before, truth, case.scene.free_behind), "room": one.numerics.coarser is not None}
        row["false"] = broken({NAME: row, "uncertain": row["uncertain"]}, NAME)
    return plain, eased


def on_scenes(seed: int, scenes: int, layered: bool) -> None:
    """Print what pilots find on scenes that are drawn."""
    rows = []
    for index in range(scenes):
        case = (drawn if layered else draw)(seed, index)
        rows.append(on_a_scene(case, layered))
        print(f"{index:3} {case.name}; the answer is uncertain by {said(rows[-1][0]['uncertain'])}")
        for row in rows[-1]:
            kept = f"{'kept' if row['kept'] else 'not kept'}{' but false' if row['false'] else ''}"
            print(f"    {text_of(row)}; told {said(row['told'])}, {kept}; pilot {row['pilot']:.2f} s", flush=True)
    eased = [pair for pair in rows if pair[1]["room"]]
    print(f"{len(eased)} of {len(rows)} scenes have coarser settings")
    for name, pairs in (("those", eased), ("all", rows)):
        hit, whole, pilot = (
            np.median([new[what] / old[what] for old, new in pairs] or math.nan)
            for what in ("seconds", "whole", "pilot")
        )
        print(f"medians of {name}: {hit:.2f} of the time of a hit, {whole:.2f} of runs, {pilot:.2f} of the pilots'")
    for name, kind in zip(("without", "with"), zip(*rows, strict=True), strict=True):
        print(f"{name}: {sum(row['kept'] for row in kind)} keep, of which {sum(row['false'] for row in kind)} falsely")


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="what coarser levels of single settings do to errors and cost")
    parser.add_argument("--seed", type=int, default=1, help="of scenes that are drawn (default: 1)")
    parser.add_argument("--scenes", type=int, default=10, help="that are drawn (default: 10)")
    parser.add_argument("--layers", action="store_true", help="several layers and bursts, in place of single plates")
    given = parser.parse_args(argv)
    on_scenes(given.seed, given.scenes, given.layers)


if __name__ == "__main__":
    main()
