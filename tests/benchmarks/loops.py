"""What questions that take many computations cost, as ratios to the slotted plate.

    python tests/benchmarks/loops.py            # writes results/loops.json; some three minutes of a core

- Limits: runs of a hit, and processor time of a hit in a run of RUN hits with its pilot over that of the slotted
  plate at standard. A plate that weakens by time has no limit, so these weaken by distance.
- Draws: processor time of a hit where a posterior draws a length, a law of stress or the spacing of the holes, over
  that of one scene with as many hits at the same level.
- `warpimpact identify` with the paper's two shots: seconds and effective sample size.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench import CHECKOUT, machine, spent, store
from many import seconds, with_lengths
from roads import (
    BY_PATH,
    NORMAL,
    P80,
    ROADS,
    RUN,
    SLOTTED,
    Scenes,
    campaign_of,
    named,
    scenes_of,
)

from warpimpact import Numerics, Shots
from warpimpact.cli.identify import PROCESSES, WORTHWHILE
from warpimpact.identification.fit_file import read_fit
from warpimpact.identification.identify import identify_to_file
from warpimpact.results import posterior_file
from warpimpact.results.files import read_tree
from warpimpact.runs.choice import executor_for
from warpimpact.solver.accuracy import PILOT_LIMITS, pilot_size
from warpimpact.solver.device import cores
from warpimpact.solver.limit import limits, pilot_of_limits
from warpimpact.solver.worker import Worker
from warpimpact.studies.limit import LimitMap

ONE = Worker("cpu", 1)
LIMITS = {  # the pilot of the ogive at round holes takes minutes
    "slotted plate": P80 + SLOTTED.replace("[plate]", BY_PATH) + NORMAL,
}
FIT = CHECKOUT / "campaigns" / "fits" / "paper_fit.toml"
SLOTTED_HITS, HITS, EACH, ROUNDS = 256, 64, 64, 3
"""Hits of the slotted plate that are timed, hits whose limits are searched, hits of a draw, and rounds of the draws."""
DRAWS, LEVEL = 64, Numerics(level=2)


def limit(text: str, slotted: float) -> dict[str, Any]:
    """A search of the limit velocities of some hits of a campaign, beside processor time per hit [s]."""
    campaign = campaign_of(text)
    sought, shots = LimitMap.of(campaign).sought, campaign.sampler().shots(0, HITS)
    some = shots[: pilot_size(campaign.numerics.asked, PILOT_LIMITS)]
    pilot_of_limits(campaign.scene, some[:1], sought, campaign.numerics, ONE)  # builds the kernels
    found, pilot = spent(lambda: pilot_of_limits(campaign.scene, some, sought, campaign.numerics, ONE))
    searched, took = spent(lambda: limits(campaign.scene, shots, sought, found.numerics, ONE))
    whole = took / HITS + pilot / RUN
    return {
        "ratio": whole / slotted,
        "runs": float(searched.runs.mean()),
        "microseconds_per_hit": 1e6 * took / HITS,
        "level": found.numerics.level,
        "kept": found.kept,
        "pilot_share": pilot / RUN / whole,
    }


def drawn_scenes() -> dict[str, Scenes]:
    """Scenes with their shots: one, then what DRAWS draws make of it."""
    ((scene, shots),) = scenes_of([P80 + SLOTTED + NORMAL], DRAWS * EACH)
    spacings = [SLOTTED.replace('["8 mm"', f'["{7.5 + k / DRAWS:.4f} mm"') for k in range(DRAWS)]
    return {
        "one scene": [(scene, shots)],
        "degradation lengths": [(scene, with_lengths(shots, DRAWS))],
        "laws of stress": [(scene, with_laws(shots))],
        "spacings of the slots": scenes_of([P80 + plate + NORMAL for plate in spacings], EACH),
    }


def with_laws(shots: Shots) -> Shots:
    """Shots with laws of stress whose terms are drawn."""
    draws = np.random.default_rng(1).uniform(0.5, 1.0, (2, DRAWS))[:, np.arange(len(shots)) % DRAWS]
    return replace(shots, static=draws[0], quadratic=draws[1])


def draws() -> dict[str, Any]:
    """Cost of a hit of every kind of draw over that of the one scene; the least of some rounds, in turn."""
    kinds = drawn_scenes()
    times: dict[str, list[float]] = {name: [] for name in kinds}
    for number in range(ROUNDS + 1):  # the first one builds the kernels
        for name, scenes in kinds.items():
            took = seconds(scenes, True, 1, time.process_time)
            times[name] += [took] if number else []
    least = {name: min(of) for name, of in times.items()}
    one = least.pop("one scene")
    return {name: {"ratio": of / one, "hits_per_second": 1.0 / of} for name, of in least.items()}


def identified(folder: Path) -> dict[str, Any]:
    """The fit of the paper's two shots, as the command has it; its posterior goes into a folder."""
    began = time.perf_counter()
    output, begin = folder / "paper_fit.nc", os.times()
    workers = min(cores(), PROCESSES)
    with executor_for("cpu", workers=workers, apart=True, after=WORTHWHILE) as executor:
        identify_to_file(read_fit(FIT), output, device=executor, overwrite=True)
    wall = time.perf_counter() - began
    for process in multiprocessing.active_children():
        process.join()  # what it took counts then
    seconds = sum(os.times()[:4]) - sum(begin[:4])
    told = read_tree(output).attrs
    effective, sets = float(told[posterior_file.EFFECTIVE]), int(told[posterior_file.SETS])
    return {"seconds": seconds, "wall": wall, "effective": effective, "sets": sets}


def main() -> None:
    """Measure, print, store."""
    road = named(ROADS["slotted plate"], SLOTTED_HITS)
    slotted = min(road.seconds() for _ in range(ROUNDS)) + road.pilot / RUN
    values: dict[str, Any] = {"machine": machine(), "hits": HITS, "run": RUN, "draws": DRAWS, "each": EACH}
    values |= {"rounds": ROUNDS, "level": LEVEL.level}
    values["limits"] = {name: limit(text, slotted) for name, text in LIMITS.items()}
    print(values["limits"], flush=True)
    values["drawn"] = draws()
    print(values["drawn"], flush=True)
    with TemporaryDirectory() as folder:
        values["identify"] = identified(Path(folder))
    print(values["identify"], flush=True)
    store("loops", values)


if __name__ == "__main__":
    main()
