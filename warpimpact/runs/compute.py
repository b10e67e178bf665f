"""From shots of a campaign to their columns: the kinds of computation that a run can have, and that of a hit map."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.results.table import HitTable
from warpimpact.runs.describe import described
from warpimpact.scene import Numerics, Shots
from warpimpact.solver.accuracy import PilotResult, pilot_size
from warpimpact.solver.device import find_device
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import marched, pilot_of, spread_places
from warpimpact.solver.worker import Worker

Report = Callable[[int], None]
"""Called with the progress of a job: the shots that are done, or the level that a pilot computes."""


class Computation(Protocol):
    """What is computed for every hit of a campaign: its outcome (`HitMap`), or its limit (`studies.limit.LimitMap`).

    The methods with `worker` and `report` are the jobs of a run.
    """

    @property
    def reference_hits(self) -> int:
        """Most hits of a reference of the campaign."""

    @property
    def passages(self) -> int:
        """Rough ratio of the time of a hit to that of an unhindered passage."""

    @property
    def content(self) -> Mapping[str, str]:
        """What determines the bits of a result, beside the campaign, the versions and the device."""

    @property
    def measures(self) -> Sequence[str]:
        """Measures whose running estimates are shown; empty for those of a hit map."""

    def of_reference(self, campaign: Campaign, name: str) -> Self | None:
        """The computation for the hits of a reference of the campaign; None if it has none for this one."""

    def compute(
        self, campaign: Campaign, shots: Shots, pilot: PilotResult | None, worker: Worker, report: Report = ...
    ) -> HitTable:
        """Compute shots of the campaign at the resolution that its pilot found, or that it fixes.

        Reports how many shots are done.

        Returns:
            The columns of results/dataset.py, one entry per shot. They are a complete result.

        Raises:
            DeviceError: the device is absent.
        """

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = ...) -> PilotResult | None:
        """The result of a pilot with hits of the campaign; None if the campaign fixes the resolution. Reports every
        level that it computes."""


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

    def compute(
        self,
        campaign: Campaign,
        shots: Shots,
        pilot: PilotResult | None,
        worker: Worker,
        report: Report = lambda done: None,
    ) -> HitTable:
        """See `Computation.compute`. The time of the result is without the build of the kernels."""
        numerics, begin = numerics_of(campaign, pilot), time.perf_counter()
        memory = Memory(prepare(campaign.scene, shots, numerics), find_device(worker.device), worker.cancel)
        building = memory.build()
        outcomes = marched(memory, worker, lambda done, total: report(done))
        elapsed = time.perf_counter() - begin - building
        return described(campaign, shots, pilot, outcomes, numerics, (worker.device, elapsed), {})

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = lambda level: None) -> PilotResult | None:
        """See `Computation.pilot`."""
        if campaign.numerics.explicit is not None:
            return None
        shots, numbers = pilot_shots(campaign, pilot_size(campaign.numerics.asked))
        return replace(pilot_of(campaign.scene, shots, campaign.numerics, worker, report), numbers=numbers)


HIT_MAP = HitMap()


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


def numerics_of(campaign: Campaign, pilot: PilotResult | None) -> Numerics:
    """The numerics of the campaign, or what its pilot found."""
    return campaign.numerics if pilot is None else pilot.numerics
