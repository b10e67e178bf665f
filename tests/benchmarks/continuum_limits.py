"""Limit velocities of solid plates by the continuum: bisection between shots that pass and shots that are held.

    python tests/benchmarks/continuum_limits.py ROWS.csv [--plates solid_12,solid_20] [--spacing 0.65e-3]

Every shot is a row, appended when it has ended, so that a search may be ended at any time and continued. All shots hit
at normal incidence without yaw. The first one has the published velocity; while every shot has passed, the next one has
99 % of the velocity that the energy of the slowest one asks for. Where a shot failed, the next one is faster.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from continuum_cases import PLATES, PUBLISHED, append, written

from warpimpact import Continuum, Impact, simulate
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.kernels.status import Status
from warpimpact.scene import Shots

WIDTH, SHOTS, STEP = 0.025, 8, 1.04
"""A search ends at a bracket of this share of the velocity, or after so many shots; and the step from one that is held
or has failed to the next, while none has passed."""


class Shot(NamedTuple):
    """How a shot ended: velocities [m/s]."""

    velocity: float
    status: Status
    residual: float


def next_velocity(shots: list[Shot], published: float) -> float | None:
    """Velocity of the next shot of a search [m/s]; None at its end."""
    passed = [shot for shot in shots if shot.status is Status.PERFORATED]
    held = max((shot.velocity for shot in shots if shot.status is Status.ARRESTED), default=0.0)
    if len(shots) >= SHOTS:
        return None
    if not shots:
        return published
    if not passed:
        return STEP * max(shot.velocity for shot in shots)
    slowest = min(passed)
    if slowest.velocity - held <= WIDTH * slowest.velocity:
        return None
    by_energy = 0.99 * float(np.sqrt(slowest.velocity**2 - slowest.residual**2))
    velocity = 0.5 * (held + slowest.velocity) if held else by_energy
    while any(math.isclose(shot.velocity, velocity, rel_tol=1e-3) for shot in shots):
        velocity = 0.5 * (velocity + slowest.velocity)
    return velocity


def shot_at(plate: str, friction: float, spacing: float | None, velocity: float) -> Shot:
    """Compute one shot; without a spacing the elements are those of a draft."""
    case = PLATES[plate]
    impact = Impact(velocity=velocity)
    columns = {name: np.array([getattr(impact, name)]) for name in Impact.model_fields}
    shots = Shots(hit_y=np.zeros(1), hit_z=np.zeros(1), **columns)
    flows = tuple(flow_entry(name).flow for name in case.flows)
    continuum = Continuum(flows=flows, friction=friction, spacing=spacing)
    outcome = simulate(case.scene, shots, numerics=continuum, threads=1)
    return Shot(velocity, Status(int(outcome.status[0])), float(outcome.residual_velocity[0]))


def search(path: Path, plate: str, friction: float, spacing: float | None) -> None:
    """Continue a search; its rows are in the file."""
    while True:
        here = {"plate": plate, "friction": f"{friction:g}", "spacing": "draft" if spacing is None else f"{spacing:g}"}
        columns = written(path).merge(pd.DataFrame([here]))[["velocity", "status", "residual"]]
        shots = [Shot(velocity, Status(int(status)), left) for velocity, status, left in columns.to_numpy()]
        velocity = next_velocity(shots, PUBLISHED[plate].velocity)
        if velocity is None:
            return
        begin = time.process_time()
        shot = shot_at(plate, friction, spacing, round(velocity, 1))
        row = {"velocity": shot.velocity, "status": int(shot.status), "residual": f"{shot.residual:.2f}"}
        append(path, pd.DataFrame([{**here, **row, "seconds": f"{time.process_time() - begin:.1f}"}]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--plates", default=",".join(PUBLISHED))
    parser.add_argument("--friction", default="0,0.03")
    parser.add_argument("--spacing", type=float, help="size of the elements [m], in place of a draft's")
    arguments = parser.parse_args()
    for friction in map(float, arguments.friction.split(",")):
        for plate in arguments.plates.split(","):
            search(arguments.file, plate, friction, arguments.spacing)
