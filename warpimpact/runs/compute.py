"""From shots of a campaign to their columns. Every hit map, local or distributed, is computed here."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results.table import HitTable
from warpimpact.runs.describe import described
from warpimpact.runs.levels import aim_of, level_for, shifts_of
from warpimpact.runs.pilot_hits import pilot_most, pilot_shots
from warpimpact.runs.task import Report, Task
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device
from warpimpact.solver.findings import Found, HitErrors
from warpimpact.solver.marching import Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import marched, pilot_of
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    from warpimpact.results.table import Result


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

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = lambda level: None) -> HitErrors | None:
        """See `Computation.pilot`."""
        if campaign.numerics.explicit is not None:
            return None
        pilot, numbers = pilot_shots(campaign, pilot_most(campaign))
        hits = len(campaign.sampler())
        errors = pilot_of(campaign.scene, pilot, campaign.numerics, worker, report, aim_of(campaign, hits), hits)
        return replace(errors, shifts=shifts_of(campaign, pilot, errors), tried=(), numbers=numbers)

    def found_in(self, result: Result) -> HitErrors | None:
        """The findings of the pilot of a result; None if its campaign fixed the resolution."""
        attributes = result.attrs
        if attr.RESOLUTION not in attributes:
            return None
        return HitErrors(
            *found_in(result),
            residual_velocity_error=float(attributes[attr.RESIDUAL_VELOCITY_ERROR]),
            tilt_error=math.radians(float(attributes[attr.TILT_ERROR])),
            depth_error=float(attributes.get(attr.DEPTH_ERROR, math.nan)),
            status_error=float(attributes.get(attr.STATUS_ERROR, math.nan)),
            shifts={int(level): tuple(at) for level, at in json.loads(attributes.get(attr.LEVEL_SHIFTS, "{}")).items()},
        )


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
    attributes = _errors(task.findings) | ({attr.LEVEL_FOR: what} if (what := level_for(campaign)) else {})
    return described(campaign, task, outcomes, numerics, (worker.device, elapsed), attributes)


def numerics_of(campaign: Campaign, findings: Found | None) -> Numerics:
    """The numerics of the campaign, or what its pilot found."""
    return campaign.numerics if findings is None else findings.numerics


def found_in(result: Result) -> tuple[Numerics, bool, float]:
    """The values of `Found` in the attributes of a result."""
    attributes = result.attrs
    numerics = Numerics.model_validate_json(attributes[attr.RESOLUTION])
    return numerics, bool(attributes[attr.PROMISE_KEPT]), float(json.loads(attributes[attr.ACCURACY])["share"])


def _errors(findings: Found | None) -> dict[str, Any]:
    """The errors that a pilot of a hit map found, as attributes."""
    if not isinstance(findings, HitErrors):
        return {}
    errors = {
        attr.RESIDUAL_VELOCITY_ERROR: findings.residual_velocity_error,
        attr.TILT_ERROR: math.degrees(findings.tilt_error),
        attr.DEPTH_ERROR: findings.depth_error,
        attr.STATUS_ERROR: findings.status_error,
    }
    shifts = {attr.LEVEL_SHIFTS: json.dumps(findings.shifts)} if findings.shifts else {}
    return {name: error for name, error in errors.items() if not math.isnan(error)} | shifts


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
