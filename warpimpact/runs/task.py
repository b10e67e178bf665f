"""A task of a run, and the kinds of computation that a run can have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from warpimpact.campaign.campaign import Campaign
from warpimpact.results.table import HitTable
from warpimpact.scene import Shots
from warpimpact.solver.accuracy import PilotResult
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    pass


Report = Callable[[int], None]
"""Called with the progress of a job: the shots that are done, or the level that a pilot computes."""


@dataclass(frozen=True)
class Task:
    """Some shots of a campaign that are computed together.

    Attributes:
        shots: as the campaign's sampler gives them.
        findings: findings of the pilot; None if the campaign fixes the resolution.
    """

    shots: Shots
    findings: PilotResult | None = None


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

    def compute(self, campaign: Campaign, task: Task, worker: Worker, report: Report = ...) -> HitTable:
        """Compute a task: the columns of results/dataset.py, one entry per shot. They are a complete result. Reports
        how many shots are done."""

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = ...) -> PilotResult | None:
        """The findings of a pilot with hits of the campaign; None if the campaign fixes the resolution. Reports every
        level that it computes."""
