"""The same hits of several plates by the fast laws and by the continuum, into rows.

    python tests/benchmarks/continuum_trade.py ROWS.csv [--hits 96] [--plates slotted,thin] [--fidelity standard]

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
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.scene import Shots, Target
from warpimpact.scene.interaction import NEAR_EDGES


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
        continuum = FiniteElements(flows=tuple(flow_entry(flow).flow for flow in case.flows), **settings)
        law = FastLaw(fidelity="standard")
        scene = near_edges(case) if model == "free_surface" else case.scene
        compute = partial(simulate, scene, method=continuum if model == "continuum" else law, device="cpu", threads=1)
        lacking = [hit for hit in range(hits) if hit not in set(done)]
        for some in [[hit] for hit in lacking] if model == "continuum" else [lacking] if lacking else []:
            append(path, computed(compute, case.shots(hits), some).assign(plate=name, friction=friction, model=model))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--fidelity", default="draft")
    parser.add_argument("--plates", default=",".join(CASES))
    parser.add_argument("--models", default="fast,free_surface,continuum")
    arguments = parser.parse_args()
    chosen = {"friction": arguments.friction, "fidelity": arguments.fidelity}
    write_rows(arguments.file, arguments.plates.split(","), arguments.hits, arguments.models.split(","), chosen)
