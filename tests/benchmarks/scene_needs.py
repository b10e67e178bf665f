"""Physics that a scene does not use costs nothing: each feature off, beside the same physics with the feature on.

Every pair computes the same outcomes except for rounding. A feature that is off is not in the build of the kernels. A
feature that is on has a value too small to matter. Both are timed warm, in turn, in one process. Run it as a script:
python tests/benchmarks/scene_needs.py [--hits N]
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from bench import CAMPAIGN, copied, shots_of

from warpimpact import Campaign
from warpimpact.scene import CirclePattern, Interaction, Record, Scene, Shots
from warpimpact.solver.simulate import simulate, trace

ROUNDS = 9
COPIES = 4


def seconds(function: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def report(name: str, off: Callable[[], Any], on: Callable[[], Any], hits: int) -> None:
    """One line: µs per hit without and with, and the median ratio of the rounds."""
    rounds = np.array([[seconds(off), seconds(on)] for _ in range(ROUNDS + 1)])[1:]
    per_hit = np.median(rounds, axis=0) / hits * 1e6
    ratio = np.median(rounds[:, 1] / rounds[:, 0])
    print(f"{name:45} {per_hit[0]:8.1f} {per_hit[1]:8.1f} {ratio:8.2f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hits", type=int, default=256, help="Sobol hits on the slotted plate")
    hits = parser.parse_args().hits
    campaign = Campaign.from_toml(CAMPAIGN)
    shots = copied(shots_of(campaign, hits), COPIES)

    bare = campaign.scene.model_copy(update={"record": Record()})

    def run(scene: Scene = bare, shots: Shots = shots) -> Callable[[], Any]:
        return lambda: simulate(scene, shots, numerics=campaign.numerics)

    def scene(**changes: Any) -> Scene:
        return bare.model_copy(update=changes)

    def plate(**changes: Any) -> Scene:
        return scene(target=campaign.plate.model_copy(update=changes))

    print(f"{'feature':45} {'off, µs':>8} {'on, µs':>8} {'on/off':>8}")
    count = len(shots)
    strong = run(plate(degradation=1.0))
    report("degradation (β = 1 | 1 − 1e-12)", strong, run(plate(degradation=1.0 - 1e-12)), count)
    report("friction (η = 0 | 1e-12)", run(plate(shear_coefficient=0.0)), run(plate(shear_coefficient=1e-12)), count)
    report("rate-dependent stress (none | 1e-12)", run(), run(scene(interaction=Interaction(quadratic=1e-12))), count)
    report("rim (infinite | 100 m square)", run(), run(plate(size=(100.0, 100.0))), count)
    report(
        "stand-offs (none | 32)", run(), run(scene(record=Record(standoffs=tuple(np.linspace(0.05, 2.0, 32))))), count
    )
    few = shots[:64]
    report(
        "history of every step (64 hits)",
        run(shots=few),
        lambda: trace(bare, few, numerics=campaign.numerics),
        64,
    )
    # A core through the middle of a hole of 12 mm, and the same plate with the shot on the web between holes.
    wide = plate(pattern=CirclePattern(shape="circle", diameter=12e-3, spacing=(20e-3, 20e-3)))
    middle, web = (moved(shots, at) for at in (0.0, 10e-3))
    report("march (nothing touched | touched)", run(wide, middle), run(wide, web), count)


def moved(shots: Shots, at: float) -> Shots:
    values = shots.columns | {name: np.full(len(shots), at) for name in ("hit_y", "hit_z")}
    return Shots(**values)


if __name__ == "__main__":
    main()
