"""Who computes the hits of designs: this process, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import Job, Said, Told, level_of, said_by, untold
from warpimpact.results.interrupts import stop_if_asked
from warpimpact.runs.cluster import LISTEN_EVERY, check_alike, connected
from warpimpact.runs.describe import made_by
from warpimpact.runs.team import awaited

TOGETHER = 16
"""Jobs that are computed between two looks for a signal, and by a worker at a time."""


@dataclass(frozen=True)
class Crew:
    """Computes jobs; the results are those of any other crew of the same kind.

    Attributes:
        said: what jobs say, in their order; tells how many are done.
        levels: what the pilots of jobs find; tells, too.
        made_by: versions and kind of device, which decide the bits.
    """

    said: Callable[[Design, Sequence[Job], Told], list[Said]]
    levels: Callable[[Design, Sequence[Job], Told], list[str]]
    made_by: dict[str, str]


def local_crew(device: str) -> Crew:
    """This process.

    Raises:
        DeviceError: the device is absent.
    """

    def said(design: Design, jobs: Sequence[Job], told: Told) -> list[Said]:
        found: list[Said] = []
        for some in parts(jobs):
            stop_if_asked()
            found.extend(said_by(design, some, device, told=lambda done: told(len(found) + done)))
        return found

    def levels(design: Design, jobs: Sequence[Job], told: Told) -> list[str]:
        found: list[str] = []
        for job in jobs:
            stop_if_asked()
            told(len(found))
            found.append(level_of(design, job, device, lambda level: told(len(found))))
        return found

    return Crew(said, levels, made_by(device))


def parts(jobs: Sequence[Job]) -> list[Sequence[Job]]:
    """Jobs by TOGETHER."""
    return [jobs[first : first + TOGETHER] for first in range(0, len(jobs), TOGETHER)]


@contextmanager
def cluster_crew(*, address: str | None = None, workers: int | None = None, device: str = "auto") -> Iterator[Crew]:
    """The workers of a Dask cluster.

    Args:
        address, workers, device: as in `cluster_team`.

    Raises:
        ClusterError, DeviceError: as in `cluster_team`.
    """
    with connected(address, workers) as (reached, executor, threads):

        def each(function: Callable[..., Any], calls: Sequence[tuple[Any, ...]], told: Told = untold) -> list[Any]:
            futures, ended = [reached.asked(executor.submit, function, *call) for call in calls], []
            try:
                for future in futures:
                    ended.append(awaited(future, LISTEN_EVERY, reached.threads))
                    told(len(ended))
                return ended
            finally:
                for future in futures:
                    future.cancel()

        (kind,) = each(made_by, [(device,)])

        def said(design: Design, jobs: Sequence[Job], told: Told) -> list[Said]:
            calls = [(design, some, device, threads, kind) for some in parts(jobs)]
            of_parts = each(_said_alike, calls, lambda done: told(min(done * TOGETHER, len(jobs))))
            return [one for some in of_parts for one in some]

        def levels(design: Design, jobs: Sequence[Job], told: Told) -> list[str]:
            return each(level_of, [(design, job, device) for job in jobs], told)

        yield Crew(said, levels, kind)


def _said_alike(
    design: Design, jobs: Sequence[Job], device: str, threads: int | None, kind: dict[str, str]
) -> list[Said]:
    """Compute jobs on a worker that gives the same bits as the others."""
    check_alike(device, kind)
    return said_by(design, jobs, device, threads)
