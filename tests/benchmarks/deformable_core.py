"""Hits of cores that deform on the paper's plate, bare and in their bullets, beside those of an independent program.

    python tests/benchmarks/deformable_core.py      # writes results/deformable_core.csv; some ten minutes

That program is a prototype in C++; its numbers are those of a bare elastic core whose tip is cut at 0.8 mm, at 825 m/s
without friction (here at a sixth of the core's radius, 0.5 mm). A stiff core has ten times the modulus of steel; the
paper's plate parts the places: 0, 0 is in a hole, 2, 0 at an edge, 4, 0 and 4, 4 in a web.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from whole_bullet import NUMBERS, bullet, hit

from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.scene.flow import Flow

RESULT = Path(__file__).resolve().parent / "results" / "deformable_core.csv"
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
    "yielding": flow_entry("core steel").flow,
}


def cases() -> list[tuple[tuple[float, float], str, bool, str]]:
    """Hit, core, whether it is in its bullet, and fidelity."""
    bare = [(place, name, False, "draft") for place in ELASTIC_THEIRS for name in CORES]
    whole = [(place, name, True, "draft") for place in WHOLE for name in ("rigid", "yielding")]
    finer = [(place, name, False, "standard") for place in FINER for name in ("rigid", "elastic", "yielding")]
    return bare + whole + finer


if __name__ == "__main__":
    of, rows = bullet(), list[dict[str, object]]()
    hit((0.0, 0.0), None)  # kernels are compiled
    for place, name, is_whole, fidelity in cases():
        row = {"hit_y": place[0], "hit_z": place[1], "core": name, "whole": is_whole, "fidelity": fidelity}
        row |= hit(place, of if is_whole else None, CORES[name], fidelity)
        if name == "elastic":
            row |= {f"{number}_theirs": value for number, value in zip(NUMBERS, ELASTIC_THEIRS[place], strict=True)}
        rows.append(row)
        pd.DataFrame(rows).round(2).to_csv(RESULT, index=False)
    print(pd.DataFrame(rows).round(2).to_string())
