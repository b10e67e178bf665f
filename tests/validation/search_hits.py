"""How the unpublished lattice, time step and hit points of campaigns/paper_shots.toml were found.

For every lattice and time step it prints the hit on the slot's short axis that is nearest to the paper's first row, and
the hit near the slot's end that is nearest to its second row. "1.00" means that the worst of a row's five numbers
differs by 3 m/s or 3 degrees. Run it as a script: python tests/validation/search_hits.py
"""

from itertools import product

import numpy as np

from warpimpact import Campaign
from warpimpact.analysis.paper import PUBLISHED, STANDOFFS, Row
from warpimpact.scene import Plate, Record, Scene, Shots, SlotPattern
from warpimpact.solver.simulate import simulate

LATTICES = [(7.0e-3, 16e-3), (7.05e-3, 16e-3), (7.1e-3, 16e-3)]
TIME_STEPS = [1.0e-6, 1.1e-6]
HOLE, BETWEEN = (shot["paper's model"] for shot in PUBLISHED.values())
REGIONS = {
    HOLE: (np.arange(1.40e-3, 1.60e-3, 0.01e-3), np.zeros(1)),
    BETWEEN: (np.arange(3.25e-3, 3.50e-3, 0.01e-3), np.arange(4.6e-3, 6.2e-3, 0.04e-3)),
}


def nearest(campaign: Campaign, plate: Plate, time_step: float, target: Row) -> str:
    """The hit in a row's region that is nearest to the row, and its difference."""
    y, z = (axis.ravel() for axis in np.meshgrid(*REGIONS[target], indexing="ij"))
    shots = Shots(hit_y=y, hit_z=z, **{name: np.full(len(y), value) for name, value in campaign.impact})
    record = Record(standoffs=STANDOFFS, standoff_point="nose")
    scene = Scene(core=campaign.core, target=plate, record=record)
    outcomes = simulate(scene, shots, numerics=campaign.numerics.model_copy(update={"time_step": time_step}))
    angles = [np.degrees(a) * np.sign(a[:, 1:] + 1e-12) for a in (outcomes.yaw, outcomes.pitch)]
    rows = np.column_stack(
        [outcomes.residual_velocity, angles[0][:, 0], angles[1][:, 0], angles[0][:, 1], angles[1][:, 1]]
    )
    miss = np.abs(rows - np.array(target)).max(axis=1) / 3.0
    best = int(miss.argmin())
    return f"{miss[best]:.2f} at ({y[best] * 1e3:.2f}, {z[best] * 1e3:.2f}) mm: {rows[best].round(1)}"


def main() -> None:
    campaign = Campaign.from_toml("campaigns/paper_shots.toml")
    for spacing, time_step in product(LATTICES, TIME_STEPS):
        pattern = SlotPattern(length=12e-3, width=4e-3, spacing=spacing)
        plate = campaign.plate.model_copy(update={"pattern": pattern})
        print(f"spacing {spacing}, time step {time_step}")
        for target in (HOLE, BETWEEN):
            print("  ", nearest(campaign, plate, time_step, target))


if __name__ == "__main__":
    main()
