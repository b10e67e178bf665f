"""Costs of a campaign besides the march: start, compilation, file, memory.

    python tests/benchmarks/overheads.py --largest 1000000    # writes results/overheads.json

The commands are run as a user runs them. A slow result is no failure; the targets stand beside the figures. The two
ratios are of commands that run in turn: a run of 100 hits to the bare imports, and a run less such a small one to
`simulate` with the same shots. Each is given in elapsed time and in processor time, which tells more on a busy machine.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bench import CAMPAIGN, machine, store

from warpimpact.results import files

COMMAND = [sys.executable, "-c", "from warpimpact.cli import command; command()"]
IMPORTS = [sys.executable, "-c", "import warp, numpy, netCDF4, xarray; warp.init()"]
SIMULATE = """
import sys, time
from warpimpact import Campaign, simulate
from warpimpact.runs.compute import HitMap
from warpimpact.solver.worker import Worker
campaign = Campaign.from_toml(sys.argv[1], count=int(sys.argv[2]))
numerics, shots = HitMap().pilot(campaign, Worker("cpu")).numerics, campaign.sampler().shots(0, int(sys.argv[2]))
simulate(campaign.scene, shots[:64], numerics=numerics, device="cpu")
begin = time.perf_counter(), time.process_time()
simulate(campaign.scene, shots, numerics=numerics, device="cpu")
print(time.perf_counter() - begin[0], time.process_time() - begin[1])
"""
"""Prints the elapsed and the processor time of the shots of a campaign at the level of its promise [s]."""
TARGETS = {"help_seconds": 0.3, "warm_run_seconds": 2.0, "compilation_seconds": 5.0}
START_TARGET, CAMPAIGN_TARGET = 1.5, 1.1
SMALL, COUNTS = 100, (16_384, 65_536)
"""Hits of a run that is all start, and of those whose time is compared with `simulate`."""
SMALLEST, PER_DECADE = 1000, 2
REPEATS, TURNS = 3, 5
"""Repetitions of a start, and of the ratios."""


class Usage(NamedTuple):
    """Usage of one finished command: elapsed and processor time [s], and peak memory [bytes]."""

    seconds: float
    processor: float
    peak_memory: int


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description="costs of a campaign besides the march")
    parser.add_argument("--largest", type=int, default=30_000, metavar="N", help="hits at most (default: 30000)")
    arguments = parser.parse_args(argv)
    values: dict[str, Any] = {"machine": machine()}
    with tempfile.TemporaryDirectory() as folder:
        values |= _ratios(Path(folder))
        values |= _starts(Path(folder))
        values["hits"] = _hits(Path(folder), arguments.largest)
    for name, target in TARGETS.items():
        print(f"{name}: {values[name]:.3g} (target: below {target:g})")
    for row in values["hits"]:
        share = row["compute_seconds"] / row["seconds"]
        rate, memory = row["hits_per_second"], row["peak_memory"] / 2**20
        print(f"{row['count']} hits: {rate:.4g} hits/s, {share:.1%} of the time computing, {memory:.0f} MiB at most")
    store("overheads", values)
    return 0


def command(*arguments: str, **environment: str) -> Usage:
    """Run the warpimpact command to its end."""
    return used([*COMMAND, *arguments], **environment)


def used(command: list[str], **environment: str) -> Usage:
    """Run a command to its end."""
    begin = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=os.environ | environment)
    assert child.stderr is not None
    complaint = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)  # waited for here, to learn of its memory
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)}: {complaint.decode()}")
    return Usage(time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss)


def _run(folder: Path, count: int, **environment: str) -> Usage:
    output = str(folder / "result.nc")
    return command("run", str(CAMPAIGN), "-o", output, "--overwrite", f"--count={count}", "--device=cpu", **environment)


def _ratios(folder: Path) -> dict[str, Any]:
    """Small runs to bare imports, and runs less a small one to `simulate`: medians over repetitions in turn."""
    _run(folder, SMALL)  # the first may build the kernels
    starts = [(used(IMPORTS), _run(folder, SMALL)) for _ in range(TURNS)]
    start = {
        "imports_seconds": statistics.median(imports.seconds for imports, _ in starts),
        "run_seconds": statistics.median(small.seconds for _, small in starts),
        "ratio": statistics.median(small.seconds / imports.seconds for imports, small in starts),
        "processor_ratio": statistics.median(small.processor / imports.processor for imports, small in starts),
    }
    elapsed, processor = start["ratio"], start["processor_ratio"]
    print(f"run of {SMALL} hits / imports: {elapsed:.2f}, processor {processor:.2f} (target: {START_TARGET})")
    rows = []
    for count in COUNTS:
        turns = [(_run(folder, SMALL), _simulated(count), _run(folder, count)) for _ in range(TURNS)]
        ratios = [(large.seconds - small.seconds) / alone[0] for small, alone, large in turns]
        of_processor = [(large.processor - small.processor) / alone[1] for small, alone, large in turns]
        row = {
            "count": count,
            "simulate_seconds": statistics.median(alone[0] for _, alone, _ in turns),
            "ratio": statistics.median(ratios),
            "processor_ratio": statistics.median(of_processor),
        }
        rows.append(row)
        elapsed, processor = row["ratio"], row["processor_ratio"]
        print(f"{count} hits / simulate: {elapsed:.3f}, processor {processor:.3f} (target: {CAMPAIGN_TARGET})")
    return {"start": start, "campaign": rows}


def _simulated(count: int) -> tuple[float, float]:
    """Elapsed and processor time of `simulate` alone [s]."""
    done = subprocess.run(
        [sys.executable, "-c", SIMULATE, str(CAMPAIGN), str(count)], capture_output=True, text=True, check=True
    )
    elapsed, processor = map(float, done.stdout.split()[-2:])
    return elapsed, processor


def _starts(folder: Path) -> dict[str, float]:
    """Time of --help, of a run of 100 hits with compiled kernels, and the additional time of compilation [s]."""
    warm = min(_run(folder, 100).seconds for _ in range(REPEATS + 1))  # the first may build them
    cold = _run(folder, 100, WARP_CACHE_PATH=str(folder / "kernels")).seconds
    return {
        "help_seconds": min(command("--help").seconds for _ in range(REPEATS)),
        "warm_run_seconds": warm,
        "compilation_seconds": cold - warm,
    }


def _hits(folder: Path, largest: int) -> list[dict[str, float]]:
    """Whole commands with growing numbers of hits."""
    rows = []
    smallest = min(SMALLEST, largest)
    for count in np.geomspace(smallest, largest, 1 + math.ceil(PER_DECADE * math.log10(largest / smallest))).astype(
        int
    ):
        usage = _run(folder, int(count))
        with files.read(folder / "result.nc") as dataset:
            computing = dataset.attrs["compute_time"]
        rows.append(
            {
                "count": int(count),
                "seconds": usage.seconds,
                "compute_seconds": computing,
                "hits_per_second": count / computing,
                "peak_memory": usage.peak_memory,
            }
        )
    return rows


if __name__ == "__main__":
    sys.exit(main())
