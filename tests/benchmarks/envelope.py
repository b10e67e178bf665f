"""Thousands of scenes far beyond any realistic shot: how they end, and how well energy and attitude are kept.

The scenes are those of tests/verification/extremes.py, each a function of seed and index. Every step of every shot is
looked at. Run it as a script, from the top of the checkout; it goes on where the file of figures ended:
python tests/benchmarks/envelope.py --scenes 10000 --minutes 15
"""

import argparse
import json
import platform
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from warpimpact.kernels.status import Status

TOP = Path(__file__).parents[2]
sys.path.insert(0, str(TOP))  # for the tests' own modules

from tests.verification.extremes import MOST_RISE, MOST_STRETCH, Found, drawn, found  # noqa: E402

FIGURES = Path(__file__).parent / "results" / "envelope.json"
HITS = 3
NAMED = [Status.NOT_FINITE, Status.GAINED_ENERGY]
"""How no shot may end."""
NONE: dict[str, Any] = {
    "seed": 1,
    "hits_per_scene": HITS,
    "scenes": 0,
    "shots": 0,
    "steps": 0,
    "seconds": 0.0,
    "statuses": {},
    "variants": {},
    "undefined": 0,
    "largest_rise_of_energy_in_a_step_eps": 0.0,
    "largest_gain_of_energy": 0.0,
    "largest_stretch_of_a_quaternion_eps": 0.0,
    "faults": [],
}


def added(figures: dict[str, Any], index: int, outcome: Found) -> dict[str, Any]:
    """Figures with one more scene."""
    fault = (
        outcome.undefined > 0
        or any(status in NAMED for status in outcome.statuses)
        or outcome.steep_rise > MOST_RISE
        or outcome.stretch > MOST_STRETCH
    )
    largest = {
        "largest_rise_of_energy_in_a_step_eps": outcome.rise,
        "largest_gain_of_energy": outcome.gain,
        "largest_stretch_of_a_quaternion_eps": outcome.stretch,
    }
    sums = {"scenes": 1, "shots": HITS, "steps": outcome.steps, "undefined": outcome.undefined}
    counts = {
        "statuses": Counter(status.name.lower() for status in outcome.statuses),
        "variants": Counter([outcome.variant.removeprefix("variant_")]),
    }
    return (
        figures
        | {name: max(figures[name], value) for name, value in largest.items()}
        | {name: figures[name] + value for name, value in sums.items()}
        | {name: dict(sorted((Counter(figures[name]) + count).items())) for name, count in counts.items()}
        | {"faults": figures["faults"] + [index] * fault}
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=10_000, help="scenes in all")
    parser.add_argument("--minutes", type=float, default=60.0, help="longest time of this run")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    arguments = parser.parse_args()
    figures = json.loads(arguments.figures.read_text()) if arguments.figures.exists() else NONE
    before, start = figures["seconds"], time.perf_counter()
    while figures["scenes"] < arguments.scenes and time.perf_counter() - start < 60.0 * arguments.minutes:
        index = figures["scenes"]
        outcome = found(drawn(np.random.default_rng([figures["seed"], index]).random, HITS))
        figures = added(figures, index, outcome)
        figures["seconds"] = round(before + time.perf_counter() - start, 1)
        if figures["scenes"] % 100 == 0:
            arguments.figures.write_text(json.dumps(figures, indent=1) + "\n")
            print(figures["scenes"], figures["seconds"], figures["statuses"], figures["faults"], flush=True)
    arguments.figures.write_text(json.dumps(figures | {"machine": platform.machine()}, indent=1) + "\n")
    sys.exit(1 if figures["faults"] else 0)


if __name__ == "__main__":
    main()
