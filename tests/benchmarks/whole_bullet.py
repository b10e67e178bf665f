"""Hits of whole bullets on the paper's plate, beside those that an independent program computed.

    python tests/benchmarks/whole_bullet.py             # writes results/whole_bullet.csv; some three minutes
    python tests/benchmarks/whole_bullet.py --choices   # writes results/bullet_choices.csv: lead, wall, friction
    python tests/benchmarks/whole_bullet.py --solid     # writes results/bullet_solid.csv: bare and whole
    python tests/benchmarks/whole_bullet.py --maps      # draws results/bullet_maps.png, the plate of the demo

That program is a prototype in C++ whose bodies touch by balls at the centres of their elements. Its numbers are those
of a rigid core in jacket and filler at 825 m/s without friction, with elements of 0.5 mm. In turns with them, the same
hits of bare cores, and of bullets whose cores break, show what these cost. Choices and solid plates are of cores that
break, too.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from continuum_cases import BULLET_CORE, CASES, STEEL, Case, solid
from matplotlib.figure import Figure

from warpimpact import Campaign, FiniteElements, Scene, run, simulate
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.continuum.finite_elements import FINENESS
from warpimpact.plotting import variable_maps
from warpimpact.scene import Shots
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.flow import Flow

RESULTS = Path(__file__).resolve().parent / "results"
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
LEADS = {
    "lead of 1 GPa": {"youngs_modulus": 1.0e9},
    "softer lead": {
        "density": 10_100.0,
        "youngs_modulus": 18.4e9,
        "hardening": 40.0e6,
        "rate_exponent": 0.01,
        "fracture_work": 252.0e6,
    },
}
"""Constants that differ from those of the catalogue: as Flores-Johnson and others (2011) have them, and after Zochowski
and others (2019), second-hand, whose strain at failure of 3 stands for the work."""
PLACES = ((1.0, 0.0), (2.0, 0.0), (4.0, 0.0), (0.0, 6.0))
"""Where choices are compared: in a hole, at an edge, in a web, between two slots [mm]."""
SOLID = {"4 mm steel": (4e-3, STEEL, 650.0), "6 mm steel": (6e-3, STEEL, 750.0), "12 mm steel": (12e-3, STEEL, 1000.0)}
SOLID |= {"20 mm aluminium": (20e-3, "AA6082-T6", 600.0)}
"""Solid plates that the .30 AP M2 hits along the normal: thickness [m], material, velocity [m/s]."""


def bullet(threat: str = "P80", **changes: object) -> Bullet:
    """A bullet with its materials; the P80 has the 9.8 g of that program."""
    known = Catalogue().named(Threat, threat).bullet
    assert known is not None
    flows = {"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow}
    return known.model_copy(update=({"mass": 9.8e-3} if threat == "P80" else {}) | flows | changes)


class Setup(NamedTuple):
    """What is hit at which velocity [m/s], its material, elements [m] and friction."""

    scene: Scene = CASES["slotted"].scene
    velocity: float = 825.0
    flow: str = STEEL
    spacing: float | None = 0.5e-3
    friction: float = 0.0


def hit(
    place: tuple[float, float],
    of: Bullet | None,
    core: Flow | None = None,
    fidelity: str = "draft",
    setup: Setup = Setup(),  # noqa: B008
) -> dict[str, float]:
    """A hit: what that program counts, and the time of a core that it takes [s]; what is left of a core that deforms,
    masses in g."""
    size = None if setup.spacing is None else setup.spacing * FINENESS[fidelity]
    conditions = (1e-3 * place[0], 1e-3 * place[1], setup.velocity, 0.0, 0.0, 0.0, 0.0, 0.0)
    sizes = {"spacing": size, "fidelity": fidelity}
    method = FiniteElements(
        flows=(flow_entry(setup.flow).flow,), friction=setup.friction, bullet=of, core=core, **sizes
    )
    begin, shots = time.process_time(), Shots(*(np.array([value]) for value in conditions))
    outcomes = simulate(setup.scene, shots, method=method, device="cpu", threads=1)
    numbers = (outcomes.residual_velocity[0], *np.degrees(outcomes.tilt[0]), time.process_time() - begin)
    row = dict(zip((*NUMBERS, "seconds"), map(float, numbers), strict=True)) | {"status": int(outcomes.status[0])}
    if core is not None:
        row |= {"fragments": float(outcomes.fragments[0]), "broken": float(outcomes.broken[0])}
        row |= {name: 1e3 * float(getattr(outcomes, name)[0]) for name in ("fragment_mass", "eroded_mass")}
    return row


def choices() -> pd.DataFrame:
    """Hits of breaking cores in bullets of other lead, walls and friction; a wall gives the mass of the bullet."""
    core, lead = CASES["slotted"].core, flow_entry("lead").flow
    thin, thick = (bullet(wall=wall) for wall in (0.5e-3, 0.8e-3))
    walled = [of.model_copy(update={"mass": sum(of.masses(core)) + core.mass_properties.mass}) for of in (thin, thick)]
    bullets = {"as it is": bullet()}
    bullets |= {name: bullet(filler=lead.model_copy(update=changes)) for name, changes in LEADS.items()}
    bullets |= {"wall of 0.5 mm": walled[0], "wall of 0.8 mm": walled[1], "friction of 0.05": bullet()}
    steel, rows = flow_entry("core steel").flow, list[dict[str, object]]()
    for choice, of in bullets.items():
        setup = Setup(friction=0.05 if choice.startswith("friction") else 0.0)
        for place in PLACES:
            row = {"choice": choice, "mass": round(1e3 * of.mass, 2), "hit_y": place[0], "hit_z": place[1]}
            rows.append(row | hit(place, of, steel, setup=setup))
    return pd.DataFrame(rows)


def solids() -> pd.DataFrame:
    """Bare and whole bullets of the .30 AP M2 at solid plates, rigid and breaking cores."""
    steel, rows = flow_entry("core steel").flow, list[dict[str, object]]()
    for name, (thickness, flow, velocity) in SOLID.items():
        case: Case = solid(name, thickness, 1.0e9, 0.03, flow, (velocity, velocity))
        setup = Setup(case.scene, velocity, flow, None, 0.03)
        for body, of, core in (
            ("bare, rigid", None, None),
            ("bare, breaking", None, steel),
            ("whole, rigid", bullet(".30 AP M2"), None),
            ("whole, breaking", bullet(".30 AP M2"), steel),
        ):
            row = {"plate": name, "impact": velocity, "body": body, "mass": 1e3 * BULLET_CORE.mass}
            rows.append(row | hit((0.0, 0.0), of, core, setup=setup))
    return pd.DataFrame(rows)


def maps() -> Figure:
    """Tilt at the demo's plate, of bare cores and of the whole bullets about them."""
    campaign = Campaign.from_toml(RESULTS.parents[2] / "campaigns" / "fitted_plate.toml")
    whole = campaign.model_copy(update={"bullet": bullet(mass=9.7e-3)})
    return variable_maps({"bare cores": run(campaign), "whole bullets": run(whole)}, "tilt")


if __name__ == "__main__":
    if "--maps" in sys.argv:
        maps().savefig(RESULTS / "bullet_maps.png", dpi=80)
        sys.exit()
    for flag, make, name in (("--choices", choices, "bullet_choices.csv"), ("--solid", solids, "bullet_solid.csv")):
        if flag in sys.argv:
            make().round(2).to_csv(RESULTS / name, index=False)
            sys.exit()
    whole, steel, rows = bullet(), flow_entry("core steel").flow, list[dict[str, float]]()
    hit((0.0, 0.0), None)  # kernels are compiled
    for place, theirs in THEIRS.items():
        row = {"hit_y": place[0], "hit_z": place[1], **hit(place, whole)}
        row |= {"seconds_bare": hit(place, None)["seconds"], "seconds_breaking": hit(place, whole, steel)["seconds"]}
        rows.append(row | {f"{name}_theirs": value for name, value in zip(NUMBERS, theirs, strict=True)})
        pd.DataFrame(rows).round(2).to_csv(RESULTS / "whole_bullet.csv", index=False)
    print(pd.DataFrame(rows).round(2).to_string())
