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

from bench import CAMPAIGN, machine, store

from warpimpact.results import files

COMMAND = [sys.executable, "-c", "from warpimpact.cli import command; command()"]
REPEATS = 3
"""Repetitions of a start."""
HITS = 30_000
"""Of the long run."""


def main() -> None:
    """Measure, print, store."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        warm = min(_run(folder, 100)[0] for _ in range(REPEATS + 1))  # the first may build the kernels
        cold = _run(folder, 100, WARP_CACHE_PATH=str(folder / "kernels"))[0]
        seconds, memory = _run(folder, HITS)
        with files.read(folder / "result.nc") as dataset:
            computing = dataset.attrs["compute_time"]
    values = {
        "machine": machine(),
        "help_seconds": min(command("--help")[0] for _ in range(REPEATS)),
        "warm_run_seconds": warm,
        "compilation_seconds": cold - warm,
        "hits": [{"count": HITS, "seconds": seconds, "compute_seconds": computing, "peak_memory": memory}],
    }
    print(values)
    store("overheads", values)


def command(*arguments: str, **environment: str) -> tuple[float, int]:
    """Run the warpimpact command to its end: elapsed time [s] and peak memory [bytes]."""
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
    return time.perf_counter() - begin, 1024 * usage.ru_maxrss


def _run(folder: Path, count: int, **environment: str) -> tuple[float, int]:
    output = str(folder / "result.nc")
    return command("run", str(CAMPAIGN), "-o", output, "--overwrite", f"--count={count}", "--device=cpu", **environment)


if __name__ == "__main__":
    main()
