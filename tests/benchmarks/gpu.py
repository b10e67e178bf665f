"""All that is to be known of warpimpact on a CUDA device, in one call of at most eight minutes.

    python tests/benchmarks/gpu.py              # writes results/gpu.json, from which the benchmark page has its rows

Answers of every build of the kernels against the CPU, in both layouts; hits per second of three scenes in both; the
slotted plate with other block sizes and without grid-stride loops; hits by finite elements that march together; ten
million hits into a file. Builds are compiled by several processes, then each rate is measured alone. What no time is
left for is named as left out.

It needs the checkout and warpimpact's dependencies, no installation. The exit code is 1 if the device's answers differ
from the CPU's by more than stated, and 2 if there is no such device. `--device cpu` tries the script itself.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from bench import CAMPAIGN, RESULTS, copied, cores, machine, seconds, shots_of
from floor import work_of
from roads import NORMAL, ROADS, base, scene_and_shots
from roads import OBLIQUE as OBLIQUE_IMPACT

from warpimpact.campaign.campaign import Campaign
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum.meeting import Struck, march_of
from warpimpact.continuum.strikes import MOST, ManyHits, memory_of, outcomes_of, simulate, together
from warpimpact.kernels import lanes, march
from warpimpact.runs.run import run_to_file
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver.device import DeviceError, find_device
from warpimpact.solver.marching import Marching
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.worker import Worker

LEVEL = 2
"""Of the ladder: that of the slotted plate at standard."""
BUDGET = 450.0
"""No part begins later than this [s]; the file of END_TO_END hits has FOR_THE_FILE of it to itself."""
END_TO_END, FOR_THE_FILE = 10_000_000, 60.0
SMALLEST, GROWTH, LARGEST, LONG = 4096, 8, 2**21, 0.5
"""Numbers of hits of a rate, which grow until a run takes LONG [s]."""
ELEMENTS, COMPARED, MATERIAL, SPACING = "finite elements", 8, "ARMOX560T", None
"""The part of the continuum, its hits that are compared with the CPU, its material, and the size of its elements, which
are drafts without one."""
DISTINCT = 2**15
"""Number of different hits in a run; larger runs repeat them."""
AGREEING, AGREEING_NODAL, FLOOR_HITS = 256, 16, 16
TOLERANCE = {"90 %": (0.005, 0.02), "max": (0.1, 0.5)}
"""Differences from the CPU: residual velocity [m/s] and tilt at the stand-off [°]. Another order of summation makes as
much difference as single precision against double. 1 % of the hits may end otherwise: cores that nearly stop, or turn
over in a layer, are chaotic."""
ENDING_OTHERWISE = 0.01
FLOAT_LANES = 128
"""float32 lanes per multiprocessor, as on compute capability 8.6, 8.9, 9.0, 10 and 12; 64 on 7.x and 8.0."""

SLOTS, OBLIQUE, LAYERS, ROUND = (
    "slotted plate",
    "slotted plate at 30°",
    "slotted plate at 30° with a base",
    "round holes at 30°",
)
WEAK = base("3 mm", "1500 MPa") + "degradation = 0.8\n"
SCENES = {
    SLOTS: ROADS[SLOTS],
    OBLIQUE: ROADS[SLOTS].replace(NORMAL, OBLIQUE_IMPACT),
    LAYERS: ROADS[SLOTS].replace(NORMAL, OBLIQUE_IMPACT) + base("6 mm", "800 MPa"),
    "no degradation, no friction": ROADS[SLOTS]
    .replace("degradation = 0.8", "degradation = 1")
    .replace("shear_coefficient = 0.05\n", ""),
    "stress that depends on the rate": ROADS[SLOTS] + "[interaction]\nquadratic = 0.5\n",
    "near a free surface": ROADS[SLOTS] + "[interaction.free_surface]\n",
    "a rim": ROADS[SLOTS].replace("[plate]", '[plate]\nsize = ["20 mm", "30 mm"]'),
    "lengths of their own": ROADS[SLOTS],
    "a base that weakens": ROADS[SLOTS] + WEAK,
    ROUND: ROADS["the same at 30 degrees"],
    "strength of the core": ROADS["slotted plate, strength of the core"],
    "double precision": ROADS[SLOTS],
    "the literal scheme": ROADS[SLOTS],
    "all at once": ROADS[SLOTS].replace('mass = "4 g"', 'mass = "4 g"\nstrength = "3 GPa"')
    + WEAK.replace("3 mm", "9 mm")
    + "[interaction]\nquadratic = 0.5\n",
}
"""Campaigns by name, less what all have: together they need every build of the kernels (kernels/variant.py)."""
SIMPLE_ONLY = ("strength of the core", "double precision", "the literal scheme", "all at once")
"""What the block layout does not compute: bending, float64, the nodal scheme."""
OWN = {"double precision": {"precision": "double"}, "the literal scheme": {"scheme": "nodal"}}
"""Numerics of a scene in the place of LEVEL, or beside it."""


@dataclass(frozen=True)
class Way:
    """How a device computes: the layout, the blocks that a multiprocessor is to hold at least in the block layout, the
    threads of a block in the simple one, and whether a kernel has a grid-stride loop."""

    layout: str = "simple"
    blocks: int = lanes.BLOCKS
    threads: int = lanes.THREADS
    grid_stride: bool = True

    @property
    def name(self) -> str:
        size = f"{self.blocks} blocks" if self.layout == "block" else f"{self.threads} threads"
        return f"{self.layout}, {size}" + ("" if self.grid_stride else ", no grid-stride loop")

    def take(self) -> None:
        """Build all kernels of this process so, from now on."""
        march.BLOCKS, lanes.THREADS = self.blocks, self.threads
        wp.config.default_grid_stride = self.grid_stride


SIMPLE, BLOCK = Way(), Way("block")
OTHERS = [replace(way, grid_stride=False) for way in (SIMPLE, BLOCK)]
OTHERS += [replace(SIMPLE, threads=count) for count in (64, 128)] + [replace(BLOCK, blocks=count) for count in (8, 16)]
RATES = [(name, way) for name in (SLOTS, OBLIQUE, LAYERS, ROUND) for way in (SIMPLE, BLOCK)]
RATES += [*((SLOTS, way) for way in OTHERS), (LAYERS, replace(BLOCK, blocks=8))]
"""Scenes and ways whose rates are measured, the most telling ones first."""


@dataclass(frozen=True)
class Asked:
    """What the command line asks for, and when it was asked."""

    device: str
    output: Path
    workers: int
    hits: int
    largest: int
    file_hits: int
    continuum_hits: int
    only: list[str] | None
    begin: float

    @property
    def names(self) -> list[str]:
        return self.only or list(SCENES)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store."""
    asked = Asked(**vars(_parser().parse_args(argv)), begin=time.monotonic())
    try:
        device = find_device(asked.device)
    except DeviceError as error:
        print(f"gpu.py: error: {error}", file=sys.stderr)
        return 2
    if device.is_cpu and asked.device != "cpu":
        print(f'gpu.py: error: device: got "{asked.device}", but this needs a CUDA device', file=sys.stderr)
        return 2
    values: dict[str, Any] = {"device": device.name, "level": LEVEL, "machine": machine(), "tolerance": TOLERANCE}
    values |= {"agreement": {}, "rates": {}, "left_out": [], "seconds": {}}
    for part in (agreements, rates, elements, file_of, above_floor):
        begin = time.monotonic()
        part(values, asked)
        values["seconds"][part.__name__] = time.monotonic() - begin
        asked.output.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{asked.output}: {time.monotonic() - asked.begin:.0f} s in all", flush=True)
    compared = values["agreement"] | {"finite elements": values.get("continuum", {}).get("agreement", {"same": True})}
    different = [name for name, one in compared.items() if not one["same"]]
    if different:
        print(f"further from the CPU's answers than stated: {', '.join(different)}", file=sys.stderr)
    return 1 if different else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="warpimpact on a CUDA device: agreement with the CPU, and speed")
    parser.add_argument("--device", default="cuda:0", help="(default: cuda:0)")
    parser.add_argument("--output", type=Path, default=RESULTS / "gpu.json", help="(default: results/gpu.json)")
    parser.add_argument("--workers", type=int, default=min(16, cores()), help="processes that compile; 0: this one")
    parser.add_argument("--hits", type=int, default=AGREEING, help=f"compared with the CPU (default: {AGREEING})")
    parser.add_argument("--largest", type=int, default=LARGEST, help=f"hits of a rate at most (default: {LARGEST})")
    parser.add_argument("--file-hits", type=int, default=END_TO_END, help=f"into a file (default: {END_TO_END})")
    parser.add_argument("--continuum-hits", type=int, default=MOST, help=f"by finite elements (default: {MOST})")
    parser.add_argument("--only", nargs="*", choices=list(SCENES), help="scenes (default: all)")
    return parser


def scene_of(name: str, count: int) -> tuple[Scene, Shots]:
    """A scene of SCENES and `count` hits of it."""
    scene, shots = scene_and_shots(SCENES[name], count)
    if name == "lengths of their own":
        shots = replace(shots, degradation_length=np.linspace(0.45e-3, 0.6e-3, 8)[np.arange(len(shots)) % 8])
    return scene, shots


def numerics_of(name: str, way: Way) -> Numerics:
    own: dict[str, Any] = OWN.get(name, {})
    level = {} if "scheme" in own else {"level": LEVEL}
    return Numerics(**level, **own, layout=way.layout)


def each(
    function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]], workers: int
) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """(task, answer) of each task as they come, from processes that compute one each; without `workers` from this
    one."""
    if not workers:
        yield from ((task, function(*task)) for task in tasks)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        asked = {pool.submit(function, *task): task for task in tasks}
        yield from ((asked[one], one.result()) for one in as_completed(asked))


def agreements(values: dict[str, Any], asked: Asked) -> None:
    """How far the device's answers are from the CPU's; all other builds are compiled meanwhile."""
    tasks: list[tuple[Any, ...]] = [(name, None, asked) for name in asked.names]
    if asked.workers:
        tasks += [(name, way, asked) for name, way in RATES if name in asked.names and way not in (SIMPLE, BLOCK)]
    for (name, way, _), found in each(agreement, tasks, asked.workers):
        for layout, one in found.items():
            key = f"{name}, {layout}" if way is None else f"{name}, {way.name}"
            values["agreement"][key] = one
            print(f"{key}: {told(one)}", flush=True)


def agreement(name: str, way: Way | None, asked: Asked) -> dict[str, Any]:
    """Differences of one scene's answers from the CPU's, by layout: in one way, or in both layouts that there are."""
    ways = [way] if way else [SIMPLE] if name in SIMPLE_ONLY else [SIMPLE, BLOCK]
    ways[0].take()
    scene, shots = scene_of(name, min(asked.hits, AGREEING_NODAL) if "literal" in name else asked.hits)
    here = simulate(scene, shots, numerics=numerics_of(name, SIMPLE), device="cpu")
    found = {}
    for one in ways:
        there = simulate(scene, shots, numerics=numerics_of(name, one), device=asked.device)
        found[one.layout] = difference(there, here)
    return found


def difference(there: Any, here: Any) -> dict[str, Any]:
    """Residual velocity [m/s] and tilt [°] against the CPU's, of the hits that end alike."""
    alike = there.status == here.status
    off = np.stack([there.residual_velocity - here.residual_velocity, np.degrees(there.tilt - here.tilt)[:, -1]])
    off = np.abs(np.nan_to_num(off[:, alike]))  # of those that come to rest both are NaN
    found: dict[str, Any] = {"hits": len(alike), "end_otherwise": int((~alike).sum())}
    found["90 %"] = np.quantile(off, 0.9, axis=1).tolist() if alike.any() else [np.inf, np.inf]
    found["max"] = off.max(axis=1, initial=0.0).tolist()
    within = all((np.array(found[key]) <= most).all() for key, most in TOLERANCE.items())
    return found | {"same": bool(within and (~alike).sum() <= max(1, ENDING_OTHERWISE * len(alike)))}


def told(one: dict[str, Any]) -> str:
    off = ", ".join(f"{key} {one[key][0]:.2g} m/s and {one[key][1]:.2g}°" for key in TOLERANCE)
    return f"{off}, {one['end_otherwise']} of {one['hits']} end otherwise: {'same' if one['same'] else 'NOT THE SAME'}"


def rates(values: dict[str, Any], asked: Asked) -> None:
    """Hits per second, each way in a process of its own while nothing else computes."""
    for name, way in RATES:
        if name not in asked.names or (not asked.workers and way not in (SIMPLE, BLOCK)):
            continue
        if time.monotonic() - asked.begin > BUDGET - FOR_THE_FILE:
            values["left_out"].append(f"{name}, {way.name}")
            print(f"{name}, {way.name}: left out, for want of time", flush=True)
            continue
        for _, found in each(rate, [(name, way, asked)], min(1, asked.workers)):
            values["rates"].setdefault(name, {})[way.name] = found
            print(f"{name}, {way.name}: {max(found.values()):.4g} hits/s", flush=True)


def rate(name: str, way: Way, asked: Asked) -> dict[int, float]:
    """Hits per second of the march for growing numbers of hits, the preparation left out."""
    way.take()
    scene, some = scene_of(name, min(DISTINCT, asked.largest))
    found, count, taken = {}, min(SMALLEST, asked.largest), 0.0
    while count <= asked.largest and taken < LONG:
        shots = copied(some, -(-count // len(some)))[:count]
        memory = Memory(prepare(scene, shots, numerics_of(name, way)), find_device(asked.device))
        memory.build()
        taken = min(seconds(lambda memory=memory: Marching(memory).march()) for _ in range(2))
        found[count] = count / taken
        count *= GROWTH
    return found


def elements(values: dict[str, Any], asked: Asked) -> None:
    """Hits of the slotted plate by finite elements that march together: how long they take, and how far the first ones
    are from the CPU's, which march one by one."""
    if time.monotonic() - asked.begin > BUDGET - FOR_THE_FILE:
        values["left_out"].append(ELEMENTS)
        print(f"{ELEMENTS}: left out, for want of time", flush=True)
        return
    continuum = Continuum(flows=(flow_entry(MATERIAL).flow,), spacing=SPACING)
    scene, shots = scene_of(SLOTS, asked.continuum_hits)
    memory = memory_of(scene, shots, Worker("cpu"))
    begun = [
        march_of(scene, shots, number, continuum, memory.prepared.conditions, asked.device)
        for number in [0, *range(len(shots))]
    ]
    ManyHits([begun.pop(0).hit]).advance(1)  # compiles
    counts = np.array([sum(int(sheet.alive.sum()) for sheet in march.hit.sheets) for march in begun])
    hits: dict[int, Struck] = {}
    taken = seconds(lambda: hits.update(together(begun)))
    there = outcomes_of(memory, [hits[number] for number in range(len(shots))])
    here = simulate(scene, shots[:COMPARED], numerics=continuum, device="cpu")
    work = sum(int(counts[number]) * int(hit.flight["steps"]) for number, hit in hits.items())
    values["continuum"] = {"hits": len(shots), "seconds": taken, "elements": float(counts.mean())}
    values["continuum"] |= {"hits_per_second": len(shots) / taken, "nanoseconds": 1e9 * taken / work}
    values["continuum"]["agreement"] = difference(there[: len(here)], here)
    print(f"{ELEMENTS}: {len(shots) / taken:.3g} hits/s, {1e9 * taken / work:.3g} ns per element and step", flush=True)
    print(f"{ELEMENTS}: {told(values['continuum']['agreement'])}", flush=True)


def file_of(values: dict[str, Any], asked: Asked) -> None:
    """Seconds of a run of many hits of the slotted plate into a file, and its bytes, in the faster layout."""
    campaign, known = Campaign.from_toml(CAMPAIGN), values["rates"].get(SLOTS, {})
    best = {way.layout: max(known.get(way.name, {0: 0.0}).values()) for way in (SIMPLE, BLOCK)}
    layout = max(best, key=lambda one: best[one])
    hits = campaign.hits.model_copy(update={"count": asked.file_hits})
    many = campaign.model_copy(update={"hits": hits, "numerics": Numerics(level=LEVEL, layout=layout)})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.nc"
        taken = seconds(lambda: run_to_file(many, path, device=asked.device))
        size = path.stat().st_size
    values["file"] = {"hits": asked.file_hits, "layout": layout, "seconds": taken, "bytes": size}
    print(f"{asked.file_hits} hits into a file, {layout}: {taken:.3g} s, {size / 1e9:.3g} GB", flush=True)


def above_floor(values: dict[str, Any], asked: Asked) -> None:
    """How many times the best rate of the slotted plate the peak of the device would allow."""
    device, best = find_device(asked.device), [max(one.values()) for one in values["rates"].get(SLOTS, {}).values()]
    if device.is_cpu or not best or shutil.which("nvidia-smi") is None:
        return
    query = ["--query-gpu=clocks.max.sm", "--format=csv,noheader,nounits", f"--id={device.pci_bus_id}"]
    clock = float(subprocess.run(["nvidia-smi", *query], check=True, capture_output=True, text=True).stdout)
    campaign, per_cycle = Campaign.from_toml(CAMPAIGN), 64 if device.arch in (70, 72, 75, 80) else FLOAT_LANES
    peak = 2.0 * per_cycle * device.sm_count * clock * 1e6
    work = work_of(campaign.scene, shots_of(campaign, FLOOR_HITS), Numerics(level=LEVEL))
    values["floor"] = {"peak_operations_per_second": peak, "clock_mhz": clock, "work": asdict(work)}
    values["floor"]["above"] = peak / work.operations / max(best)
    print(f"the floor allows {values['floor']['above']:.3g} times as many hits/s", flush=True)


if __name__ == "__main__":
    sys.exit(main())
