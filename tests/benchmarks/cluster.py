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

import xarray
from bench import CAMPAIGN, machine, store

from warpimpact import Campaign, FastLaw, RunOptions, Store, run
from warpimpact.records import attributes as attr
from warpimpact.runs.compute import CHUNK_SECONDS
from warpimpact.runs.pipeline import open_pipeline

HITS = 2048
"""Hits of a chunk."""
ROUNDS = 20
"""Chunks of each worker."""


@cache
def chunk() -> xarray.Dataset:
    """What a worker gives for a chunk, but for the first one of a run; computed once in each process."""
    campaign = Campaign.from_toml(CAMPAIGN, count=HITS)
    campaign = campaign.model_copy(update={"numerics": FastLaw(level=1)})
    whole = run(campaign, options=RunOptions("cpu")).to_dataset()
    chunk = whole.drop_vars([name for name, of in whole.variables.items() if "hit" not in of.dims])
    return chunk.assign_attrs({name: value for name, value in whole.attrs.items() if name in attr.versions()})


def sleep(seconds: float, **_: Any) -> xarray.Dataset:
    """A task that computes nothing."""
    time.sleep(seconds)
    return chunk()


def main() -> None:
    """Measure, print, store."""
    from cluster import sleep  # by a name that workers can import

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=16)
    workers = parser.parse_args().workers
    chunks = ROUNDS * workers
    with (
        tempfile.TemporaryDirectory() as folder,
        open_pipeline(Store(Path(folder) / "a.nc"), {}, RunOptions("cpu", workers=workers)) as pipeline,
    ):
        list(pipeline.computer.map(sleep, (((f"warm_{k}", 0), (15.0,)) for k in range(2 * workers))))
        begin = time.perf_counter()
        tasks = ((("map", k), (CHUNK_SECONDS,)) for k in range(chunks))
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
