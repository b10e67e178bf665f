"""What is to be known of warpimpact on a CUDA device, in one call of at most eight minutes.

    python tests/benchmarks/gpu.py              # writes results/gpu.json, from which the benchmark page has its rows

Answers of every build of the kernels against the CPU, in both layouts; hits per second of four scenes in both; hits by
finite elements that march together; ten million hits into a file. It needs the checkout and warpimpact's dependencies,
no installation. The exit code is 1 if the device's answers differ from the CPU's by more than stated. `--device cpu
--trial` tries the script itself.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bench import CAMPAIGN, RESULTS, copied, cores, machine, seconds
from roads import NORMAL, OBLIQUE, ROADS, base, scene_and_shots

from warpimpact.campaign.campaign import Campaign
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum.finite_elements import FiniteElements
from warpimpact.continuum.handover import memory_of, outcomes_of
from warpimpact.continuum.many_hits import MOST, ManyHits, together
from warpimpact.continuum.one_hit import HitResult
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import run_to_file
from warpimpact.solver.device import Worker, find_device
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.marching import march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import simulate


class Sizes(NamedTuple):
    """Hits: compared with the CPU, likewise by finite elements, of a rate at most, into a file; size of elements."""

    compared: int = 256
    continuum: int = MOST
    largest: int = 2**21
    file: int = 10_000_000
    spacing: float | None = None


TRIAL = Sizes(compared=12, continuum=2, largest=16, file=64, spacing=1.3e-3)
LEVEL = 2  # of the ladder: that of the slotted plate at standard
SMALLEST, GROWTH, LONG, DISTINCT = 4096, 8, 0.5, 2**15
"""Numbers of hits of a rate, which grow until a run takes LONG [s]; more than DISTINCT repeat."""
COMPARED_ELEMENTS, COMPARED_NODAL = 8, 16  # where a CPU takes long
TOLERANCE = {"90 %": (0.005, 0.02), "max": (0.1, 0.5)}
"""Differences from the CPU: residual velocity [m/s] and tilt at the stand-off [°]. Another order of summation makes as
much difference as single precision against double. 1 % of the hits may end otherwise: cores that nearly stop, or turn
over in a layer, are chaotic."""
ENDING_OTHERWISE = 0.01
LAYOUTS = ("simple", "block")

SLOTTED = ROADS["slotted plate"]
TILTED, WEAK = SLOTTED.replace(NORMAL, OBLIQUE), base("3 mm", "1500 MPa") + "degradation = 0.8\n"
RATED = {
    "slotted plate": SLOTTED,
    "slotted plate at 30°": TILTED,
    "slotted plate at 30° with a base": TILTED + base("6 mm", "800 MPa"),
    "round holes at 30°": ROADS["the same at 30 degrees"],
}
"""Campaigns whose rates are measured, less what all campaigns have."""
BOTH_LAYOUTS = RATED | {
    "no degradation, no friction": SLOTTED.replace("= 0.8", "= 1").replace("shear_coefficient = 0.05\n", ""),
    "stress that depends on the rate": SLOTTED + "[interaction]\nquadratic = 0.5\n",
    "near a free surface": SLOTTED + "[interaction.free_surface]\n",
    "a rim": SLOTTED.replace("[plate]", '[plate]\nsize = ["20 mm", "30 mm"]'),
    "lengths of their own": SLOTTED,
    "a base that weakens": SLOTTED + WEAK,
}
STRONG = SLOTTED.replace('mass = "4 g"', 'mass = "4 g"\nstrength = "3 GPa"')
SIMPLE_ONLY = {
    "strength of the core": STRONG,
    "double precision": SLOTTED,
    "the literal scheme": SLOTTED,
    "all at once": STRONG + WEAK.replace("3 mm", "9 mm") + "[interaction]\nquadratic = 0.5\n",
}
"""What the block layout does not compute. All together need every build of the kernels (kernels/variant.py)."""
SCENES = BOTH_LAYOUTS | SIMPLE_ONLY
OWN: dict[str, dict[str, Any]] = {
    "double precision": {"precision": "double", "level": LEVEL},
    "the literal scheme": {"scheme": "nodal"},
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description="warpimpact on a CUDA device: agreement with the CPU, and speed")
    parser.add_argument("--device", default="cuda:0", help="(default: cuda:0)")
    parser.add_argument("--output", type=Path, default=RESULTS / "gpu.json", help="(default: results/gpu.json)")
    parser.add_argument("--trial", action="store_true", help="few hits of the slotted plate, in this process")
    options = parser.parse_args(argv)
    sizes, names = (TRIAL, ["slotted plate"]) if options.trial else (Sizes(), list(SCENES))
    values: dict[str, Any] = {"device": find_device(options.device).name, "level": LEVEL, "machine": machine()}
    arguments = repeat(options.device), repeat(sizes)
    if options.trial:
        compared = list(zip(names, map(agreement, names, *arguments), strict=True))
    else:  # compiling takes most of the time
        with ProcessPoolExecutor(min(16, cores()), get_context("spawn"), max_tasks_per_child=1) as pool:
            compared = list(zip(names, pool.map(agreement, names, *arguments), strict=True))
    agreements = {f"{name}, {layout}": one for name, by_layout in compared for layout, one in by_layout.items()}
    rated = [name for name in RATED if name in names]
    values |= {"agreement": agreements, "rates": {name: rates(name, options.device, sizes) for name in rated}}
    parts = {"continuum": elements(options.device, sizes), "file": file_run(values["rates"], options.device, sizes)}
    options.output.write_text(json.dumps(values | parts, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(options.output)
    all_answers = agreements | {"finite elements": parts["continuum"]["agreement"]}
    different = [name for name, one in all_answers.items() if not one["same"]]
    if different:
        print(f"further from the CPU's answers than stated: {', '.join(different)}", file=sys.stderr)
    return 1 if different else 0


def agreement(name: str, device: str, sizes: Sizes) -> dict[str, Any]:
    """Differences of one scene's answers from the CPU's, by layout."""
    scene, shots = scene_and_shots(SCENES[name], COMPARED_NODAL if "literal" in name else sizes.compared)
    if name == "lengths of their own":
        shots = replace(shots, degradation_length=np.linspace(0.45e-3, 0.6e-3, 8)[np.arange(len(shots)) % 8])
    own = OWN.get(name, {"level": LEVEL})
    here = simulate(scene, shots, method=FastLaw(**own), device="cpu")
    layouts = LAYOUTS if name in BOTH_LAYOUTS else LAYOUTS[:1]
    there = {one: simulate(scene, shots, method=FastLaw(**own, layout=one), device=device) for one in layouts}
    return {layout: difference(outcomes, here) for layout, outcomes in there.items()}


def difference(there: Any, here: Any) -> dict[str, Any]:
    """Residual velocity [m/s] and tilt [°] against the CPU's, of the hits that end alike."""
    alike = there.status == here.status
    off = np.stack([there.residual_velocity - here.residual_velocity, np.degrees(there.tilt - here.tilt)[:, -1]])
    off = np.abs(np.nan_to_num(off[:, alike]))  # of those that come to rest both are NaN
    values: dict[str, Any] = {"hits": len(alike), "end_otherwise": int((~alike).sum())}
    values["90 %"] = np.quantile(off, 0.9, axis=1).tolist() if alike.any() else [np.inf, np.inf]
    values["max"] = off.max(axis=1, initial=0.0).tolist()
    within = all((np.array(values[key]) <= most).all() for key, most in TOLERANCE.items())
    return values | {"same": bool(within and (~alike).sum() <= max(1, ENDING_OTHERWISE * len(alike)))}


def rates(name: str, device: str, sizes: Sizes) -> dict[str, dict[int, float]]:
    """Hits per second of the march for growing numbers of hits by layout, the preparation left out."""
    scene, some = scene_and_shots(SCENES[name], min(DISTINCT, sizes.largest))
    values: dict[str, dict[int, float]] = {layout: {} for layout in LAYOUTS}
    for layout, by_count in values.items():
        count, taken = min(SMALLEST, sizes.largest), 0.0
        while count <= sizes.largest and taken < LONG:
            shots = copied(some, -(-count // len(some)))[:count]
            memory = Memory(prepare(scene, shots, FastLaw(level=LEVEL, layout=layout)), find_device(device))
            memory.build()
            taken = min(seconds(lambda memory=memory: march(memory)) for _ in range(2))
            by_count[count] = count / taken
            count *= GROWTH
        print(f"{name}, {layout}: {max(by_count.values()):.4g} hits/s", flush=True)
    return values


def elements(device: str, sizes: Sizes) -> dict[str, Any]:
    """Hits of the slotted plate by finite elements that march together: how long they take, and how far the first ones
    are from the CPU's, which march one by one."""
    continuum = FiniteElements(flows=(flow_entry("ARMOX560T Johnson-Cook").flow,), spacing=sizes.spacing)
    scene, shots = scene_and_shots(SLOTTED, sizes.continuum)
    memory = memory_of(scene, shots, Worker("cpu"))
    numbers = [0, *range(len(shots))]
    prepared = [continuum.prepare_hit(scene, shots, k, memory.prepared.conditions, device) for k in numbers]
    ManyHits([prepared.pop(0)]).advance(1)  # compiles
    counts = np.array([sum(int(mesh.present.sum()) for mesh in hit.meshes) for hit in prepared])
    hits: dict[int, HitResult] = {}
    taken = seconds(lambda: hits.update(together(prepared)))
    there = outcomes_of(memory, [hits[number] for number in range(len(shots))], Worker("cpu"))
    here = simulate(scene, shots[:COMPARED_ELEMENTS], method=continuum, device="cpu")
    work = sum(int(counts[number]) * int(hit.flight["steps"]) for number, hit in hits.items())
    values: dict[str, Any] = {"hits": len(shots), "seconds": taken, "elements": float(counts.mean())}
    values |= {"hits_per_second": len(shots) / taken, "nanoseconds": 1e9 * taken / work}
    values["agreement"] = difference(there[: len(here)], here)
    return values


def file_run(rates: dict[str, Any], device: str, sizes: Sizes) -> dict[str, Any]:
    """Seconds of a run of many hits of the slotted plate into a file, and its bytes, in the faster layout."""
    campaign = Campaign.from_toml(CAMPAIGN, count=sizes.file)
    layout = max(LAYOUTS, key=lambda one: max(rates["slotted plate"][one].values()))
    many = campaign.model_copy(update={"numerics": FastLaw(level=LEVEL, layout=layout)})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.nc"
        taken = seconds(lambda: run_to_file(many, path, options=RunOptions(device)))
        size = path.stat().st_size
    return {"hits": sizes.file, "layout": layout, "seconds": taken, "bytes": size}


if __name__ == "__main__":
    sys.exit(main())
