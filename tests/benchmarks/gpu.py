"""warpimpact on a CUDA device: hits per second of both layouts on some levels, ratio to the floor, comparison with
the CPU, and ten million hits into a file.

    python tests/benchmarks/gpu.py              # writes results/gpu.json, within ten minutes

It needs the checkout and warpimpact's dependencies, no installation. The exit code is 1 if the device's answers differ
from the CPU's by more than stated, and 2 if there is no CUDA device.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from bench import CAMPAIGN, copied, machine, seconds, shots_of, store
from floor import work_of

from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.runs.run import run_to_file
from warpimpact.scene import Numerics, Record, Scene, Shots
from warpimpact.solver.device import DeviceError, find_device
from warpimpact.solver.simulate import simulate

LEVELS = (0, 2, 6)
LAYOUTS = {0: ("simple", "block"), 2: ("simple", "block"), 6: ("simple",)}
"""Layouts that are measured; windows of level 6 do not fit a block."""
END_TO_END = 10_000_000
"""Number of hits that are computed into a file."""
AIM = {"standard [hits/s]": 1e6, "end to end [s]": 30.0}
SMALLEST, GROWTH = 1024, 4
LONGEST = 4.0
"""The number of hits of a level grows until a run takes this long [s]."""
DISTINCT = 2**16
"""Number of different hits in a run; larger runs repeat them."""
SAME_HITS, FLOOR_HITS = 512, 16
TOLERANCE = {"90 %": (0.005, 0.02), "max": (0.1, 0.5)}
"""Differences from the CPU in single precision: residual velocity [m/s] and tilt at the last stand-off [°]. Another
order of summation makes as much difference as single precision against double: 0.012 m/s and 0.04° at most over 6144
hits."""
LANES = 128
"""float32 lanes per multiprocessor, as on compute capability 8.6, 8.9, 9.0, 10 and 12; 64 on 7.x and 8.0."""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store."""
    arguments = _parser().parse_args(argv)
    try:
        device = find_device(arguments.device)
    except DeviceError:
        device = None
    if device is None or not device.is_cuda:
        print(f'gpu.py: error: device: got "{arguments.device}", but this needs a CUDA device', file=sys.stderr)
        return 2
    clock = arguments.clock or clock_of(device)
    lanes = 64 if device.arch in (70, 72, 75, 80) else LANES
    peak = 2.0 * lanes * device.sm_count * clock * 1e6
    print(
        f"{device.name}: {device.sm_count} multiprocessors × {lanes} lanes × 2 operations × {clock:g} MHz = "
        f"{peak / 1e12:.3g} TFLOP/s assumed"
    )
    values = measure(Campaign.from_toml(CAMPAIGN), arguments.device, peak)
    values |= {"device": device.name, "clock_mhz": clock, "multiprocessors": device.sm_count, "lanes": lanes}
    values |= {"peak_operations_per_second": peak, "machine": machine()}
    store("gpu", values)
    if not values["same"]:
        print("the device's answers are further from the CPU's than stated", file=sys.stderr)
    return 0 if values["same"] else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="warpimpact on a CUDA device: speed, floor, equality with the CPU")
    parser.add_argument("--device", default="cuda:0", help="(default: cuda:0)")
    parser.add_argument(
        "--clock", type=float, metavar="MHZ", help="multiprocessor clock (default: nvidia-smi's highest)"
    )
    return parser


def clock_of(device: Any) -> float:
    """Highest clock of the multiprocessors [MHz]; exits if nvidia-smi does not give it."""
    query = ["--query-gpu=clocks.max.sm", "--format=csv,noheader,nounits", f"--id={device.pci_bus_id}"]
    if shutil.which("nvidia-smi") is None:
        sys.exit("gpu.py: error: there is no nvidia-smi to ask for the clock; give --clock")
    return float(subprocess.run(["nvidia-smi", *query], check=True, capture_output=True, text=True).stdout)


def measure(campaign: Campaign, device: str, peak: float) -> dict[str, Any]:
    """All figures of a device with a peak of `peak` operations per second; each is printed when it is known."""
    values: dict[str, Any] = {"levels": {}, "tolerance": TOLERANCE, "aim": AIM, "same": True}
    for name in LEVELS:
        work = work_of(campaign, shots_of(campaign, FLOOR_HITS), Numerics(level=name))
        floor = peak / work.operations
        print(f"level {name}: the floor allows {floor:.3g} hits/s")
        print(f"  {work.steps:.3g} steps, {work.operations:.3g} operations")
        found = {layout: of_layout(campaign, name, layout, device, floor) for layout in LAYOUTS[name]}
        values["levels"][name] = {"floor_hits_per_second": floor, "work": asdict(work), "layouts": found}
        values["same"] &= all(one["same"] for one in found.values())
    values["end_to_end"] = {layout: end_to_end(campaign, layout, device) for layout in LAYOUTS[2]}
    return values


def of_layout(campaign: Campaign, level: int, layout: str, device: str, floor: float) -> dict[str, Any]:
    """Speed of one layout, and its difference from the CPU's simple layout."""
    numerics = Numerics(level=level, layout=layout)
    rates, differences = growth(campaign, numerics, device), difference(campaign, numerics, device)
    same = all((np.array(differences[key]) <= TOLERANCE[key]).all() for key in TOLERANCE)
    best = max(rates.values())
    print(f"level {level}, {layout}: {best:.4g} hits/s; the floor allows {floor / best:.3g} times as many")
    print(f"  against the CPU on {SAME_HITS} hits: {_told(differences)}: {'same' if same else 'NOT THE SAME'}")
    return {"hits_per_second": rates, "above_floor": floor / best, "difference": differences, "same": same}


def end_to_end(campaign: Campaign, layout: str, device: str) -> dict[str, float]:
    """Seconds of a run of END_TO_END hits into a file, and its bytes."""
    hits = campaign.hits.model_copy(update={"count": END_TO_END})
    many = campaign.model_copy(update={"hits": hits, "numerics": Numerics(layout=layout)})
    few = many.model_copy(update={"hits": hits.model_copy(update={"count": SMALLEST})})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.nc"
        run_to_file(few, path, device=device)  # builds the kernels
        taken = seconds(lambda: run_to_file(many, path, device=device, overwrite=True))
        print(f"{END_TO_END} hits into a file, {layout}: {taken:.3g} s, {path.stat().st_size / 1e9:.3g} GB", flush=True)
        return {"seconds": taken, "bytes": path.stat().st_size}


def growth(campaign: Campaign, numerics: Numerics, device: str) -> dict[int, float]:
    """Hits per second for growing numbers of hits."""
    shots, rates, count, taken = shots_of(campaign, DISTINCT), {}, SMALLEST, 0.0
    _simulate(campaign, shots[:SMALLEST], numerics, device)  # builds the kernels
    while taken * GROWTH < LONGEST:
        some = copied(shots, -(-count // DISTINCT))[:count]
        taken = min(seconds(lambda some=some: _simulate(campaign, some, numerics, device)) for _ in range(2))
        rates[count] = count / taken
        print(f"  level {numerics.level}, {numerics.layout}: {count} hits at {rates[count]:.4g} hits/s", flush=True)
        count *= GROWTH
    return rates


def _simulate(campaign: Campaign, shots: Shots, numerics: Numerics, device: str) -> Outcomes:
    record = Record(standoffs=campaign.output.standoffs[-1:])
    scene = Scene(core=campaign.core, target=campaign.plate, record=record)
    return simulate(scene, shots, numerics=numerics, device=device)


def difference(campaign: Campaign, numerics: Numerics, device: str) -> dict[str, tuple[float, float]]:
    """Residual velocity [m/s] and tilt [°] on a device against the CPU; infinite where a status differs."""
    shots = shots_of(campaign, SAME_HITS)
    simple = numerics.model_copy(update={"layout": "simple"})
    there, here = _simulate(campaign, shots, numerics, device), _simulate(campaign, shots, simple, "cpu")
    off = np.stack([there.residual_velocity - here.residual_velocity, np.degrees(there.tilt - here.tilt)[:, -1]])
    off = np.abs(np.where(there.status == here.status, off, np.inf))
    return {"90 %": tuple(np.quantile(off, 0.9, axis=1).tolist()), "max": tuple(off.max(axis=1).tolist())}


def _told(differences: dict[str, tuple[float, float]]) -> str:
    return ", ".join(f"{key} {one:.2g} m/s and {other:.2g}°" for key, (one, other) in differences.items())


if __name__ == "__main__":
    sys.exit(main())
