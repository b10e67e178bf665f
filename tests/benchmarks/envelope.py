"""Thousands of scenes far beyond any realistic shot: how they end, how well energy and attitude are kept, how long they
take, and whether a replay, a part of the shots, other threads and a search of limits keep their promises.

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
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics
from warpimpact.solver.limit import limit_velocity
from warpimpact.solver.replay import replay
from warpimpact.solver.simulate import simulate

TOP = Path(__file__).parents[2]
sys.path.insert(0, str(TOP))  # for the tests' own modules

from tests.verification.extremes import MOST_RISE, MOST_STRETCH, Extreme, Found, drawn, found  # noqa: E402

FIGURES = Path(__file__).parent / "results" / "envelope.json"
HITS = 3
LONG = 25.0
"""Seconds of processor time, above which a scene is named."""
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
    "processor_seconds": 0.0,
    "longest_processor_seconds": 0.0,
    "long": [],
    "ways": {},
    "too_large": 0,
    "broken_promises": [],
}


def same(one: Outcomes, other: Outcomes) -> bool:
    """Whether outcomes agree in every bit."""
    return all(np.array_equal(getattr(one, name), values, equal_nan=True) for name, values in vars(other).items())


def replayed(extreme: Extreme, numerics: Numerics, all_of_them: Outcomes) -> bool:
    shots = extreme.shots[-1:]
    return same(replay(extreme.scene, shots, numerics=numerics, snapshots=3).outcomes, all_of_them[-1:])


def in_part(extreme: Extreme, numerics: Numerics, all_of_them: Outcomes) -> bool:
    some = simulate(extreme.scene, extreme.shots[::2], numerics=numerics, device="cpu")
    return same(some, all_of_them[::2])


def on_threads(extreme: Extreme, numerics: Numerics, all_of_them: Outcomes) -> bool:
    return same(simulate(extreme.scene, extreme.shots, numerics=numerics, device="cpu", threads=3), all_of_them)


def limited(extreme: Extreme, numerics: Numerics, all_of_them: Outcomes) -> bool:
    """A limit that was found lies between its bounds; a scene that stops no core is refused."""
    try:
        limits = limit_velocity(extreme.scene, extreme.shots[:1], numerics=numerics, device="cpu")
    except ValueError:
        return True
    there = limits.converged
    return bool(((limits.lower <= limits.value) & (limits.value <= limits.upper))[there].all())


WAYS = (replayed, in_part, on_threads, limited)
"""What is tried of a scene beside its shots, one after another from scene to scene."""


def promise(extreme: Extreme, index: int) -> tuple[str, bool | None]:
    """The way that is tried of a scene, and whether it keeps its promise; None if it needs more memory than is free."""
    way, numerics = WAYS[index % len(WAYS)], Numerics(level=0, precision=extreme.precision)
    try:
        all_of_them = simulate(extreme.scene, extreme.shots, numerics=numerics, device="cpu", threads=1)
        return way.__name__, way(extreme, numerics, all_of_them)
    except MemoryError:
        return way.__name__, None


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


def tried(figures: dict[str, Any], index: int, way: str, kept: bool | None, seconds: float) -> dict[str, Any]:
    """Figures with the processor time of a scene, kernels that were compiled included, and the way that was tried."""
    return figures | {
        "processor_seconds": round(figures["processor_seconds"] + seconds, 1),
        "longest_processor_seconds": max(figures["longest_processor_seconds"], round(seconds, 1)),
        "long": figures["long"] + [index] * (seconds > LONG),
        "ways": dict(sorted((Counter(figures["ways"]) + Counter([way])).items())),
        "too_large": figures["too_large"] + (kept is None),
        "broken_promises": figures["broken_promises"] + [index] * (kept is False),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=10_000, help="scenes in all")
    parser.add_argument("--minutes", type=float, default=60.0, help="longest time of this run")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    arguments = parser.parse_args()
    figures = NONE | (json.loads(arguments.figures.read_text()) if arguments.figures.exists() else {})
    before, start = figures["seconds"], time.perf_counter()
    while figures["scenes"] < arguments.scenes and time.perf_counter() - start < 60.0 * arguments.minutes:
        index = figures["scenes"]
        extreme, begun = drawn(np.random.default_rng([figures["seed"], index]).random, HITS), time.process_time()
        figures = added(figures, index, found(extreme))
        way, kept = promise(extreme, index)
        figures = tried(figures, index, way, kept, time.process_time() - begun)
        figures["seconds"] = round(before + time.perf_counter() - start, 1)
        if figures["scenes"] % 100 == 0:
            arguments.figures.write_text(json.dumps(figures, indent=1) + "\n")
            print(figures["scenes"], figures["seconds"], figures["statuses"], figures["faults"], flush=True)
    arguments.figures.write_text(json.dumps(figures | {"machine": platform.machine()}, indent=1) + "\n")
    sys.exit(1 if figures["faults"] or figures["broken_promises"] else 0)


if __name__ == "__main__":
    main()
