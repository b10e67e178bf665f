"""The fast law beside the continuum: the same hits of several plates by both, into rows; and fits of the fast law.

    python tests/benchmarks/continuum_trade.py rows ROWS.csv [--hits 96] [--plates slotted,thin] [--fidelity standard]
    python tests/benchmarks/continuum_trade.py fit ROWS.csv FITTED.csv

`rows` appends the hits that are not in the file, one by one, so that it may be ended and continued at any time. `fit`
finds the parameters of the fast law that meet every second hit of a plate best, and writes what they give at all hits.
The page's tables follow from these files (continuum_tables.py).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from continuum_cases import CASES, MEASURES, PLATES, Case, append, measured, written

from warpimpact import Continuum, Numerics, Record, Scene, simulate
from warpimpact.catalogue.catalogue import flow_entry
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
    layers = tuple(
        layer.model_copy(
            update={
                "resistance": share * layer.resistance,
                "shear_coefficient": friction,
                "degradation": degradation if layer.degradation < 1.0 else 1.0,
            }
        )
        for layer in case.layers
    )
    return Scene(core=case.core, target=layers, record=Record(standoffs=(0.05, 0.13)))


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


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("rows", "fit"))
    parser.add_argument("file", type=Path, nargs="+")
    parser.add_argument("--hits", type=int, default=24)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--fidelity", default="draft")
    parser.add_argument("--plates", default=",".join(CASES))
    parser.add_argument("--models", default="fast,free_surface,continuum")
    arguments = parser.parse_args()
    if arguments.what == "rows":
        chosen = {"friction": arguments.friction, "fidelity": arguments.fidelity}
        write_rows(arguments.file[0], arguments.plates.split(","), arguments.hits, arguments.models.split(","), chosen)
    else:
        rows, fitted = arguments.file
        fitted.unlink(missing_ok=True)
        for row in fitted_rows(written(rows)):
            append(fitted, pd.DataFrame([row]))
