"""Costs of a campaign besides the march: start, compilation, file, memory.

    python tests/benchmarks/overheads.py    # writes results/overheads.json

The commands are run as a user runs them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from bench import CAMPAIGN, machine, store

from warpimpact.results import files

COMMAND = [sys.executable, "-c", "from warpimpact.cli import command; command()"]
REPEATS = 3
"""Repetitions of a start."""
HITS = 30_000
"""Of the long run."""


class Usage(NamedTuple):
    """Usage of one finished command: elapsed time [s] and peak memory [bytes]."""

    seconds: float
    peak_memory: int


def main() -> None:
    """Measure, print, store."""
    with tempfile.TemporaryDirectory() as folder:
        values = {"machine": machine(), **_starts(Path(folder)), "hits": [_long(Path(folder))]}
    print(values)
    store("overheads", values)


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


def _long(folder: Path) -> dict[str, float]:
    """A whole command with many hits."""
    usage = _run(folder, HITS)
    with files.read(folder / "result.nc") as dataset:
        computing = dataset.attrs["compute_time"]
    return {
        "count": HITS,
        "seconds": usage.seconds,
        "compute_seconds": computing,
        "peak_memory": usage.peak_memory,
    }


if __name__ == "__main__":
    main()
