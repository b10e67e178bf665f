"""Does the best design of a search remain the best? Eight designs of two fronts by the continuum and by laws.

    python tests/benchmarks/continuum_trade.py rows tests/benchmarks/results/continuum_front.csv --hits 24 \\
        --plates paper_a,paper_b,paper_c,paper_d,free_a,free_b,free_c,free_d --friction 0
    python tests/benchmarks/continuum_front.py [ROWS.csv]

The first command computes the hits by finite elements and appends them to the table, the second one prints means over
the hits that perforate by elements: residual velocity, energy per presented area 130 mm behind the plate, which both
searches made small, and tilt there; and how each law orders the designs (rank correlation).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from continuum_cases import FRONT, Case, measured, written
from scipy.stats import spearmanr

from warpimpact import Interaction, Numerics, simulate
from warpimpact.campaign.straight_passage import StraightPassage
from warpimpact.scene.interaction import NEAR_EDGES

ROWS = Path(__file__).parent / "results" / "continuum_front.csv"
PAPER, CONSTANT, FITTED, ASSUMED = "paper's", "constant, β = 1", "free surfaces, Y 2.8 GPa", "free surfaces, assumed"


def under(case: Case, law: str) -> Case:
    """The design under a law: the paper's; a constant stress fitted alike; free surfaces as fitted, or as an assumption
    beside the paper's parameters."""
    (plate,) = case.layers
    keys: dict[str, float] = {"shear_coefficient": 0.0, "degradation": 1.0}
    if law == PAPER:
        return case
    if law == ASSUMED:
        friction = plate.shear_coefficient
        passage = StraightPassage(case.core, Interaction(), friction, plate.thickness, plate.density)
        alike = passage.resistance_under(NEAR_EDGES, friction, plate.resistance, case.impact.velocity)
        keys = {"resistance": alike, "degradation": 1.0}
    else:
        keys["resistance"] = 2.8e9 if law == FITTED else 3.44e9
    return case._replace(layers=(plate.model_copy(update=keys),))


def means(case: Case, velocity: np.ndarray, tilt: np.ndarray) -> np.ndarray:
    """Of velocity [m/s], energy per presented area [J/mm²] and tilt [°], for tilts in degrees."""
    density = 0.5 * case.core.mass * velocity**2 / case.core.presented_area(np.radians(tilt)) / 1e6
    return np.array([velocity.mean(), density.mean(), tilt.mean()])


def main() -> None:
    """Print the tables."""
    rows = written(Path(sys.argv[1]) if len(sys.argv) > 1 else ROWS)
    found: dict[str, list[np.ndarray]] = {law: [] for law in ("continuum", PAPER, CONSTANT, FITTED, ASSUMED)}
    for name, case in FRONT.items():
        known = measured(rows, name, "continuum")
        if not known:
            continue
        hits, truth = np.array(sorted(known)), np.array([known[hit] for hit in sorted(known)])
        found["continuum"].append(means(case, truth[:, 0], truth[:, 2]))
        shots = case.shots(24)[hits]
        for law in (PAPER, CONSTANT, FITTED, ASSUMED):
            scene = under(case, law).scene
            if law in (FITTED, ASSUMED):
                scene = scene.model_copy(update={"interaction": NEAR_EDGES})
            outcomes = simulate(scene, shots, numerics=Numerics(level=2), device="cpu")
            found[law].append(means(case, outcomes.residual_velocity, np.degrees(outcomes.tilt[:, 1])))
        cells = (f"{v:.0f}; {energy:.1f}; {tilt:.0f}" for v, energy, tilt in (found[law][-1] for law in found))
        print(f"| {case.title} | {len(hits)} | {' | '.join(cells)} |", flush=True)
    truth = np.array(found["continuum"])
    for law in (PAPER, CONSTANT, FITTED, ASSUMED):
        ranks = (spearmanr(truth[:, k], np.array(found[law])[:, k])[0] for k in range(3))
        print(law, "rank correlations", *(f"{rank:.2f}" for rank in ranks))


if __name__ == "__main__":
    main()
