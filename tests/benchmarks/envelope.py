"""Thousands of scenes far beyond any realistic shot: how they end, how well energy and attitude are kept, how long they
take, and whether a replay, a part of the shots, other threads and a search of limits keep their promises.

The scenes are those of tests/verification/extremes.py, each a function of seed and index. Every step of every shot is
looked at. Run it as a script, from the top of the checkout; it goes on where the file of figures ended:
python tests/benchmarks/envelope.py --scenes 10000 --minutes 15

A scene that takes long is printed with the seconds of each of its parts, and while it still runs with the line where it
is. --only looks at one scene and writes no figures.
"""

import argparse
import faulthandler
import json
import platform
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics
from warpimpact.solver.device import find_device
from warpimpact.solver.limit import limit_velocity
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.replay import replay
from warpimpact.solver.simulate import simulate

TOP = Path(__file__).parents[2]
sys.path.insert(0, str(TOP))  # for the tests' own modules

from tests.verification.extremes import MOST_RISE, MOST_STRETCH, Extreme, Found, drawn, found  # noqa: E402

FIGURES = Path(__file__).parent / "results" / "envelope.json"
HITS = 3
LONG, VERY_LONG = 25.0, 60.0
"""Seconds of processor time above which a scene is named; above the first it is printed where it is."""
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
    "long": {},
    "very_long": 0,
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


@dataclass(frozen=True)
class Look:
    """What a look at one scene found.

    Attributes:
        found: of all steps of its shots; None if a part needs more memory than is free.
        way: the promise that was tried.
        kept: whether it holds; None if a part needs more memory than is free.
        seconds: of processor time, by part.
    """

    found: Found | None
    way: str
    kept: bool | None
    seconds: dict[str, float]


def look(index: int, seed: int) -> Look:
    """Draw a scene and try it; compiling is not counted."""
    extreme = drawn(np.random.default_rng([seed, index]).random, HITS)
    scene, shots, precision = extreme
    numerics, way = Numerics(level=0, precision=precision), WAYS[index % len(WAYS)]
    outcome, kept, seconds, begun = None, None, {}, time.process_time()

    def ended(part: str) -> None:
        nonlocal begun
        seconds[part] = round(time.process_time() - begun, 2)
        begun = time.process_time()

    try:
        memory = Memory(prepare(scene, shots, numerics), find_device("cpu"))
        ended("prepare")
        memory.build()
        begun = time.process_time()
        outcome = found(extreme)
        ended("histories")
        all_of_them = simulate(scene, shots, numerics=numerics, device="cpu", threads=1)
        ended("simulate")
        kept = way(extreme, numerics, all_of_them)
    except MemoryError as error:
        print(index, way.__name__, error, flush=True)
    ended(way.__name__)
    return Look(outcome, way.__name__, kept, seconds)


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
    sums = {"shots": HITS, "steps": outcome.steps, "undefined": outcome.undefined}
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


def tried(figures: dict[str, Any], index: int, one: Look) -> dict[str, Any]:
    """Figures with the processor time of a scene, and the way that was tried."""
    total = round(sum(one.seconds.values()), 1)
    return figures | {
        "scenes": index + 1,
        "processor_seconds": round(figures["processor_seconds"] + total, 1),
        "longest_processor_seconds": max(figures["longest_processor_seconds"], total),
        "long": figures["long"] | ({str(index): one.seconds} if total > LONG else {}),
        "very_long": figures["very_long"] + (total > VERY_LONG),
        "ways": dict(sorted((Counter(figures["ways"]) + Counter([one.way])).items())),
        "too_large": figures["too_large"] + (one.kept is None),
        "broken_promises": figures["broken_promises"] + [index] * (one.kept is False),
    }


def with_scene(figures: dict[str, Any], index: int) -> dict[str, Any]:
    """Figures with one more scene, which is printed if it takes long."""
    faulthandler.dump_traceback_later(LONG, repeat=True)
    one = look(index, figures["seed"])
    faulthandler.cancel_dump_traceback_later()
    if sum(one.seconds.values()) > LONG:
        print("long:", index, one.seconds, flush=True)
    return tried(figures if one.found is None else added(figures, index, one.found), index, one)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=10_000, help="scenes in all")
    parser.add_argument("--minutes", type=float, default=60.0, help="longest time of this run")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    parser.add_argument("--only", type=int, help="look at the scene with this number alone")
    arguments = parser.parse_args()
    if arguments.only is not None:
        print(json.dumps(with_scene(NONE, arguments.only), indent=1))
        return
    figures = NONE | (json.loads(arguments.figures.read_text()) if arguments.figures.exists() else {})
    before, start = figures["seconds"], time.perf_counter()
    while figures["scenes"] < arguments.scenes and time.perf_counter() - start < 60.0 * arguments.minutes:
        figures = with_scene(figures, figures["scenes"])
        figures |= {"seconds": round(before + time.perf_counter() - start, 1), "machine": platform.machine()}
        arguments.figures.write_text(json.dumps(figures, indent=1) + "\n")
        if figures["scenes"] % 100 == 0:
            print(figures["scenes"], figures["seconds"], figures["statuses"], figures["faults"], flush=True)
    sys.exit(1 if figures["faults"] or figures["broken_promises"] else 0)


if __name__ == "__main__":
    main()
