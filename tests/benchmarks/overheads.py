"""Costs of a campaign besides the march: start, compilation, file, memory.

    python tests/benchmarks/overheads.py --hits 1000000    # writes results/overheads.json

The commands are run as a user runs them. A slow result is no failure; the targets stand beside the figures.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench import CAMPAIGN, machine, store

from warpimpact.results import files

COMMAND = [sys.executable, "-c", "from warpimpact.cli import command; command()"]
TARGETS = {"help_seconds": 2.3, "warm_run_seconds": 4.0, "compilation_seconds": 5.0}
REPEATS = 3
"""Repetitions of a start."""


class Usage(NamedTuple):
    """Usage of one finished command: elapsed time [s] and peak memory [bytes]."""

    seconds: float
    peak_memory: int


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description="costs of a campaign besides the march")
    parser.add_argument("--hits", type=int, default=30_000, metavar="N", help="of the long run (default: 30000)")
    arguments = parser.parse_args(argv)
    values: dict[str, Any] = {"machine": machine()}
    with tempfile.TemporaryDirectory() as folder:
        values |= _starts(Path(folder))
        row = _long(Path(folder), arguments.hits)
    for name, target in TARGETS.items():
        print(f"{name}: {values[name]:.3g} (target: below {target:g})")
    share, memory = row["compute_seconds"] / row["seconds"], row["peak_memory"] / 2**20
    print(f"{row['count']} hits: {share:.1%} of {row['seconds']:.1f} s computing, {memory:.0f} MiB at most")
    store("overheads", values | {"hits": [row]})
    return 0


def command(*arguments: str, **environment: str) -> Usage:
    """Run the warpimpact command to its end."""
    begin = time.perf_counter()
    child = subprocess.Popen(
        [*COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=os.environ | environment
    )
    assert child.stderr is not None
    complaint = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)  # waited for here, to learn of its memory
    if child.returncode:
        raise RuntimeError(f"{' '.join(arguments)}: {complaint.decode()}")
    return Usage(time.perf_counter() - begin, 1024 * usage.ru_maxrss)


def _run(folder: Path, count: int, **environment: str) -> Usage:
    output = str(folder / "result.nc")
    return command("run", str(CAMPAIGN), "-o", output, "--overwrite", f"--count={count}", "--device=cpu", **environment)


def _starts(folder: Path) -> dict[str, float]:
    """Time of --help, of a run of 100 hits with compiled kernels, and the additional time of compilation [s]."""
    warm = min(_run(folder, 100).seconds for _ in range(REPEATS + 1))  # the first may build them
    cold = _run(folder, 100, WARP_CACHE_PATH=str(folder / "kernels")).seconds
    return {
        "help_seconds": min(command("--help").seconds for _ in range(REPEATS)),
        "warm_run_seconds": warm,
        "compilation_seconds": cold - warm,
    }


def _long(folder: Path, count: int) -> dict[str, float]:
    """A whole command with many hits."""
    usage = _run(folder, count)
    with files.read(folder / "result.nc") as dataset:
        computing = dataset.attrs["compute_time"]
    return {
        "count": count,
        "seconds": usage.seconds,
        "compute_seconds": computing,
        "peak_memory": usage.peak_memory,
    }


if __name__ == "__main__":
    sys.exit(main())
