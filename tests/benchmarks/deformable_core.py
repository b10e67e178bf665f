"""Hits of cores that deform on the paper's plate, bare and in their bullets, beside those of an independent program.

    python tests/benchmarks/deformable_core.py          # writes results/deformable_core.csv; some ten minutes
    python tests/benchmarks/deformable_core.py --cell   # writes results/breaking_core.csv, 40 hits over the cell

That program is a prototype in C++; its numbers are those of a bare elastic core whose tip is cut at 0.8 mm, at 825 m/s
without friction (here at a sixth of the core's radius, 0.5 mm). A stiff core has ten times the modulus of steel; the
paper's plate parts the places: 0, 0 is in a hole, 2, 0 at an edge, 4, 0 and 4, 4 in a web.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd
from continuum_cases import CASES
from whole_bullet import NUMBERS, bullet, hit

from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.scene.flow import Flow

RESULTS = Path(__file__).resolve().parent / "results"
ELASTIC_THEIRS = {
    (0.0, 0.0): (804.0, 0.0, 0.0),
    (1.0, 0.0): (780.0, 18.0, 24.0),
    (2.0, 0.0): (751.0, 40.0, 74.0),
    (3.0, 0.0): (728.0, 52.0, 103.0),
    (4.0, 0.0): (719.0, 33.0, 66.0),
    (4.0, 4.0): (729.0, 0.0, 0.0),
    (0.0, 6.0): (733.0, 43.0, 81.0),
}
"""Residual velocity [m/s], tilt at 50 and at 130 mm [°] by hit (y, z) [mm]."""
WHOLE, FINER = ((1.0, 0.0), (2.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 6.0)), ((1.0, 0.0), (2.0, 0.0), (4.0, 0.0))


def elastic(modulus: float) -> Flow:
    """A core that does not yield, of a Young's modulus [Pa]."""
    return Flow(youngs_modulus=modulus, yield_stress=1.0e14, fracture_work=1.0e20)


CORES = {
    "rigid": None,
    "stiff": elastic(2.1e12),
    "elastic": elastic(2.1e11),
    "yielding": flow_entry("core steel").flow.model_copy(update={"fracture_stress": None}),
    "breaking": flow_entry("core steel").flow,
}
CELL, AT_EDGE = 40, 1.0e-3
"""Hits over the cell, and how far from the edge of a slot a hit is one at an edge [m]."""


def cases() -> list[tuple[tuple[float, float], str, bool, str]]:
    """Hit, core, whether it is in its bullet, and fidelity."""
    bare = [(place, name, False, "draft") for place in ELASTIC_THEIRS for name in CORES]
    whole = [(place, name, True, "draft") for place in WHOLE for name in ("rigid", "yielding", "breaking")]
    finer = [(place, name, False, "standard") for place in FINER for name in ("rigid", "elastic", "breaking")]
    return bare + whole + finer


def over_the_cell() -> pd.DataFrame:
    """Hits of breaking cores, bare and in their bullets, with the place of each: in a hole, at an edge, in a web."""
    case, rows = CASES["slotted"], list[dict[str, object]]()
    shots = case.shots(CELL)
    away = case.layers[0].edge_distance(shots.hit_y, shots.hit_z)
    for y, z, distance in zip(1e3 * shots.hit_y, 1e3 * shots.hit_z, away, strict=True):
        where = "edge" if abs(distance) < AT_EDGE else "web" if distance > 0.0 else "hole"
        for is_whole in (False, True):
            row = {"hit_y": round(float(y), 3), "hit_z": round(float(z), 3), "place": where, "whole": is_whole}
            rows.append(row | hit((y, z), bullet() if is_whole else None, CORES["breaking"]))
    return pd.DataFrame(rows)


if __name__ == "__main__":
    of, rows = bullet(), list[dict[str, object]]()
    hit((0.0, 0.0), None)  # kernels are compiled
    if "--cell" in sys.argv:
        over_the_cell().round(3).to_csv(RESULTS / "breaking_core.csv", index=False)
        sys.exit()
    for place, name, is_whole, fidelity in cases():
        row = {"hit_y": place[0], "hit_z": place[1], "core": name, "whole": is_whole, "fidelity": fidelity}
        row |= hit(place, of if is_whole else None, CORES[name], fidelity)
        if name == "elastic":
            row |= {f"{number}_theirs": value for number, value in zip(NUMBERS, ELASTIC_THEIRS[place], strict=True)}
        rows.append(row)
        pd.DataFrame(rows).round(2).to_csv(RESULTS / "deformable_core.csv", index=False)
    print(pd.DataFrame(rows).round(2).to_string())
