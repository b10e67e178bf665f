"""What a run computes: a task, and the kind of computation that takes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from warpimpact.campaign.campaign import Campaign
from warpimpact.results.table import HitTable
from warpimpact.scene import Shots
from warpimpact.solver.findings import Found
from warpimpact.solver.marching import Progress
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    from warpimpact.results.table import Result


@dataclass(frozen=True)
class Task:
    """Some shots of a campaign that are computed together.

    Attributes:
        shots: whole groups of images, as the campaign's sampler gives them.
        solid: those of them that the solid plate of equal areal density takes, too; None for no such shots.
        found: what a pilot found; None if the campaign fixes the resolution itself.
    """

    shots: Shots
    solid: Shots | None = None
    found: Found | None = None


class Computation(Protocol):
    """What is computed of every hit of a campaign: how it ends (`HitMap`), or its limit (`studies.limit.LimitMap`)."""

    @property
    def most_solid(self) -> int:
        """Shots at most at the solid plate of equal areal density."""

    @property
    def passages(self) -> int:
        """How many times as long as a passage that nothing hinders a hit takes, roughly."""

    @property
    def content(self) -> Mapping[str, str]:
        """What decides the bits of a result, beside the campaign, the versions and the device."""

    @property
    def measures(self) -> Sequence[str]:
        """Whose running estimates are shown; those of a hit map where there are none."""

    def compute(self, campaign: Campaign, task: Task, worker: Worker, progress: Progress | None = None) -> HitTable:
        """Compute a task: the columns of results/dataset.py, one entry per shot; they are a complete result."""

    def assumed(self, campaign: Campaign, found: Found | None, worker: Worker) -> HitTable:
        """Some hits of the campaign under assumptions, as `runs.assumed.assumed` has them.

        Args:
            found: as in a task.
        """

    def pilot(self, campaign: Campaign, worker: Worker, trying: Callable[[int], object]) -> Found | None:
        """What a pilot of the campaign's own hits finds; None if the campaign fixes the resolution itself.

        Args:
            trying: called with every level that the pilot computes.
        """

    def found_in(self, result: Result) -> Found | None:
        """What the pilot of a result found."""
