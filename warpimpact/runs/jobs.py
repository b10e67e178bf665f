"""The tasks of a run: which shots are computed together, and the shards that they give."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import numbered
from warpimpact.results.table import HitTable
from warpimpact.runs.executor import Executor
from warpimpact.runs.shards import Shards
from warpimpact.scene import Shots

CUDA_SHOTS = 2**17
"""Shots per task on a GPU. Fewer shots would not fill it."""
CPU_SHOTS, CPU_SECONDS = 2**14, 0.5
"""Most shots of a task on the CPU of this machine, and the time that it shall take, beside which its set-up on one core
is short. A task is at least one shard; another process computes one shard per task."""


def task_size(executor: Executor, rate: float) -> int:
    """Shots per task, at a rate of shots per second; 0 stands for one shard."""
    if executor.made_by[attr.DEVICE] != "cpu":
        return CUDA_SHOTS
    return 0 if executor.is_remote else min(CPU_SHOTS, int(CPU_SECONDS * rate))


def reference_shots(campaign: Campaign, among: int, most: int) -> Shots:
    """The first shots of a reference. One stands for all where the first ones differ only in their places, and all
    layers are solid and unbounded."""
    shots = campaign.sampler().shots(0, among)
    elsewhere = (v.HIT_Y, v.HIT_Z, "offset_y", "offset_z")
    conditions = [values for name, values in shots.columns.items() if name not in elsewhere]
    unbounded = all(layer == layer.solid and layer.size is None for layer in campaign.target.layers)
    alike = unbounded and not any(np.nan_to_num(np.ptp(values, axis=0)).any() for values in conditions)
    return shots[: 1 if alike else max(1, most)]


def ranges(shards: Shards, shots: Callable[[], int]) -> Iterator[range]:
    """Ranges of missing shards. Each has about as many shots as `shots` returns when the range begins."""
    there, first = frozenset(shards.there()), 0
    while first < shards.count:
        most, stop = max(1, shots() // shards.extent), first
        while stop < min(first + most, shards.count) and stop not in there:
            stop += 1
        if stop > first:
            yield range(first, stop)
        first = max(stop, first + 1)


def split(table: HitTable, task: range, size: int) -> Iterator[tuple[int, HitTable]]:
    """The shards of a task, each with its share of the time. Only the first shard of a campaign keeps the variables of
    the whole campaign."""
    hits, of_the_campaign = table.sizes["hit"], [name for names in v.GROUPS.values() for name in names]
    for place, index in enumerate(task):
        shard = numbered(table.isel(hit=slice(place * size, (place + 1) * size)), first=index * size)
        if index:
            shard = shard.drop_vars(of_the_campaign)
        time = table.attrs[attr.COMPUTE_TIME] * shard.sizes["hit"] / hits
        yield index, shard.assign_attrs({attr.COMPUTE_TIME: time})
