"""Hits of whole bullets on the paper's plate, beside those that an independent program computed.

    python tests/benchmarks/whole_bullet.py         # writes results/whole_bullet.csv; some three minutes

That program is a prototype in C++ whose bodies touch by balls at the centres of their elements. Its numbers are those
of a rigid core in jacket and filler at 825 m/s without friction, with elements of 0.5 mm. In turns with them, the same
hits of bare cores, and of bullets whose cores break, show what these cost.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pandas as pd
from continuum_cases import CASES, STEEL

from warpimpact import FiniteElements, simulate
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.continuum.finite_elements import FINENESS
from warpimpact.scene import Shots
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.flow import Flow

RESULT = Path(__file__).resolve().parent / "results" / "whole_bullet.csv"
THEIRS = {
    (0.0, 0.0): (781.0, 0.0, 0.0),
    (1.0, 0.0): (785.0, 15.0, 26.0),
    (2.0, 0.0): (781.0, 29.0, 58.0),
    (3.0, 0.0): (778.0, 29.0, 57.0),
    (4.0, 0.0): (773.0, 17.0, 36.0),
    (4.0, 4.0): (778.0, 0.0, 0.0),
    (0.0, 6.0): (767.0, 36.0, 73.0),
    (0.0, 8.0): (772.0, 0.0, 0.0),
    (1.0, 3.0): (779.0, 21.0, 42.0),
    (3.0, 5.0): (775.0, 16.0, 32.0),
    (2.0, 7.0): (770.0, 12.0, 27.0),
    (1.5, 5.0): (770.0, 40.0, 84.0),
}
"""Residual velocity [m/s], tilt at 50 and at 130 mm [°] by hit (y, z) [mm]."""
NUMBERS = ("velocity", "tilt_50", "tilt_130")


def bullet() -> Bullet:
    """The P80 of 9.8 g of that program."""
    known = Catalogue().named(Threat, "P80").bullet
    assert known is not None
    flows = {"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow}
    return known.model_copy(update={"mass": 9.8e-3, **flows})


def hit(
    place: tuple[float, float], of: Bullet | None, core: Flow | None = None, fidelity: str = "draft"
) -> dict[str, float]:
    """A hit: what that program counts, and the time of a core that it takes [s]; what is left of a core that deforms,
    masses in g."""
    size = 0.5e-3 * FINENESS[fidelity]
    conditions = (1e-3 * place[0], 1e-3 * place[1], 825.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    sizes = {"spacing": size, "fidelity": fidelity}
    method = FiniteElements(flows=(flow_entry(STEEL).flow,), friction=0.0, bullet=of, core=core, **sizes)
    begin, shots = time.process_time(), Shots(*(np.array([value]) for value in conditions))
    outcomes = simulate(CASES["slotted"].scene, shots, method=method, device="cpu", threads=1)
    numbers = (outcomes.residual_velocity[0], *np.degrees(outcomes.tilt[0]), time.process_time() - begin)
    row = dict(zip((*NUMBERS, "seconds"), map(float, numbers), strict=True)) | {"status": int(outcomes.status[0])}
    if core is not None:
        row |= {"fragments": float(outcomes.fragments[0]), "broken": float(outcomes.broken[0])}
        row |= {name: 1e3 * float(getattr(outcomes, name)[0]) for name in ("fragment_mass", "eroded_mass")}
    return row


if __name__ == "__main__":
    whole, steel, rows = bullet(), flow_entry("core steel").flow, list[dict[str, float]]()
    hit((0.0, 0.0), None)  # kernels are compiled
    for place, theirs in THEIRS.items():
        row = {"hit_y": place[0], "hit_z": place[1], **hit(place, whole)}
        row |= {"seconds_bare": hit(place, None)["seconds"], "seconds_breaking": hit(place, whole, steel)["seconds"]}
        rows.append(row | {f"{name}_theirs": value for name, value in zip(NUMBERS, theirs, strict=True)})
        pd.DataFrame(rows).round(2).to_csv(RESULT, index=False)
    print(pd.DataFrame(rows).round(2).to_string())
