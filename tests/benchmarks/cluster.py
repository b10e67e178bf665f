"""How busy a run keeps the workers of a cluster: chunks whose computation is a sleep, saved as a run saves them.

python tests/benchmarks/cluster.py    # 16 workers of this machine; writes results/cluster.json
"""

from __future__ import annotations

import argparse
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from bench import CAMPAIGN, machine, store

from warpimpact import Campaign, FastLaw, RunOptions, Store
from warpimpact.runs.compute import CHUNK_SECONDS, compute_hits
from warpimpact.runs.pipeline import open_pipeline
from warpimpact.solver.device import Worker

HITS = 2048
"""Hits of a chunk."""
ROUNDS = 20
"""Chunks of each worker."""


read_chunk = cache(xarray.load_dataset)
"""A chunk by the name of its file, which is read once in each process."""


def sleep(seconds: float, path: Path, **_: Any) -> xarray.Dataset:
    """A task that computes nothing, with the chunk of one that does."""
    time.sleep(seconds)
    return read_chunk(path)


def main() -> None:
    """Measure, print, store."""
    from cluster import sleep  # by a name that workers can import

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=16)
    workers = parser.parse_args().workers
    chunks, options = ROUNDS * workers, RunOptions("cpu", workers=workers)
    campaign = Campaign.from_toml(CAMPAIGN, count=HITS)
    one = compute_hits(campaign, np.arange(HITS), FastLaw(level=1), worker=Worker("cpu"))
    with tempfile.TemporaryDirectory() as name:
        one.to_netcdf(path := Path(name) / "chunk.nc")
        with open_pipeline(Store(Path(name) / "a.nc"), {}, options) as pipeline:
            list(pipeline.computer.map(sleep, (((f"warm_{k}", 0), (15.0, path)) for k in range(2 * workers))))
            begin = time.perf_counter()
            tasks = ((("map", k), (CHUNK_SECONDS, path)) for k in range(chunks))
            list(pipeline.computer.map(sleep, tasks, save=pipeline.chunks.save))
            elapsed = time.perf_counter() - begin
    values = {
        "machine": machine(),
        "workers": workers,
        "chunks": chunks,
        "chunk_seconds": CHUNK_SECONDS,
        "elapsed_seconds": elapsed,
        "busy": chunks * CHUNK_SECONDS / (workers * elapsed),
    }
    print(values)
    store("cluster", values)


if __name__ == "__main__":
    main()
