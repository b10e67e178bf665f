"""Who computes the hits of designs: this process, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import Job, Said, level_of, said_by
from warpimpact.results.interrupts import stop_if_asked
from warpimpact.runs.describe import made_by

TOGETHER = 16
"""Jobs that are computed between two looks for a signal, and by a worker at a time."""


@dataclass(frozen=True)
class Crew:
    """Computes jobs; the results are those of any other crew of the same kind.

    Attributes:
        said: what jobs say, in their order.
        levels: what the pilots of jobs find.
        made_by: versions and kind of device, which decide the bits.
    """

    said: Callable[[Design, Sequence[Job]], list[Said]]
    levels: Callable[[Design, Sequence[Job]], list[str]]
    made_by: dict[str, str]


def local_crew(device: str) -> Crew:
    """This process.

    Raises:
        DeviceError: the device is absent.
    """

    def said(design: Design, jobs: Sequence[Job]) -> list[Said]:
        found: list[Said] = []
        for some in parts(jobs):
            stop_if_asked()
            found += said_by(design, some, device)
        return found

    def levels(design: Design, jobs: Sequence[Job]) -> list[str]:
        found = []
        for job in jobs:
            stop_if_asked()
            found.append(level_of(design, job, device))
        return found

    return Crew(said, levels, made_by(device))


def parts(jobs: Sequence[Job]) -> list[Sequence[Job]]:
    """Jobs by TOGETHER."""
    return [jobs[first : first + TOGETHER] for first in range(0, len(jobs), TOGETHER)]
