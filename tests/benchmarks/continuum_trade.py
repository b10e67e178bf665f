"""The same hits of several plates by the fast laws and by the continuum, into rows: measures and states of the core.

    python tests/benchmarks/continuum_trade.py ROWS.csv [--hits 96] [--plates slotted,thin] [--whole [--breaking]]

It appends the hits that are not in the file, one by one, so that it may be ended and continued at any time. The page's
tables follow from these files (continuum_tables.py). Fits of the fast law and searches of limit velocities are stored;
`warpimpact identify` and `warpimpact continuum` compute such.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from continuum_cases import CASES, PLATES, Case, append, written

from warpimpact import FastLaw, FiniteElements, Scene, simulate
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.records.variables import has_passed
from warpimpact.scene import Shots, Target
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.interaction import NEAR_EDGES
from warpimpact.scene.rigid import line_of_flight

STATE = ("exit_velocity", "exit_axis", "exit_position", "angular_velocity")
"""Outcomes that make up the state of a core behind the plate."""
STRENGTHS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.1)
"""Shares of the resistance at which cores that a law stops are marched again."""
WORKER: dict[str, Any] = {"device": "cpu", "threads": 1}


def computed(compute: Callable[[Shots], Any], shots: Shots, hits: list[int]) -> pd.DataFrame:
    """Measures of some of the shots, their states behind the plate, places and time, by one computation."""
    begin, some = time.process_time(), shots[np.array(hits)]
    outcomes = compute(some)
    seconds = (time.process_time() - begin) / len(hits)
    tilts = np.degrees(outcomes.tilt)
    states = {
        f"{name}_{direction}": [f"{value:.6g}" for value in values[:, k]]
        for name, values in (
            (
                "impact",
                np.array(
                    [
                        v * line_of_flight(*at)
                        for v, *at in zip(some.velocity, some.obliquity, some.azimuth, strict=True)
                    ]
                ),
            ),
            *((name, getattr(outcomes, name)) for name in STATE),
        )
        for k, direction in enumerate("xyz")
    }
    return pd.DataFrame({
        "hit": hits,
        "hit_y": [f"{y:.6g}" for y in some.hit_y],
        "hit_z": [f"{z:.6g}" for z in some.hit_z],
        "status": outcomes.status,
        "velocity": outcomes.residual_velocity.round(2),
        "tilt_50": tilts[:, 0].round(2),
        "tilt_130": tilts[:, 1].round(2),
        "seconds": round(seconds, 3),
    } | states)  # fmt: skip


def near_edges(case: Case) -> Scene:
    """The scene under the law with free surfaces as it was fitted: Y × 2.8/2.6, without friction and weakening."""
    changes = {"shear_coefficient": 0.0, "degradation": 1.0}
    layers = [one.model_copy(update=changes | {"resistance": one.resistance * 2.8 / 2.6}) for one in case.layers]
    return case.scene.model_copy(update={"target": Target(layers=tuple(layers)), "interaction": NEAR_EDGES})


def weakened(scene: Scene, strength: float) -> Scene:
    """The scene with this share of its resistance."""
    layers = [one.model_copy(update={"resistance": strength * one.resistance}) for one in scene.target.layers]
    return scene.model_copy(update={"target": Target(layers=tuple(layers))})


def law_rows(scene: Scene, shots: Shots, hits: list[int]) -> pd.DataFrame:
    """Rows by a fast law. A core that is stopped has the state behind the strongest of weakened plates that it passes,
    and its `strength`; else that is 1."""
    rows, places = pd.DataFrame(), np.array(hits)
    for strength in STRENGTHS:
        compute = partial(simulate, weakened(scene, strength), method=FastLaw(fidelity="standard"), **WORKER)
        marched = computed(compute, shots, places.tolist()).assign(strength=strength).set_index("hit", drop=False)
        if rows.empty:
            rows = marched
        states = [name for name in marched if name.startswith(tuple(STATE)) or name == "strength"]
        rows.loc[places, states] = marched[states]
        places = places[~has_passed(marched["status"].to_numpy())]
        if not len(places):
            break
    return rows


def bullet_of(case: Case) -> Bullet:
    """The whole bullet around the core of a plate's hits."""
    known = Catalogue().named(Threat, ".30 AP M2" if case.core.mass > 5e-3 else "P80").bullet
    assert known is not None
    return known.model_copy(update={"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow})


def write_rows(
    path: Path, plates: list[str], hits: int, wanted: list[str], settings: dict[str, Any], whole: bool
) -> None:
    for name, model in product(plates, wanted):
        rows, case, friction = written(path), PLATES[name], f"{settings['friction']:g}"
        done = rows[(rows["plate"] == name) & (rows["friction"] == friction) & (rows["model"] == model)]["hit"]
        entries, bullet = [flow_entry(flow) for flow in case.flows], bullet_of(case) if whole else None
        flows = tuple((entry.of_whole_bullets if "core" in settings else entry).flow for entry in entries)
        continuum = FiniteElements(flows=flows, bullet=bullet, **settings)
        scene, shots = near_edges(case) if model == "free_surface" else case.scene, case.shots(hits)
        lacking, same = [hit for hit in range(hits) if hit not in set(done)], {"friction": friction, "model": model}
        if model != "continuum":
            if lacking:
                append(path, law_rows(scene, shots, lacking).assign(plate=name, **same))
            continue
        compute = partial(simulate, scene, method=continuum, **WORKER)
        for hit in lacking:
            append(path, computed(compute, shots, [hit]).assign(strength=1.0, plate=name, **same))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--fidelity", default="draft")
    parser.add_argument("--plates", default=",".join(CASES))
    parser.add_argument("--models", default="fast,free_surface,continuum")
    parser.add_argument("--whole", action="store_true", help="whole bullets in the place of bare cores")
    parser.add_argument("--breaking", action="store_true", help="cores that deform and break")
    arguments = parser.parse_args()
    chosen = {"friction": arguments.friction, "fidelity": arguments.fidelity}
    chosen |= {"core": flow_entry("core steel").flow} if arguments.breaking else {}
    plates, models = arguments.plates.split(","), arguments.models.split(",")
    write_rows(arguments.file, plates, arguments.hits, models, chosen, arguments.whole)
