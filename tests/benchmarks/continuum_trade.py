"""The fast law beside the continuum: the same hits of several plates by both, into rows; and fits of the fast law.

    python tests/benchmarks/continuum_trade.py rows ROWS.csv [--hits 96] [--plates slotted,thin] [--fidelity standard]
    python tests/benchmarks/continuum_trade.py fit ROWS.csv FITTED.csv
    python tests/benchmarks/continuum_trade.py limits ROWS.csv [--plates solid_12] [--friction 0.03] [--spacing 6e-4]

`rows` appends the hits that are not in the file, one by one, so that it may be ended and continued at any time. `fit`
finds the parameters of the fast law that meet every second hit of a plate best, and writes what they give at all hits.
`limits` searches limit velocities of solid plates between shots that pass and shots that are held. All hit at normal
incidence without yaw. The first one has the published velocity; while every shot has passed, the next one has 99 % of
the velocity that the energy of the slowest one asks for. Where a shot failed, the next one is faster.
The page's tables follow from these files (continuum_tables.py).
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from continuum_cases import CASES, MEASURES, PLATES, PUBLISHED, Case, append, measured, written

from warpimpact import Continuum, Impact, Numerics, Scene, simulate
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.kernels.status import Status
from warpimpact.scene import Shots, Target
from warpimpact.scene.scene import NEAR_EDGES

SCALES = np.array([5.0, 5.0, 10.0])
"""What the continuum's own numerics leave open of each measure, about: misfits count in these."""
FEWEST = 8
"""Sound hits of a plate for a fit."""
LEVEL = Numerics(level=2)
SHARES = np.arange(0.2, 2.65, 0.1)
FRICTIONS, WEAKENINGS = (0.0, 0.03, 0.06, 0.1, 0.15), (0.6, 0.7, 0.8, 0.9, 1.0)
"""Shares of the resistance, shear coefficients and degradations that a fit tries."""
TIMED = 1024
"""Hits of a plate of which the time of one by the fast law is taken."""


def computed(compute: Callable[[Shots], Any], shots: Shots, hits: list[int]) -> pd.DataFrame:
    """The measures of some of the shots, their places and their time, by one computation."""
    begin, some = time.process_time(), shots[np.array(hits)]
    outcomes = compute(some)
    seconds = (time.process_time() - begin) / len(hits)
    tilts = np.degrees(outcomes.tilt)
    return pd.DataFrame({
        "hit": hits,
        "hit_y": [f"{y:.6g}" for y in some.hit_y],
        "hit_z": [f"{z:.6g}" for z in some.hit_z],
        "status": outcomes.status,
        "velocity": outcomes.residual_velocity.round(2),
        "tilt_50": tilts[:, 0].round(2),
        "tilt_130": tilts[:, 1].round(2),
        "seconds": round(seconds, 3),
    })  # fmt: skip


def near_edges(case: Case) -> Scene:
    """The scene under the law with free surfaces as it was fitted: Y × 2.8/2.6, without friction and weakening."""
    changes = {"shear_coefficient": 0.0, "degradation": 1.0}
    layers = [one.model_copy(update=changes | {"resistance": one.resistance * 2.8 / 2.6}) for one in case.layers]
    return case.scene.model_copy(update={"target": Target(layers=tuple(layers)), "interaction": NEAR_EDGES})


def write_rows(path: Path, plates: list[str], hits: int, wanted: list[str], settings: dict[str, float | str]) -> None:
    for name, model in product(plates, wanted):
        rows, case, friction = written(path), PLATES[name], f"{settings['friction']:g}"
        done = rows[(rows["plate"] == name) & (rows["friction"] == friction) & (rows["model"] == model)]["hit"]
        continuum = Continuum(flows=tuple(flow_entry(flow).flow for flow in case.flows), **settings)
        law = Numerics(fidelity="standard")
        scene = near_edges(case) if model == "free_surface" else case.scene
        compute = partial(simulate, scene, numerics=continuum if model == "continuum" else law, device="cpu", threads=1)
        lacking = [hit for hit in range(hits) if hit not in set(done)]
        for some in [[hit] for hit in lacking] if model == "continuum" else [lacking] if lacking else []:
            append(path, computed(compute, case.shots(hits), some).assign(plate=name, friction=friction, model=model))


# --- The fast law with other parameters ---


def with_parameters(case: Case, share: float, friction: float, degradation: float) -> Scene:
    """The scene with the resistances of its layers times a share, and with these η and β."""
    layers = []
    for layer in case.layers:
        weakened = degradation if layer.degradation < 1.0 else 1.0
        changes = {"resistance": share * layer.resistance, "shear_coefficient": friction, "degradation": weakened}
        layers.append(layer.model_copy(update=changes))
    return case.scene.model_copy(update={"target": Target(layers=tuple(layers))})


def fast_law(scene: Scene, shots: Shots) -> np.ndarray:
    """Measures of the fast law, shape [hits, 3]."""
    outcomes = simulate(scene, shots, numerics=LEVEL, device="cpu", threads=1)
    return np.column_stack([outcomes.residual_velocity, np.degrees(outcomes.tilt)])


def best_parameters(case: Case, shots: Shots, truth: np.ndarray) -> tuple[float, float, float]:
    """Share of the resistance, shear coefficient and degradation that miss the continuum least."""
    weakenings = WEAKENINGS if case.layers[0].degradation < 1.0 else (1.0,)
    tried = [(float(share), eta, beta) for share in SHARES for eta in FRICTIONS for beta in weakenings]
    misfits = []
    for parameters in tried:
        difference = (fast_law(with_parameters(case, *parameters), shots) - truth) / SCALES
        held = np.isnan(difference).any(axis=1)  # a core that the fast law holds back and the continuum lets pass
        misfits.append(float((np.where(np.isnan(difference), 0.0, difference) ** 2).mean() + 100.0 * held.mean()))
    return tried[int(np.argmin(misfits))]


def fitted_rows(rows: pd.DataFrame) -> Iterator[dict[str, object]]:
    """What the fitted parameters give at every sound hit of every plate that has enough."""
    for plate, case in CASES.items():
        truth = measured(rows, plate, "continuum")
        if len(truth) < FEWEST:
            continue
        shots = case.shots(max(truth.index.max() + 1, TIMED))
        fast_law(case.scene, shots[:1])  # builds what is to be built
        begin = time.process_time()
        fast_law(case.scene, shots[:TIMED])
        milliseconds = 1e3 * (time.process_time() - begin) / TIMED
        share, eta, beta = best_parameters(case, shots[truth.index.to_numpy()[::2]], truth.to_numpy()[::2])
        values = fast_law(with_parameters(case, share, eta, beta), shots[truth.index.to_numpy()])
        for place, (hit, row) in enumerate(zip(truth.index, values, strict=True)):
            numbers = {name: f"{value:.2f}" for name, value in zip(MEASURES, row, strict=True)}
            parameters = {"share": f"{share:.2g}", "shear_coefficient": eta, "degradation": beta}
            part = "out" if place % 2 else "in"
            yield {"plate": plate, "hit": hit, "part": part, **parameters, **numbers, "fast_ms": f"{milliseconds:.3f}"}


# --- Limit velocities of solid plates ---


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
    """Continue the search of a limit velocity; its rows are in the file."""
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
    parser.add_argument("what", choices=("rows", "fit", "limits"))
    parser.add_argument("file", type=Path, nargs="+")
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--fidelity", default="draft")
    parser.add_argument("--spacing", type=float, help="size of the elements [m], in place of a draft's")
    parser.add_argument("--plates")
    parser.add_argument("--models", default="fast,free_surface,continuum")
    arguments = parser.parse_args()
    plates = arguments.plates.split(",") if arguments.plates else None
    if arguments.what == "rows":
        chosen = {"friction": arguments.friction, "fidelity": arguments.fidelity}
        write_rows(arguments.file[0], plates or [*CASES], arguments.hits, arguments.models.split(","), chosen)
    elif arguments.what == "limits":
        for plate in plates or PUBLISHED:
            search(arguments.file[0], plate, arguments.friction, arguments.spacing)
    else:
        rows, fitted = arguments.file
        fitted.unlink(missing_ok=True)
        for row in fitted_rows(written(rows)):
            append(fitted, pd.DataFrame([row]))
