"""Cost of a run to a tolerance, compared with a run of every hit at its finest level, and its errors.

Both are timed warm, in turn, in one process. Errors are differences from the converged answer of a study, which takes
the most time. Run it as a script:
python tests/benchmarks/tolerance_cost.py [CAMPAIGN.toml] [--hits N] [--velocity M_PER_S] [--tilt DEGREES]
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from warpimpact import Campaign, Hits, Numerics, make_shots
from warpimpact.scene import Tolerance
from warpimpact.solver.refinement import simulate_to_tolerance
from warpimpact.solver.resolution import LADDER
from warpimpact.solver.simulate import simulate
from warpimpact.studies.accuracy import QUOTED, study

ROUNDS = 3


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure what a run to a tolerance costs.")
    parser.add_argument("campaign", nargs="?", default="campaigns/slotted_plate.toml")
    parser.add_argument("--hits", type=int, default=256)
    parser.add_argument("--velocity", type=float, default=0.5, help="tolerance of the residual velocity [m/s]")
    parser.add_argument("--tilt", type=float, default=0.7, help="tolerance of the tilt [degree]")
    return parser.parse_args()


def seconds(function: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def main() -> None:
    asked = arguments()
    campaign = Campaign.from_toml(asked.campaign)
    tolerance = Tolerance(residual_velocity=asked.velocity, tilt=asked.tilt)
    truth = study(campaign, hits=asked.hits, settings={"draft": Numerics(fidelity="draft")})
    spread = make_shots(campaign.impact, Hits(count=asked.hits), campaign.plate)
    shots = replace(spread, hit_y=truth["hit_y"].values, hit_z=truth["hit_z"].values)  # those of the study

    def to_tolerance() -> Any:
        return simulate_to_tolerance(campaign.scene, shots, numerics=Numerics(tolerance=tolerance))

    outcomes = estimates = to_tolerance()  # builds the kernels, and tells the levels
    finest = LADDER[estimates.level.max()]

    def at_finest() -> Any:
        return simulate(campaign.scene, shots, numerics=finest)

    rounds = [(seconds(to_tolerance), seconds(at_finest)) for _ in range(ROUNDS)]
    laddered, brute = np.min(rounds, axis=0)
    ending = ", ".join(map(str, np.bincount(estimates.level, minlength=len(LADDER))))
    print(f"{campaign.title}: {len(shots)} hits to {asked.velocity:g} m/s and {asked.tilt:g}°")
    print(f"hits that end on level 0 to {len(LADDER) - 1}: {ending}")
    print(f"to the tolerance {laddered:.2f} s; all at {finest.patches_axial} × {finest.patches_around} {brute:.2f} s")
    print(f"ratio {laddered / brute:.3f} (of each round: {', '.join(f'{a / b:.3f}' for a, b in rounds)})", flush=True)

    velocity = np.abs(outcomes.residual_velocity - truth["residual_velocity"].values)
    tilt = np.abs(np.degrees(outcomes.tilt) - truth["tilt"].values).max(axis=1)
    within = (velocity <= asked.velocity) & (tilt <= asked.tilt)
    uncertain = truth.isel(level=-1, standoff=-1).sel(quantile=QUOTED)
    print(f"within the tolerance: {estimates.converged.mean():.1%} by estimate, {within.mean():.1%} in truth")
    print(f"converged answer uncertain by {uncertain['residual_velocity_change'].item():.2g} m/s and ", end="")
    print(f"{uncertain['tilt_change'].item():.2g}° (90 %), status unsettled: {int((truth['settled'] == 0).sum())} hits")


if __name__ == "__main__":
    main()
