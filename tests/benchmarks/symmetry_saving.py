"""Saving of `irreducible = true`, and the difference between unfolded hits and the same hits computed.

Both are timed warm, in turn, in one process. Run it as a script:
python tests/benchmarks/symmetry_saving.py [CAMPAIGN.toml ...] [--hits N]
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from warpimpact import Campaign, make_shots
from warpimpact.scene import symmetries_used
from warpimpact.solver.simulate import simulate

ROUNDS = 7
CAMPAIGNS = [f"campaigns/{name}.toml" for name in ("slotted_plate", "round_holes", "oblique_shot")]


def seconds(function: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def measure(campaign: Campaign) -> None:
    hits = campaign.hits.model_copy(update={"irreducible": True})
    group = symmetries_used(campaign.impact, hits, campaign.plate)
    shots = make_shots(campaign.impact, hits, campaign.plate)

    def every() -> Any:
        return simulate(campaign.scene, shots, numerics=campaign.numerics)

    def part() -> Any:
        return simulate(campaign.scene, shots[:: len(group)], numerics=campaign.numerics).unfolded(group)

    whole, folded = every(), part()  # builds the kernels
    rounds = [(seconds(every), seconds(part)) for _ in range(ROUNDS)]
    ratio = np.divide(*np.min(rounds, axis=0))
    print(f"{campaign.title}: {len(shots) // len(group)} of {len(shots)} hits computed, {ratio:.2f} times as fast")
    velocity = np.abs(folded.residual_velocity - whole.residual_velocity)
    tilt = np.degrees(np.abs(folded.tilt - whole.tilt)[:, -1])
    for name, far, unit in (("residual velocity", velocity, "m/s"), ("tilt", tilt, "°")):
        print(f"  {name}: {np.nanquantile(far, 0.9):.2g} (90 %) and at most {np.nanmax(far):.2g} {unit} from computed")
    print(f"  other status: {int((folded.status != whole.status).sum())} hits")


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure what the symmetry of a unit cell saves.")
    parser.add_argument("campaigns", nargs="*", default=CAMPAIGNS)
    parser.add_argument("--hits", type=int, default=4096)
    asked = parser.parse_args()
    for path in asked.campaigns:
        measure(Campaign.from_toml(path, count=asked.hits))


if __name__ == "__main__":
    main()
