"""From shots of a campaign to their columns. Every hit map, local or distributed, is computed here."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.table import HitTable
from warpimpact.runs.describe import described
from warpimpact.runs.task import Report, Task
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.accuracy import PilotResult, pilot_size
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import marched, pilot_of, spread_places
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class HitMap:
    """The `Computation` of how every hit of a campaign ends."""

    reference_hits: ClassVar[int] = 2**12
    passages: ClassVar[int] = 1
    content: ClassVar[Mapping[str, str]] = {}
    measures: ClassVar[Sequence[str]] = ()

    def of_reference(self, campaign: Campaign, name: str) -> HitMap:
        """See `Computation.of_reference`."""
        return self

    def compute(self, campaign: Campaign, task: Task, worker: Worker, report: Report = lambda done: None) -> HitTable:
        """See `compute`."""
        return compute(campaign, task, worker, report)

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = lambda level: None) -> PilotResult | None:
        """See `Computation.pilot`."""
        if campaign.numerics.explicit is not None:
            return None
        pilot, numbers = pilot_shots(campaign, pilot_size(campaign.numerics.asked))
        return replace(pilot_of(campaign.scene, pilot, campaign.numerics, worker, report), numbers=numbers)


HIT_MAP = HitMap()


def compute(campaign: Campaign, task: Task, worker: Worker, report: Report = lambda done: None) -> HitTable:
    """Compute some shots of a campaign.

    Returns:
        The columns of results/dataset.py, one entry per shot. They are a complete result.

    Raises:
        DeviceError: the device is absent.
    """
    numerics = numerics_of(campaign, task.findings)
    progress = lambda done, total: report(done)  # noqa: E731
    outcomes, elapsed = _outcomes(campaign.scene, task.shots, numerics, worker, progress)
    return described(campaign, task, outcomes, numerics, (worker.device, elapsed), {})


def pilot_shots(campaign: Campaign, most: int) -> tuple[Shots, NDArray[np.int64]]:
    """At most so many hits that stand for all hits of a campaign, and their numbers.

    They depend on the campaign alone: the first ones of a Sobol or random sampling, or ones at even distances of a grid
    or list.
    """
    sampler = campaign.sampler()
    count = min(most, len(sampler))
    if campaign.hits.sampling in ("sobol", "random"):
        return sampler.shots(0, count), np.arange(count)
    places = spread_places(len(sampler), count)
    return Shots.joined([sampler.shots(int(place), 1) for place in places]), places


def numerics_of(campaign: Campaign, findings: PilotResult | None) -> Numerics:
    """The numerics of the campaign, or what its pilot found."""
    return campaign.numerics if findings is None else findings.numerics


def _outcomes(
    scene: Scene, shots: Shots, numerics: Numerics, worker: Worker, progress: Progress | None = None
) -> tuple[Outcomes, float]:
    """Outcomes of shots, and the time to prepare and compute them [s], without the build of the kernels."""
    begin = time.perf_counter()
    prepared = prepare(scene, shots, numerics)
    memory = Memory(prepared, find_device(worker.device), worker.cancel)
    building = memory.build()
    outcomes = marched(memory, worker, progress)
    return outcomes, time.perf_counter() - begin - building
