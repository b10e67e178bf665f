"""Cost of bursts, compared with as many single shots at the same places.

Both are computed in turn, in one process; the least processor time of some rounds counts. Run it as a script:
python tests/benchmarks/burst_cost.py [CAMPAIGN.toml] [--bursts N] [--rounds N]
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from warpimpact import Campaign
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.simulate import simulate


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure what bursts cost.")
    parser.add_argument("campaign", nargs="?", default="campaigns/burst_of_five.toml")
    parser.add_argument("--bursts", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    return parser.parse_args()


def least_seconds(scene: Scene, shots: tuple[Shots, ...], numerics: Numerics, rounds: int) -> list[float]:
    """Processor time of some sets of shots [s]; the first round builds the kernels and does not count."""
    found = np.full((rounds + 1, len(shots)), np.inf)
    for row in found:
        for place, some in enumerate(shots):
            begin = time.process_time()
            simulate(scene, some, numerics=numerics, device="cpu")
            row[place] = time.process_time() - begin
    return list(found[1:].min(axis=0))


def main() -> None:
    given = arguments()
    campaign = Campaign.from_toml(given.campaign, count=given.bursts)
    bursts = campaign.sampler().shots(0, given.bursts * campaign.at_a_plate)
    single = replace(bursts, sample=None, burst_order=None, nearest_earlier_hit=None)
    print(f"{given.bursts} bursts of {campaign.at_a_plate}, processor time, least of {given.rounds}")
    for fidelity in ("draft", "standard", "reference"):
        numerics = Numerics(fidelity=fidelity)
        cost, of_single = least_seconds(campaign.scene, (bursts, single), numerics, given.rounds)
        print(f"{fidelity:<10} bursts {cost:.3f} s, single shots {of_single:.3f} s, ratio {cost / of_single:.3f}")


if __name__ == "__main__":
    main()
